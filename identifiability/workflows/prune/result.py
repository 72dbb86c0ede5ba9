"""`Ladder`: the rungs from the unpruned model down, which one to use, and why."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.errors import listing
from identifiability.foundation.output import write_text
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.physical.mass import state_masses
from identifiability.regression.information import Information
from identifiability.regression.reduction import (
    LadderEntry,
    LadderSource,
    Rung,
    ladder_text,
    rung_entry,
)
from identifiability.workflows.analyze.errors import (
    errors_dict,
    physical_dict,
    state_raw,
    tell_errors,
)
from identifiability.workflows.analyze.keep import keep_fit
from identifiability.workflows.analyze.words import state_physics
from identifiability.workflows.opening import Opening
from identifiability.workflows.predict import Fit, Predicts
from identifiability.workflows.provenance import state_provenance
from identifiability.workflows.prune.absorption import Absorption
from identifiability.workflows.prune.elimination import Refusal
from identifiability.workflows.prune.moves import Partition
from identifiability.workflows.prune.rung import Measured, PrunedRung
from identifiability.workflows.prune.search import Criterion
from identifiability.workflows.prune.stability import Stability


@frozen(kw_only=True)
class Ladder(Result, Opening, Measured, Predicts):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away.

    Attributes
    ----------
    information : Information
        About the base parameters.
    start : Rung
        The model that pruning started from.
    selected, least : int
        The rung to use, and the one with the least held-out error.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    stability : Stability
    absorption : Absorption
    criterion, method, seed
        As asked for.
    source : LadderSource
        Where the model that pruning started from came from.
    settings : mapping
        Other options that decided the numbers.
    """

    schema: ClassVar[str] = "identifiability/pruning/1"

    information: Information
    start: Rung
    selected: int
    least: int
    refused: tuple[Refusal, ...]
    stability: Stability
    absorption: Absorption
    criterion: Criterion
    method: str
    seed: int
    source: LadderSource
    settings: Mapping[str, object]

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
        raw = "" if self.nothing else state_raw(self.held_out)
        return " ".join(filter(None, (_state_answer(self), raw, *self.hints)))

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed, options, and hashes of the inputs."""
        options = {"method": self.method, "criterion": self.criterion, **self.settings}
        logs = (*self.samples, *self.validation)
        return state_provenance(self.robot, logs, self.seed, self.source, options)

    @cached_property
    def fit(self) -> Fit:
        """The rung to use: values, covariance, and how torque scatters about it."""
        both = (self.fitted, self.held_out)
        return keep_fit(
            self.structure,
            self.information,
            self.result,
            both,
            self.samples,
            self.settings,
            self.nothing,
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter of the rung to use."""
        return pd.DataFrame([v.to_row() for v in self.verdicts])

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a rung."""
        return pd.DataFrame([r.row() for r in self.rungs])

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the rung to use by joint and by log, as `Analysis.error_frame`."""
        return tell_errors(self.robot, self.samples, self.validation, self.fitted, self.held_out)

    def stability_frame(self) -> pd.DataFrame:
        """Return how often each parameter of the starting model survives."""
        kept = self.partition.survivors()
        return pd.DataFrame(
            {"name": self.stability.columns, "survives": self.stability.survives, "chosen": kept}
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "statement": self.statement,
            "hints": list(self.hints),
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "nothing": self.nothing or None,
            "models": [r.row() for r in self.rungs],
            "selected": self.chosen.name,
            "errors": errors_dict(self.error_frame()),
            "parameters": [v.to_row() for v in self.verdicts],
            "full_parameters": [v.to_row() for v in self.full.verdicts],
            "fit": None if self.nothing else self.fit.to_dict(),
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
                "sentence": self.result.physical.sentence,
                **physical_dict(self.robot, self.result, self.shapes),
            },
            "ladder": self.model_text,
            "effects": list(self.effects),
            "criterion": self.criterion,
            "method": self.method,
            "estimator": self.result.estimate.estimator.name,
            "seed": self.seed,
            "provenance": self.provenance,
        }

    @property
    def mass_statement(self) -> str:
        """What the nearest real robot and its bodies weigh beside the robot file's, in a line."""
        return state_masses(self.robot, self.result.physical.parameters())

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


def _state_answer(ladder: Ladder) -> str:
    chosen, full = ladder.chosen, ladder.full
    if ladder.nothing:
        return f"Nothing is identifiable, because {ladder.nothing}."
    if len(chosen) == len(full):
        text = (
            f"Nothing was pruned: each of the {len(full)} parameters of the model is needed to "
            "predict motion that the fit has not seen."
        )
    else:
        text = (
            f"Of {len(full)} parameters {len(chosen)} are worth using: "
            f"{listing(chosen.columns, 14)}. "
            f"{_identifiable(ladder)}. They predict unseen motion with an error of "
            f"{_percent(chosen.error_ra_unseen)}, the unpruned model with "
            f"{_percent(full.error_ra_unseen)}."
        )
    if np.isfinite(chosen.error_ra_validation):
        text += (
            f" On the logs held out for validation it is "
            f"{_percent(chosen.error_ra_validation)} against {_percent(full.error_ra_validation)}."
        )
    return f"{text} {state_physics(ladder.robot, ladder.result)}"


def _identifiable(ladder: Ladder) -> str:
    if ladder.result.unjudged:
        return f"None of them is judged. {ladder.result.unjudged.removesuffix('.')}"
    count = ladder.result.count(Class.IDENTIFIABLE)
    total = len(ladder.chosen)
    return "All are identifiable" if count == total else f"{count} of them are identifiable"


def _percent(error: float) -> str:
    return f"{100 * error:.3g} %" if np.isfinite(error) else "unknown size"
