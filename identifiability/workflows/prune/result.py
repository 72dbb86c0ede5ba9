"""`Ladder`: the models from the unpruned model down, which one to use, and why."""

from pathlib import Path

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import percent_of
from identifiability.foundation.findings import phrase
from identifiability.foundation.output import write_text
from identifiability.foundation.values import Json, frozen
from identifiability.regression.reduction import (
    LadderEntry,
    LadderSource,
    Submodel,
    ladder_text,
    model_entry,
)
from identifiability.workflows.analyze.result import Laddered, ModelResult

from .elimination import Refusal, Step

# The models of the reduction path.


@frozen(kw_only=True)
class PrunedModel(ModelResult):
    """One model of the path, judged with the autocorrelation of the chosen model's residual.

    Only the model to use has a physically consistent robot.

    Attributes
    ----------
    step : Step
        The move that led here, and the predictions of folds by the model.
    crossed : Prediction
        On stretches (or logs) that the fits have not seen; `unseen` is of validation logs, if there
        are any.
    spread : float
        Relative standard error of the difference of its error on folds to the best model's.
    density, density_se : float [nats]
        The criterion of the choice: predictive log density of these stretches, less that of the
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
        """ε_RA of the estimates on stretches (or logs) that the fits have not seen."""
        return float(self.crossed.relative_error()[0])

    @property
    def error_se(self) -> float:
        """Standard error of the difference of its unseen ε_RA to the best model's."""
        return self.spread * self.error_ra_unseen

    @property
    def reason(self) -> str:
        """Why the move was made, in words."""
        move = self.step.move
        if move is None:
            return phrase("pruned", "start")
        if move.why:
            return f"{move.why}."
        return phrase("pruned", "cheapest")

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

    def row(self) -> Json:
        """Return the model as one row of the ladder."""
        move = self.step.move
        text = move.text if move is not None else ""
        kind = move.kind.value if move is not None else ""
        return super().row() | {
            "error_ra_unseen": self.error_ra_unseen,
            "error_ra_unseen_se": self.error_se,
            "density": self.density,
            "density_se": self.density_se,
            "weight": self.weight,
            "worst_sigma_robust_percent": self.worst_sigma_percent,
            "move": text,
            "kind": kind,
            "reason": self.reason,
        }


@frozen(kw_only=True)
class Ladder(Laddered[PrunedModel]):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report` and `write_model` export it.

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

    schema = "identifiability/pruning/1"

    start: Submodel
    least: int
    refused: tuple[Refusal, ...]
    source: LadderSource

    def to_dict(self) -> Json:
        """Return the result as plain values."""
        refused = [
            {"move": r.move.text, "why": r.move.why, "reason": r.reason} for r in self.refused
        ]
        return super().to_dict() | {
            "refused": refused,
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
