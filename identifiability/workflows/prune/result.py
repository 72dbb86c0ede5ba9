"""`Ladder`: the models from the unpruned model down, which one to use, and why."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.groups import NO_ALTERNATIVES, Alternatives
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.answers import Answer, Cell, Column, Note, Table
from identifiability.foundation.errors import listing
from identifiability.foundation.numbers import percent
from identifiability.foundation.output import write_text
from identifiability.foundation.rounding import digits, error_text, format_number, percent_text
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import (
    LadderEntry,
    LadderSource,
    Submodel,
    ladder_text,
    model_entry,
)
from identifiability.workflows.analyze.assessment import JudgedModel, Laddered, ModelResult
from identifiability.workflows.analyze.result import (
    error_tables,
    found_cell,
    physics_notes,
    state_physics,
)
from identifiability.workflows.answers import (
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
    note,
    with_hints,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    name_export,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.prune.elimination import Refusal, Step

# The models of the ladder: models on the way down, with what is said of each.


#: What earlier releases said of each step, null in JSON until the next one.
GONE = (
    *("p_value", "either", "error_squares", "error_squares_se"),
    *("error_joints", "error_joints_validation", "error_joints_unseen"),
)


@frozen(kw_only=True)
class PrunedModel(JudgedModel):
    """One model on the way down, judged with the memory of the chosen model's residual.

    Without validation logs its error on these is NaN; errors are compared with the model to use.

    Attributes
    ----------
    step : Step
        The move that led here, and what the model predicts of folds.
    error_ra_unseen : float
        ε_RA on stretches (or logs) that the fits have not seen.
    density, density_se : float [nats]
        What the model was chosen by: predictive log density of these stretches, less that of the
        best model; and the standard error.
    weight : float
        Of the model in the mixture of all (`evidence.weigh_models`).
    """

    step: Step
    error_ra_unseen: float
    density: float
    density_se: float
    weight: float

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
        return max((v.sigma_robust_percent for v in self.verdicts), default=0.0)

    @property
    def columns(self) -> tuple[str, ...]:
        """Its parameters."""
        return self.submodel.columns

    @property
    def feasible(self) -> bool:
        """Whether no parameter has a sign that physics forbids."""
        return self.signs_possible

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
            "feasible": self.feasible,
            "move": move.text if move is not None else "",
            "kind": move.kind.value if move is not None else "",
            "reason": self.reason,
            **dict.fromkeys(GONE),
        }


@frozen(kw_only=True)
class Measured:
    """The models, and the one to use by itself.

    Attributes
    ----------
    models : tuple of PrunedModel
    result : ModelResult
        The model to use with verdicts, uncertainties by resampling, and physical certificate.
    fitted, held_out : Prediction
        Torque predicted by the model to use on the logs that were fitted, and on validation logs
        or, without any, on stretches (or logs) by models fitted to the others; sums only.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    missing : Alternatives
        Functions that are missing beside the unpruned model.
    """

    models: tuple[PrunedModel, ...]
    result: ModelResult
    fitted: Prediction
    held_out: Prediction
    nothing: str = ""
    missing: Alternatives = NO_ALTERNATIVES


@frozen(kw_only=True)
class Ladder(Laddered, Measured):
    """The answer of `prune`. `to_frame`, `to_json`, `write_report`, `write_model` give it away.

    Attributes
    ----------
    start : Submodel
        The model that pruning started from.
    selected, least : int
        The model to use, and the one with the least held-out error.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    source : LadderSource
        Where the model that pruning started from came from.
    """

    schema: ClassVar[str] = "identifiability/pruning/1"

    models: tuple[PrunedModel, ...]
    start: Submodel
    least: int
    refused: tuple[Refusal, ...]
    source: LadderSource

    @property
    def _used(self) -> ModelResult:
        """The model to use, with all that was asked of it."""
        return self.result

    @property
    def chosen(self) -> PrunedModel:
        """The model to use."""
        return self.models[self.selected]

    @property
    def full(self) -> PrunedModel:
        """The unpruned model."""
        return self.models[0]

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the parameters of the model to use."""
        return self.result.verdicts

    @property
    def feasible(self) -> bool:
        """Whether a real robot can have the values of the model to use."""
        return self.result.feasible

    def answers(self) -> tuple[Answer, ...]:
        """Return what to use, how good it is, whether to trust it, what to do next."""
        found, doubt = self.result.count(Class.IDENTIFIABLE), self._doubt or self.result.unjudged
        return (
            after_mass(_answer_use(self), self.mass_warning),
            _answer_quality(self),
            answer_trust(self.cautions(), doubt, found, len(self.chosen), self.missing.statement),
            answer_next(_next_commands(self)),
        )

    def cautions(self) -> tuple[Note, ...]:
        """Return what is to be kept in mind."""
        return tuple(_notes(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (Thresholds(), ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return the models of the path, and the errors of the one to use by joint and by log."""
        path = Table.of("", MOVES, self.models, marked=self.selected)
        return (path, *error_tables(self))

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        use, quality = _answer_use(self), _answer_quality(self)
        told = f"{use.short} {use.text} {quality.short} {quality.text}"
        return self._state(self._doubt or told)

    @property
    def _doubt(self) -> str:
        """Why nothing is believed, in one sentence; empty where it is."""
        return f"Nothing is identifiable, because {self.nothing}." if self.nothing else ""

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter of the model to use."""
        return pd.DataFrame([v.to_row() for v in self.verdicts])

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        told = super().to_dict()
        return told | {
            "refused": [
                {"move": r.move.text, "why": r.move.why, "reason": r.reason} for r in self.refused
            ],
            "stability": None,  # gone with the next release
            "absorption": [],  # gone with the next release
            "physical": {"sentence": self.result.physical.sentence, **told["physical"]},
            "ladder": self.model_text,
            "effects": list(self.effects),
            "criterion": "identifiable",  # there were others
            "seed": self.seed,
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
        return LadderEntry(models=[model_entry(self.chosen.submodel, self.base, self.effects)])


def _answer_use(ladder: Ladder) -> Answer:
    """Return which model is worth using."""
    question, size = "Which model is worth using?", len(ladder.full)
    if ladder.nothing:
        short = f"None: 0 of {size} parameters are worth using."
        return Answer(question, short, f"Because {ladder.nothing}.", "vermilion")
    wrong, chosen = ladder.result.infeasible, ladder.chosen
    used = [c for c in chosen.columns if c not in wrong]
    found = ladder.result.count(Class.IDENTIFIABLE)
    short = f"Of {size} parameters {len(used)} are worth using, {found} of them identifiable."
    text = f"{listing(used, 14)}{f' (not {listing(wrong, 4)}: impossible sign)' if wrong else ''}."
    if len(chosen) == size:
        text = "Nothing was pruned: each is needed to predict motion that the fit has not seen."
    if ladder.missing.functions:
        text += f" That holds only if nothing is missing: {ladder.missing.statement}: diagnose."
    tone = "green" if ladder.feasible else "amber"
    return Answer(question, short, f"{text} {state_physics(ladder.result)}", tone)


def _answer_quality(ladder: Ladder) -> Answer:
    """Return how well it predicts, beside the unpruned model."""
    outside = np.isfinite(ladder.chosen.error_ra_validation)
    kind = "the validation logs" if outside else "stretches that the fits had not seen"
    error, before = (
        model.error_ra_validation if outside else model.error_ra_unseen
        for model in (ladder.chosen, ladder.full)
    )
    each = ladder.held_out.joint_error()[:, 0]
    kind = f"{kind} ({error_text(before)} unpruned)"
    return answer_quality(error, ladder.robot.joints, each, kind)


def _next_commands(ladder: Ladder) -> list[tuple[str, str]]:
    robot, how = source_name(ladder.robot), ladder.settings.get("preparation")
    logs = name_logs(ladder.robot, given_paths(ladder.samples), how=how)
    held = held_back(ladder.validation)
    if ladder.nothing:
        return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
    again = f"identifiability prune {robot} {logs}{held}"
    another = name_logs(ladder.robot, given_paths(ladder.validation or ladder.samples))
    text, name = name_export(ladder.robot, *ladder.exported)
    export = f"identifiability export {robot} {{file}} --out {name}"
    predict = f"identifiability predict {robot} {{file}} {another} --out torque.csv"
    diagnose = (
        f"identifiability diagnose {robot} {logs}{held} --model {{file}} --report missing.html"
    )
    model = on_file(ladder, "model", "pruned.toml", f"{again} --out", diagnose)
    commands = [
        (text, on_file(ladder, "json", "prune.json", f"{again} --json", export)),
        (
            "Predict torque, of this log or another:",
            on_file(ladder, "json", "prune.json", f"{again} --json", predict),
        ),
        ("Find out what even this model misses:", model),
    ]
    return [*commands[-1:], *commands[:-1]] if ladder.missing.functions else commands


def _notes(ladder: Ladder) -> Iterator[Note]:
    if ladder.mass_warning:
        yield note("mass", warning=ladder.mass_warning)
    if not ladder.nothing:
        yield from physics_notes(ladder.result)
    kind = "stable" if ladder.chosen.weight > 0.5 else "unstable"
    yield note(kind, weight=percent(ladder.chosen.weight, 2))
    yield from (note("hint", hint=hint) for hint in ladder.hints)


def _move_cell(r: PrunedModel) -> Cell:
    move = r.step.move
    return Cell(f"{move.kind.value}: {move.text}" if move is not None else r.name, note=r.reason)


def _worst_cell(r: PrunedModel) -> Cell:
    condition = f"condition {format_number(r.estimate.condition, 3)}"
    return Cell(percent_text(r.worst_sigma_percent), r.worst_sigma_percent, condition)


def _signs_cell(r: PrunedModel) -> Cell:
    wrong = ", ".join(r.infeasible[:4]) + (" …" if len(r.infeasible) > 4 else "")
    text, word = ("possible", "pass") if r.feasible else ("impossible", "differs")
    return Cell(text, None, wrong, word)


MOVES = with_hints(
    "moves",
    Column("move", "text", _move_cell),
    Column("size", "number", len),
    Column("identifiable", "number", found_cell),
    Column("fitted", error_text, "error_ra"),
    Column("unseen", error_text, "error_ra_unseen"),
    Column("density [nats]", digits(3), "density"),
    Column("weight", digits(2), "weight", detail=True),
    Column("worst σ%", "number", _worst_cell),
    Column("signs", "badge", _signs_cell),
)
