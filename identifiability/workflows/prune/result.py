"""`Ladder`: the rungs from the unpruned model down, which one to use, and why."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd

from identifiability.foundation.output import write_text
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import (
    LadderEntry,
    ladder_text,
    rung_entry,
)
from identifiability.workflows.analyze.assessment import physical_dict
from identifiability.workflows.analyze.errors import errors_dict, tell_errors
from identifiability.workflows.provenance import state_provenance
from identifiability.workflows.prune.pruning import Pruning
from identifiability.workflows.prune.words import statement


@frozen
class Ladder(Result, Pruning):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away."""

    schema: ClassVar[str] = "identifiability/pruning/1"

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

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the rung to use by joint and by log, as `Analysis.error_frame`."""
        return tell_errors(
            self.robot.joints, self.samples, self.validation, self.fitted, self.held_out
        )

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
            "schema": self.schema,
            "robot": {"name": self.robot.name, "title": self.robot.title},
            "samples": self.information.samples,
            "statement": self.statement,
            "hints": list(self.hints),
            "nothing": self.nothing or None,
            "models": [r.row() for r in self.rungs],
            "selected": self.chosen.name,
            "errors": errors_dict(self.error_frame()),
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
