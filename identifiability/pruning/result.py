"""`Ladder`: the rungs from the unpruned model down, which one to use, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from identifiability.assessment import RungResult, physical_dict
from identifiability.estimation import Method
from identifiability.grouping import BaseParameters
from identifiability.information import Information
from identifiability.ladder import (
    LadderEntry,
    LadderSource,
    Rung,
    ladder_text,
    rung_entry,
)
from identifiability.output import write_json, write_text
from identifiability.pruning.absorption import Absorption
from identifiability.pruning.elimination import Refusal
from identifiability.pruning.moves import Partition
from identifiability.pruning.rung import PrunedRung
from identifiability.pruning.selection import Criterion
from identifiability.pruning.stability import Stability
from identifiability.pruning.words import statement
from identifiability.robot import Robot
from identifiability.samples.longsamples import Prepared
from identifiability.statement import state_provenance
from identifiability.verdict import Verdict

SCHEMA = "identifiability/pruning/1"


@dataclass(frozen=True)
class Ladder:
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away.

    Attributes
    ----------
    robot : Robot
    base : BaseParameters
    samples, validation : tuple of Samples
    information : Information
        About the base parameters.
    start : Rung
        The model that pruning started from.
    rungs : tuple of PrunedRung
        Unpruned model first.
    selected : int
        The rung to use.
    result : RungResult
        The rung to use with verdicts, uncertainties by resampling, and physical certificate.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    stability : Stability
    absorption : Absorption
    effects : tuple of str
    criterion, method, seed
        As asked for.
    least : int
        The rung with the least held-out error.
    source : LadderSource
        Where the model that pruning started from came from.
    settings : mapping
        Other options that decided the numbers.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check, and what was not
        used.
    shapes : mapping
        Shapes of the model's effects by ``<joint>.<effect>``.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    """

    robot: Robot
    base: BaseParameters
    samples: tuple[Prepared, ...]
    validation: tuple[Prepared, ...]
    information: Information
    start: Rung
    rungs: tuple[PrunedRung, ...]
    selected: int
    result: RungResult
    refused: tuple[Refusal, ...]
    stability: Stability
    absorption: Absorption
    effects: tuple[str, ...]
    criterion: Criterion
    method: Method
    seed: int
    least: int
    source: LadderSource
    settings: Mapping[str, object]
    hints: tuple[str, ...] = ()
    shapes: Mapping[str, float] = field(default_factory=dict)
    nothing: str = ""

    @property
    def chosen(self) -> PrunedRung:
        """The rung to use."""
        return self.rungs[self.selected]

    @property
    def full(self) -> PrunedRung:
        """The unpruned model."""
        return self.rungs[0]

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the parameters of the rung to use."""
        return self.result.verdicts

    @property
    def feasible(self) -> bool:
        """Whether a real robot can have the values of the rung to use."""
        return self.result.feasible

    @property
    def partition(self) -> Partition:
        """What became of each column of the starting model."""
        return self.chosen.step.partition

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        return " ".join((statement(self), *self.hints))

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed, options, and hashes of the inputs."""
        options = {"method": self.method, "criterion": self.criterion, **self.settings}
        logs = (*self.samples, *self.validation)
        return state_provenance(self.robot, logs, self.seed, self.source, options)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter of the rung to use."""
        return pd.DataFrame([v.to_row() for v in self.verdicts])

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a rung."""
        return pd.DataFrame([r.row() for r in self.rungs])

    def stability_frame(self) -> pd.DataFrame:
        """Return how often each parameter of the starting model survives."""
        kept = self.partition.survivors()
        return pd.DataFrame(
            {"name": self.stability.columns, "survives": self.stability.survives, "chosen": kept}
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        physical = self.result.physical
        return {
            "schema": SCHEMA,
            "robot": {"name": self.robot.name, "title": self.robot.title},
            "samples": self.information.samples,
            "statement": self.statement,
            "hints": list(self.hints),
            "nothing": self.nothing or None,
            "models": [r.row() for r in self.rungs],
            "selected": self.chosen.name,
            "parameters": [v.to_row() for v in self.verdicts],
            "full_parameters": [v.to_row() for v in self.full.verdicts],
            "refused": [
                {"move": r.move.text, "why": r.move.why, "reason": r.reason} for r in self.refused
            ],
            "stability": {
                "replicates": self.stability.replicates,
                "same": self.stability.same,
                "survives": dict(
                    zip(self.stability.columns, self.stability.survives.tolist(), strict=True)
                ),
                "models": [{"columns": m, "share": s} for m, s in self.stability.models],
            },
            "absorption": self.absorption.to_frame().to_dict("records"),
            "physical": {
                "feasible": self.feasible,
                "margin": self.result.margin,
                "infeasible": list(self.result.infeasible),
                "sentence": physical.sentence,
                "error_ra_validation": self.result.error_ra_physical,
                **physical_dict(self.robot, self.result, self.shapes),
            },
            "ladder": self.model_text,
            "effects": list(self.effects),
            "criterion": self.criterion,
            "method": self.method,
            "seed": self.seed,
            "provenance": self.provenance,
        }

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON, whole or not at all."""
        return write_json(path, self.to_dict())

    def write_model(self, path: str | Path) -> Path:
        """Write the chosen model as a model file (a ladder of one rung), for every other verb."""
        return write_text(path, self.model_text)

    @property
    def model_text(self) -> str:
        """The chosen model as the text of a model file."""
        title = self.robot.title or self.robot.name
        return ladder_text(self.to_ladder(), f"{title}: the model that pruning chose.")

    def to_ladder(self) -> LadderEntry:
        """Return the chosen model as a ladder of one rung, for `analyze`, `diagnose` and others."""
        return LadderEntry(models=[rung_entry(self.chosen.rung, self.base, self.effects)])

    def write_report(self, path: str | Path) -> Path:
        """Write the result as one self-contained HTML file, whole or not at all."""
        from identifiability.report.pruning_report import (  # noqa: PLC0415 - roof above us
            write_pruning_report,
        )

        return write_pruning_report(self, path)

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.statement)}</p>{self.ladder_frame().to_html(escape=True)}"
