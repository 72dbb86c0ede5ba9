"""`Ladder`: the rungs from the unpruned model down, which one to use, and why."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.errors import listing
from identifiability.foundation.numbers import percent
from identifiability.foundation.output import write_text
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import (
    LadderEntry,
    LadderSource,
    Rung,
    ladder_text,
    rung_entry,
)
from identifiability.workflows.analyze.assessment import Laddered, RungResult
from identifiability.workflows.analyze.words import state_physics
from identifiability.workflows.prune.elimination import Criterion, Refusal
from identifiability.workflows.prune.moves import Partition
from identifiability.workflows.prune.rung import Absorption, Measured, PrunedRung, Stability


@frozen(kw_only=True)
class Ladder(Laddered, Measured):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away.

    Attributes
    ----------
    start : Rung
        The model that pruning started from.
    selected, least : int
        The rung to use, and the one with the least held-out error.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    stability : Stability
    absorption : Absorption
    criterion
        As asked for.
    source : LadderSource
        Where the model that pruning started from came from.
    """

    schema: ClassVar[str] = "identifiability/pruning/1"

    start: Rung
    least: int
    refused: tuple[Refusal, ...]
    stability: Stability
    absorption: Absorption
    criterion: Criterion
    source: LadderSource

    @property
    def _ladder(self) -> tuple[PrunedRung, ...]:
        """Every rung, the unpruned model first."""
        return self.rungs

    @property
    def _used(self) -> RungResult:
        """The rung to use, with all that was asked of it."""
        return self.result

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
        return self._state(_state_answer(self))

    @property
    def _asked(self) -> dict[str, object]:
        """Options beside `settings`."""
        return {**super()._asked, "criterion": self.criterion}

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter of the rung to use."""
        return pd.DataFrame([v.to_row() for v in self.verdicts])

    def stability_frame(self) -> pd.DataFrame:
        """Return how often each parameter of the starting model survives."""
        kept = self.partition.survivors()
        return pd.DataFrame(
            {"name": self.stability.columns, "survives": self.stability.survives, "chosen": kept}
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        told, stability = super().to_dict(), self.stability
        survives = zip(stability.columns, stability.survives.tolist(), strict=True)
        return told | {
            "refused": [
                {"move": r.move.text, "why": r.move.why, "reason": r.reason} for r in self.refused
            ],
            "stability": {
                "replicates": stability.replicates,
                "same": stability.same,
                "survives": dict(survives),
                "models": [{"columns": m, "share": s} for m, s in stability.models],
            },
            "absorption": self.absorption.to_frame().to_dict("records"),
            "physical": {"sentence": self.result.physical.sentence, **told["physical"]},
            "ladder": self.model_text,
            "effects": list(self.effects),
            "criterion": self.criterion,
            "seed": self.seed,
        }

    def write_model(self, path: str | Path) -> Path:
        """Write the chosen model as a model file (a ladder of one rung), for every other verb."""
        return self.note_written("model", write_text(path, self.model_text))

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
        wrong = ladder.result.infeasible
        used = [c for c in chosen.columns if c not in wrong]
        beside = f" (not so {listing(wrong, 4)}: physics forbids the sign)" if wrong else ""
        text = (
            f"Of {len(full)} parameters {len(used)} are worth using: "
            f"{listing(used, 14)}{beside}. "
            f"{_identifiable(ladder)}. They predict unseen motion with an error of "
            f"{percent(chosen.error_ra_unseen)}, the unpruned model with "
            f"{percent(full.error_ra_unseen)}."
        )
    if np.isfinite(chosen.error_ra_validation):
        text += (
            f" On the logs held out for validation it is "
            f"{percent(chosen.error_ra_validation)} against {percent(full.error_ra_validation)}."
        )
    if ladder.missing.functions:
        text += f" That holds only if nothing is missing: {ladder.missing.statement}: diagnose."
    return f"{text} {state_physics(ladder.result)}"


def _identifiable(ladder: Ladder) -> str:
    if ladder.result.unjudged:
        return f"None of them is judged. {ladder.result.unjudged.removesuffix('.')}"
    count = ladder.result.count(Class.IDENTIFIABLE)
    total = len(ladder.chosen)
    return "All are identifiable" if count == total else f"{count} of them are identifiable"
