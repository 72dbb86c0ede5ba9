"""`Ladder`: the models from the unpruned model down, which one to use, and why."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import Class, percent_of
from identifiability.foundation.answers import Answer, Cell, Column, Note, Table
from identifiability.foundation.errors import listing
from identifiability.foundation.output import write_text
from identifiability.foundation.rounding import (
    digits,
    error_text,
    format_number,
    percent,
    percent_text,
)
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import (
    LadderEntry,
    LadderSource,
    Submodel,
    ladder_text,
    model_entry,
)
from identifiability.workflows.analyze.result import (
    Laddered,
    ModelResult,
    error_tables,
    found_cell,
    possible_cell,
)
from identifiability.workflows.answers import note, with_hints
from identifiability.workflows.prune.elimination import Refusal, Step

# The models of the ladder: models on the way down, with what is said of each.


@frozen(kw_only=True)
class PrunedModel(ModelResult):
    """One model on the way down, judged with the memory of the chosen model's residual.

    Only the model to use has a real robot beside it.

    Attributes
    ----------
    step : Step
        The move that led here, and what the model predicts of folds.
    crossed : Prediction
        On stretches (or logs) that the fits have not seen; `unseen` is of validation logs, if there
        are any.
    spread : float
        Relative standard error of the difference of its error on folds to the best model's.
    density, density_se : float [nats]
        What the model was chosen by: predictive log density of these stretches, less that of the
        best model; and the standard error.
    weight : float
        Of the model in the mixture of all (`elimination.weigh_models`).
    """

    step: Step
    crossed: Prediction
    spread: float
    density: float
    density_se: float
    weight: float

    @property
    def error_ra_unseen(self) -> float:
        """ε_RA on stretches (or logs) that the fits have not seen."""
        return float(self.crossed.relative_error()[int(self.physical_used)])

    @property
    def error_se(self) -> float:
        """Standard error of the difference of its unseen ε_RA to the best model's."""
        return self.spread * self.error_ra_unseen

    @property
    def reason(self) -> str:
        """Why the move was made, in words."""
        if self.step.move is None:
            return "Every base parameter of the model."
        return f"{self.step.move.why or 'The least costly of what is left'}."

    @property
    def worst_sigma_percent(self) -> float:
        """Largest σ_robust% of its parameters [%]."""
        return max((percent_of(v.sigma_robust, v.value) for v in self.verdicts), default=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Its parameters."""
        return self.submodel.columns

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.submodel)

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        move = self.step.move
        return super().row() | {
            "error_ra_unseen": self.error_ra_unseen,
            "error_ra_unseen_se": self.error_se,
            "density": self.density,
            "density_se": self.density_se,
            "weight": self.weight,
            "worst_sigma_robust_percent": self.worst_sigma_percent,
            "move": move.text if move is not None else "",
            "kind": move.kind.value if move is not None else "",
            "reason": self.reason,
        }


@frozen(kw_only=True)
class Ladder(Laddered[PrunedModel]):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away.

    Attributes
    ----------
    start : Submodel
        The model that pruning started from.
    least : int
        The model with the least held-out error.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    source : LadderSource
        Where the model that pruning started from came from.
    """

    schema: ClassVar[str] = "identifiability/pruning/1"

    start: Submodel
    least: int
    refused: tuple[Refusal, ...]
    source: LadderSource

    @property
    def validation_kind(self) -> str:
        """What the error on unseen motion was measured on, and that of the unpruned model."""
        return f"{super().validation_kind} ({error_text(self.full.error_ra_validation)} unpruned)"

    def tables(self) -> tuple[Table, ...]:
        """Return the models of the path, and the errors of the one to use by joint and by log."""
        path = Table.of(
            "",
            MOVES,
            self.models,
            marked=self.selected,
        )
        return (path, *error_tables(self))

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        return super().to_dict() | {
            "refused": [
                {"move": r.move.text, "why": r.move.why, "reason": r.reason} for r in self.refused
            ],
            "ladder": self.model_text,
            "effects": list(self.effects),
            "seed": self.settings["seed"],
        }

    def write_model(self, path: str | Path) -> Path:
        """Write the chosen model as a model file (a ladder of one model), for every other verb."""
        return self.note_written("model", write_text(path, self.model_text))

    @property
    def model_text(self) -> str:
        """The chosen model as the text of a model file."""
        title = self.robot.title or self.robot.name
        return ladder_text(self.to_ladder(), f"{title}: the model that pruning chose.")

    def to_ladder(self) -> LadderEntry:
        """Return the chosen model as a ladder of one, for `analyze`, `diagnose` and others."""
        return LadderEntry(models=[model_entry(self.chosen.submodel, self.structure)])

    def _answer_use(self) -> Answer:
        """Return which model is worth using."""
        question, size = "Which model is worth using?", len(self.full)
        if self.nothing:
            short = f"None: 0 of {size} parameters are worth using."
            return Answer(
                question,
                short,
                f"Because {self.nothing}.",
                "vermilion",
            )
        chosen = self.chosen
        wrong, found = chosen.infeasible, chosen.count(Class.IDENTIFIABLE)
        used = [c for c in chosen.columns if c not in wrong]
        short = f"Of {size} parameters {len(used)} are worth using, {found} of them identifiable."
        text = (
            f"{listing(used, 6)}{f' (not {listing(wrong, 4)}: impossible sign)' if wrong else ''}."
        )
        if len(chosen) == size:
            text = "Nothing was pruned: each is needed to predict motion that the fit has not seen."
        text = " ".join(filter(None, (text, self._physics)))
        return Answer(
            question,
            short,
            text,
            "green" if chosen.feasible else "amber",
        )

    def _notes(self) -> Iterator[Note]:
        yield from super()._notes()
        kind = "stable" if self.chosen.weight > 0.5 else "unstable"
        yield note(kind, weight=percent(self.chosen.weight, 2))


def _move_cell(r: PrunedModel) -> Cell:
    move = r.step.move
    return Cell(f"{move.kind.value}: {move.text}" if move is not None else r.name, note=r.reason)


def _worst_cell(r: PrunedModel) -> Cell:
    condition = f"condition {format_number(r.estimate.condition, 3)}"
    return Cell(percent_text(r.worst_sigma_percent), r.worst_sigma_percent, condition)


MOVES = with_hints(
    "moves",
    Column("move", "text", _move_cell),
    Column("size", "number", len),
    Column("identifiable", "number", found_cell),
    Column("fitted", error_text, "error_ra"),
    Column("unseen", error_text, "error_ra_unseen"),
    Column("density [nats]", digits(3), "density"),
    Column(
        "weight",
        digits(2),
        "weight",
        detail=True,
    ),
    Column("worst σ%", "number", _worst_cell),
    Column("real robot", "badge", possible_cell),
)
