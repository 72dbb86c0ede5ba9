"""`Analysis`: which parameters do the logs determine? In words, tables, JSON and next lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np
import pandas as pd

from identifiability.effects.imu import move_mounting
from identifiability.estimation.evidence import Folds
from identifiability.estimation.fit import Motions
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.torque_errors import loaded_joints
from identifiability.estimation.verdict import Class, Verdict, percent_of
from identifiability.foundation.answers import Answer, Cell, Column, Note, Table
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import check_choice
from identifiability.foundation.rounding import (
    NONE,
    digits,
    error_text,
    format_count,
    format_number,
    join,
    percent,
    percent_text,
    stated_text,
    time_text,
)
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare.dataset import Dataset
from identifiability.posterior.rules import RULES as POSTERIOR_RULES
from identifiability.posterior.rules import Thresholds as Believable
from identifiability.robot import Robot
from identifiability.workflows.analyze.assessment import JudgedModel, Laddered, ModelResult
from identifiability.workflows.analyze.belief import Belief, Which, belief_dict, build_datatree
from identifiability.workflows.answers import (
    SIGMA,
    UNIT,
    VALUE,
    VERDICT,
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
    bias_columns,
    grade_of,
    note,
    with_hints,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    ladder_option,
    name_export,
    name_logs,
    on_file,
    source_name,
)

if TYPE_CHECKING:
    from xarray import DataTree


# What logs say of each other, in words.


#: Parameters that a sentence names.
NAMED = 3

ONE = "One motion cannot show what another would change: no interval holds that."
SHORT = (
    "The logs are too short to be fitted one by one: no interval holds what another motion would "
    "change."
)


@frozen
class SeveralLogs:
    """Whether motions lead to the same values, in numbers and words.

    Attributes
    ----------
    motions : Motions or None
        None where there are not two that can be fitted by themselves.
    names : tuple of str
        Of its logs.
    columns : tuple of str
        The k parameters.
    statement : str
    """

    motions: Motions | None
    names: tuple[str, ...]
    columns: tuple[str, ...]
    statement: str

    @property
    def hint(self) -> str:
        """What to do where they disagree; empty where they agree."""
        return "" if self.motions is None or not self.motions.moved.any() else self.statement

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        m = self.motions
        found: dict[str, Any] = {"statement": self.statement, "names": list(self.names)}
        if m is None:
            return found
        most = int(np.argmax(m.ratio))
        found |= {"p": float(m.p.min()), "variance_ratio": float(m.ratio[most])}
        found["degrees_of_freedom"] = float(m.dof[most])
        rows = zip(self.columns, m.values.T, m.sd.T, m.p, m.between, strict=True)
        keys = ("name", "values", "sd", "p", "between")
        found["parameters"] = [
            dict(zip(keys, (name, v.tolist(), s.tolist(), float(p), float(b)), strict=True))
            for name, v, s, p, b in rows
        ]
        return found


def compare_logs(samples: Sequence[Dataset], result: ModelResult) -> SeveralLogs:
    """Return what logs say of each other under a model.

    Parameters
    ----------
    samples : sequence of Dataset
        The fitted logs.
    result : ModelResult
    """
    columns, motions = result.submodel.columns, result.fit.motions
    if motions is None:
        return SeveralLogs(None, (), columns, ONE if len(samples) == 1 else SHORT)
    names = tuple(samples[k].name for k in motions.which)
    if not motions.moved.any():
        text = f"The {len(names)} logs agree: no value differs by more than chance."
        return SeveralLogs(motions, names, columns, text)
    order = [k for k in np.argsort(motions.p) if motions.moved[k]]
    far = listing([f"{columns[k]} ({_range(motions.values[:, k])})" for k in order], NAMED)
    text = (
        f"The logs {listing(names, NAMED)} disagree: {far}. A payload, a temperature or another "
        "robot does that, or the model leaves out what differs between them; intervals are widened "
        "to hold all of them. What changed, and in which log: compare."
    )
    return SeveralLogs(motions, names, columns, text)


def _range(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


# The answer of an analysis in plain words.


#: Why no verdict is believed where a model would be used that is no better than no model.
WORSE = "no model predicts motion that it has not seen better than a constant torque would"


def state_physics(chosen: ModelResult) -> str:
    """Return what physics says of a model."""
    if chosen.feasible:
        return "A real robot can have its values."
    if chosen.physical.nearest is None:
        return chosen.physical.sentence
    if math.isnan(chosen.error_ra_physical):  # folds of few samples
        return "It is no real robot; these logs are too short to say how much the nearest one errs."
    near = f"The nearest real robot errs by {percent(chosen.error_ra_physical)}."
    if chosen.physical_used:
        less = chosen.error_ra_physical < chosen.error_ra_validation
        near = (
            f"The nearest real robot errs by {percent(chosen.error_ra_physical)}, "
            f"{'less' if less else 'not surely more'}. Its values are those to use, and "
            "predictions and exports have them."
        )
    if count := len(chosen.infeasible):
        return (
            f"But {count} of its values {'has' if count == 1 else 'have'} a sign that physics "
            f"forbids ({listing(chosen.infeasible, 4)}). {near}"
        )
    if chosen.physical.certificate is None:
        return f"The motion leaves some of its parameters open. {near}"
    return f"Its values are not physically consistent, although each sign is possible. {near}"


def state_weak(chosen: ModelResult) -> str:
    """Return one sentence on values without a strong instrument, or nothing."""
    estimate = chosen.estimate
    if estimate.correction is None:
        return ""
    bias = estimate.correction.bias
    # What has this share of its variance from these directions leans on them.
    leans = (bias**2).sum(0) > 0.1 * estimate.sigma**2
    known = {v.name for v in chosen.verdicts if v.verdict is Class.IDENTIFIABLE}
    touched = [c for c, found in zip(estimate.columns, leans, strict=True) if found and c in known]
    if not touched:
        return ""
    return (
        f"In {len(bias)} of {len(estimate.kept)} directions noise drowns the motion, and least "
        "squares stays, with the bias that this gives it (σ holds it); "
        f"{listing(touched, 4)} lean on them: move faster or longer, or measure the motion better."
    )


def state_mounting(robot: Robot, verdicts: Sequence[Verdict]) -> str:
    """Return what to write into the sidecar of an inertial sensor that sits elsewhere, or nothing.

    Corrections are linear where they are small: what is left of a large one is found from there.
    """
    sure = {v.name: v.value for v in verdicts if v.verdict in (Class.IDENTIFIABLE, Class.WEAK)}
    entry = move_mounting(robot, sure)
    if not entry:
        return ""
    return (
        "The inertial sensor is mounted otherwise than stated; as corrections are exact only while "
        f"they are small, fit large ones once more with this at the top of the sidecar: {entry}"
    )


def doubt(
    why: str, results: tuple[ModelResult, ...], at: int, held_out: Prediction
) -> tuple[tuple[ModelResult, ...], str]:
    """Take the verdicts back where none can be believed; return them, and why not.

    Parameters
    ----------
    why : str
        What speaks against all of them: the fitted logs have nothing to explain, or are misread;
        empty if nothing does.
    results : tuple of ModelResult
    at : int
        The selected model.
    held_out : Prediction
    """
    if not why and not results[at].error_ra_validation < held_out.constant_error():
        why = WORSE
    return (tuple(r.withdraw(why) for r in results) if why else results), why


# `Analysis`: the answer to which parameters the logs determine; a table, JSON or a report.


@frozen(kw_only=True)
class Analysis(Laddered):
    """The answer. `to_frame`, `to_json` and `write_report` give it away.

    Attributes
    ----------
    models : tuple of ModelResult
        The ladder, unpruned model first.
    selected : int
        The model to use: the smallest that may stand for the best on folds of the fitted logs and
        that held-out logs do not object to, physically feasible ones first.
    fitted, held_out : Prediction
        As of every model.
    belief : Belief or None
        Posteriors of the selected model, where they were asked for.
    thresholds
        As asked for.
    recordings : tuple of Log
        What the fitted logs were prepared from.
    several : SeveralLogs or None
        Whether the logs, or stretches of one, lead to the same values of the selected model.
    folds : Folds or None
        What is predicted from the rest of the fitted logs; None where nothing was fitted.
    """

    schema: ClassVar[str] = "identifiability/analysis/1"

    models: tuple[ModelResult, ...]
    belief: Belief | None = None
    thresholds: Thresholds = field(default_factory=Thresholds)
    settings: Mapping[str, object] = field(default_factory=dict)
    recordings: tuple[Log, ...] = ()
    several: SeveralLogs | None = None
    folds: Folds | None = None

    @property
    def chosen(self) -> ModelResult:
        """The selected model."""
        return self.models[self.selected]

    @property
    def _used(self) -> ModelResult:
        """The selected model."""
        return self.chosen

    @property
    def _alone(self) -> tuple[Prediction, Prediction]:
        """By the selected model alone: on what was fitted, and on what was held out."""
        return self.fitted.select([self.selected]), self.held_out.select([self.selected])

    @property
    def first(self) -> str:
        """The first model of the ladder as it was given: of a model file its only one."""
        return self.full.name if self.source is None else self.source.entry.models[0].name

    @property
    def full(self) -> ModelResult:
        """The unpruned model."""
        return self.models[0]

    def to_frame(self, model: str | None = None) -> pd.DataFrame:
        """Return one row a parameter of the selected model, or of the named one.

        Raises
        ------
        OptionError
            If the ladder has no such model.
        """
        result = self.chosen if model is None else self.models[self.find_model(model)]
        return pd.DataFrame([v.to_row() for v in result.verdicts])

    def find_model(self, name: str) -> int:
        """Return the place of a model in the ladder.

        Raises
        ------
        OptionError
        """
        names = tuple(m.name for m in self.models)
        check_choice("model", name, names)
        return names.index(name)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        told, base = super().to_dict(), self.base
        certificate = {"certificate": self.chosen.physical.sentence}
        return told | {
            "validation": self.validation_kind,
            "physical": certificate | told["physical"],
            "posterior": None if self.belief is None else belief_dict(self.chosen, self.belief),
            "structure": {
                "parameters": len(base.parameters),
                "rank": base.rank,
                "gap": list(base.gap),
                "effects": list(self.effects),
                "groupings": dict(zip(base.names, base.labels, strict=True)),
                "without_effect": list(base.without_effect),
            },
            "several_logs": None if self.several is None else self.several.to_dict(),
        }

    def to_arviz(self, posterior: Which = "physical") -> DataTree:
        """Return a posterior of the selected model for ArviZ; needs the extra ``arviz``.

        Parameters
        ----------
        posterior : {"physical", "signs"}
            Restricted to bodies that can exist, or by signs only.

        Raises
        ------
        ModelError
            If there is no such posterior, or no package to hold it.
        """
        check_choice("posterior", posterior, get_args(Which))
        return build_datatree(self.belief, self.chosen, posterior, self.provenance)

    @property
    def validation_kind(self) -> str:
        """What the held-out error was measured on."""
        if not np.isfinite(self.chosen.error_ra_validation):
            return "nothing, for there is no error"
        if self.validation:
            return "held-out logs: " + ", ".join(s.name for s in self.validation)
        logs = len(self.samples)
        if logs > 1 and self.folds is not None and self.folds.count == logs:
            return "cross-validation, one log left out at a time"
        return f"cross-validation over stretches of the {'log' if logs == 1 else 'logs'}"

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        use, quality = _answer_use(self), self.answers()[1]
        told = f"{use.short} {use.text} {quality.short} Measured on {self.validation_kind}."
        doubt = f"Nothing is identifiable, because {self.nothing}." if self.nothing else ""
        return self._state(doubt or told)

    def answers(self) -> tuple[Answer, ...]:
        """Return what to use, how good it is, whether to trust it, what to do next."""
        return _answers(self)

    def cautions(self) -> tuple[Note, ...]:
        """Return what is to be kept in mind, gravest first."""
        return _cautions(self)

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        believed = () if self.belief is None else (Believable(), POSTERIOR_RULES)
        return (self.thresholds, ESTIMATION_RULES, *believed)

    def tables(self) -> tuple[Table, ...]:
        """Return the models, the errors by joint and by log, the parameters of the model to use."""
        models = Table.of("", LADDER, self.models, marked=self.selected)
        return (models, *error_tables(self), parameter_table(self, self.chosen))

    @property
    def physical_statement(self) -> str:
        """What physics says of the selected model, in words."""
        return state_physics(self.chosen)


# What is answered first: what the logs determine, how good that is, whether to trust it.


def _answers(analysis: Analysis) -> tuple[Answer, ...]:
    chosen, found = analysis.chosen, analysis.chosen.count(Class.IDENTIFIABLE)
    doubt = f"Nothing is identifiable, because {analysis.nothing}." if analysis.nothing else ""
    each = analysis.held_out.joint_error()[:, analysis.selected]
    joints, kind = analysis.robot.joints, analysis.validation_kind
    return (
        after_mass(_answer_use(analysis), analysis.mass_warning),
        answer_quality(chosen.error_ra_validation, joints, each, kind),
        answer_trust(
            analysis.cautions(),
            doubt or chosen.unjudged,
            found,
            len(chosen.submodel),
            analysis.missing.statement,
        ),
        answer_next(next_commands(analysis)),
    )


# What to do next after an analysis, as lines for the terminal.


def next_commands(analysis: Analysis) -> list[tuple[str, str]]:
    """Return at most three lines for the terminal, the most useful first."""
    robot, how = source_name(analysis.robot), analysis.settings.get("preparation")
    names = given_paths(analysis.samples)
    logs = name_logs(analysis.robot, names, how=how)
    held = held_back(analysis.validation)
    if analysis.nothing:
        return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
    chosen, out = analysis.chosen, []
    suspect = analysis.missing.functions or chosen.contradicted
    if suspect or grade_of(chosen.error_ra_validation) != "very-good":
        page = "--report missing.html"
        text = "Find out what the model misses:"
        out.append((text, f"identifiability diagnose {robot} {logs}{held} {page}"))
    if chosen.count(Class.IDENTIFIABLE) < len(chosen.submodel):
        text = "Drop what noise decides, and keep a model that a real robot can have:"
        more = f"{ladder_option(analysis.robot, analysis.source)} --report pruned.html"
        out.append((text, f"identifiability prune {robot} {logs}{held}{more} --json prune.json"))
        text = "Or measure what these logs leave open:"
        begun = name_logs(analysis.robot, names, "--start-from", how)
        out.append((text, f"identifiability excite {robot} {begun} --out next.json"))
    again = f"identifiability analyze {robot} {logs}{held}"
    again += f"{ladder_option(analysis.robot, analysis.source)} --json"
    text, name = name_export(analysis.robot, *analysis.exported)
    use = f"identifiability export {robot} {{file}} --out {name}"
    line = on_file(analysis, "json", "analyze.json", again, use)
    out.append((text, line))
    return out[:3]


def model_title(result: ModelResult) -> str:
    """Return the name of a model as it stands in a sentence."""
    return result.name if "model" in result.name.lower() else f"“{result.name}”"


def found_cell(model: JudgedModel) -> Cell:
    """Return how many parameters of a model are identifiable."""
    found = sum(v.verdict is Class.IDENTIFIABLE for v in model.verdicts)
    return Cell("not judged" if model.unjudged else str(found), found)


def _answer_use(analysis: Analysis) -> Answer:
    chosen, base, full = analysis.chosen, analysis.base, analysis.full
    question = "What do the logs determine, and which model to use?"
    size = f"Of {len(base.parameters)} parameters {base.rank} can be told apart by any motion."
    if analysis.nothing:
        return Answer(question, "Nothing, and none.", size, "vermilion")
    found = f"{chosen.count(Class.IDENTIFIABLE)} of {len(chosen.submodel)} parameters identifiable"
    title = model_title(chosen)
    title = f"{title[0].upper()}{title[1:]}"
    short = f"{title}: {found}."
    if chosen.unjudged:
        short = f"Nothing is judged in {model_title(chosen)} of {len(chosen.submodel)} parameters."
    if chosen is not full:
        size += f" The unpruned {model_title(full)} keeps all {len(full.submodel)} of them"
        size += "." if full.unjudged else f", {full.count(Class.IDENTIFIABLE)} identifiable."
    if not any(m.count(Class.IDENTIFIABLE) for m in analysis.models):
        few = f"The motion excites only {len(full.estimate.kept)} of these, and noise hides them."
        poor = len(full.estimate.kept) < base.rank
        size += f" {chosen.unjudged or (few if poor else 'Noise hides all of them.')}"
    if analysis.missing.functions:
        missing = analysis.missing.statement
        size += f" That holds only if nothing is missing: {missing}: diagnose."
    tone = "blue" if chosen.feasible else "amber"
    physics = analysis.physical_statement
    return Answer(question, short, f"{size} {physics}", tone)


def _cautions(analysis: Analysis) -> tuple[Note, ...]:
    """Return the caveats, gravest first."""
    kinds = {"commands": "commands", "reading": "read"}
    notes = [note(kinds.get(getattr(h, "key", ""), "hint"), hint=h) for h in analysis.hints]
    if analysis.nothing:
        why = f"{analysis.nothing[0].upper()}{analysis.nothing[1:]}"
        notes.append(note("nothing", why=why))
    if not np.isfinite(analysis.chosen.error_ra_validation):
        return (*notes, *_sample_notes(analysis))
    for part in (_physics_notes, _excitation_notes, _sample_notes, _fit_notes):
        notes += part(analysis)
    order = {"warning": 0, "note": 1, "good": 2}
    return tuple(sorted(notes, key=lambda n: order[n.level]))


def physics_notes(chosen: ModelResult) -> Iterator[Note]:
    """Say which values no real robot has; the combination itself stands in a section below."""
    near = f"the nearest real robot errs by {error_text(chosen.error_ra_physical)} on unseen motion"
    if chosen.infeasible:
        yield note("impossible", names=join(chosen.infeasible), near=near)
    elif not chosen.feasible and chosen.physical.certificate is not None:
        yield note("nearly", near=near)


def _physics_notes(analysis: Analysis) -> Iterator[Note]:
    chosen, full = analysis.chosen, analysis.full
    if analysis.mass_warning:
        yield note("mass", warning=analysis.mass_warning)
    yield from physics_notes(chosen)
    if full.infeasible and full is not chosen:
        names, size = join(full.infeasible), len(full.submodel)
        yield note("unpruned", title=model_title(full), names=names, size=size)


def _excitation_notes(analysis: Analysis) -> Iterator[Note]:
    base, full = analysis.base, analysis.full
    if len(full.estimate.kept) < base.rank:
        yield note("poor", rank=base.rank, excited=len(full.estimate.kept))
    if base.ambiguous:
        yield note("ambiguous")


def _sample_notes(analysis: Analysis) -> Iterator[Note]:
    for s in (*analysis.samples, *analysis.validation):
        if s.survey.dropped:
            yield note("dropped", log=s.name, samples=format_count(s.survey.dropped, "sample"))
        if s.survey.singular:
            samples = format_count(s.survey.singular, "sample")
            condition = format_number(s.survey.condition, 2)
            yield note("singular", log=s.name, samples=samples, condition=condition)


def _fit_notes(analysis: Analysis) -> Iterator[Note]:
    """Say what is not judged, and how far the error on unseen motion can be trusted."""
    chosen, full = analysis.chosen, analysis.full
    if chosen.unjudged:
        yield note("unjudged", why=chosen.unjudged)
    elif chosen.some_unjudged:
        count, size = chosen.count(Class.NOT_JUDGED), len(chosen.submodel)
        yield note("some_unjudged", count=str(count), size=str(size), why=chosen.some_unjudged)
    if full.unjudged and full is not chosen:
        title = f"The unpruned {model_title(full)} is not judged."
        yield Note("warning" if chosen.unjudged else "note", title, full.unjudged)
    if not analysis.validation:
        yield note("inside", kind=analysis.validation_kind)


def _spread_cell(m: ModelResult) -> Cell:
    spread = m.spread * m.error_joints_validation
    note = f"worse at {join(m.worse_at, 3)}" if m.worse_at else ""
    if not np.isfinite(spread):
        return Cell(NONE, spread)
    return Cell(f"± {percent(spread, 2)}" if spread else "least error", spread, note)


def _condition_text(condition: float) -> str:
    return format_number(condition, 3) if np.isfinite(condition) else "∞"


def _possible_cell(m: ModelResult) -> Cell:
    near = f"nearest real robot: {error_text(m.error_ra_physical)}"
    if m.feasible:
        return Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        return Cell("no", 0.0, f"wrong sign: {join(m.infeasible, 3)}; {near}", "differs")
    return Cell("open" if m.physical.certificate is None else "not exactly", 1.0, near, "partly")


LADDER = with_hints(
    "models",
    Column("model", get=lambda m: Cell(m.name, note=m.submodel.description)),
    Column("parameters", "number", lambda m: len(m.submodel)),
    Column("identifiable", "number", found_cell),
    Column("10× rule", "number", "paper_identified", detail=True),
    Column("error, fitted", error_text, "error_ra"),
    Column("error, unseen", error_text, "error_ra_validation"),
    Column("joints, unseen", error_text, "error_joints_validation", detail=True),
    Column("± SE", "error", _spread_cell, detail=True),
    Column("condition", _condition_text, "estimate.condition", detail=True),
    Column("real robot", "badge", _possible_cell),
)


def error_tables(result: Laddered) -> tuple[Table, ...]:
    """Return the errors of the model to use by joint and, where there are several, by log."""
    errors, measured = result.error_frame(), result._alone[1].rms
    told = ["name", "unit", "error", "error_validation", "rms_validation", "error_raw_validation"]
    each = errors[errors["of"] == "joint"][told].to_numpy().tolist()
    every = [
        (row[0], rms, *row[1:], time)
        for row, rms, time in zip(each, measured, result._used.autocorrelation_time, strict=True)
    ]
    shown = [every[k] for k in loaded_joints(measured)]
    joints = Table.of(
        "Each joint by itself, over how much its own torque varies", JOINTS, shown, worst=4
    )
    samples = (*result.samples, *result.validation)
    if len(samples) == 1:
        return (joints,)
    logs = errors[errors["of"] == "log"][["error", "error_validation"]]
    pairs = zip(samples, logs.itertuples(index=False), strict=True)
    rows = [(s.name, s.outputs, a, b) for s, (a, b) in pairs]
    return joints, Table.of("Each log by itself", LOGS, rows, worst=3)


JOINTS = with_hints(
    "joints",
    Column("joint"),
    Column("measured, rms", digits(3), detail=True),
    Column("unit"),
    Column("error, fitted", error_text),
    Column("error, unseen", error_text),
    Column("rms error, unseen", digits(3)),
    Column("of raw torque, unseen", error_text),
    Column("autocorrelation time [samples]", time_text, detail=True),
)

LOGS = (
    Column("log"),
    Column("samples", "number"),
    Column("error, fitted", error_text),
    Column("error, unseen", error_text),
)


def parameter_table(analysis: Analysis, result: ModelResult) -> Table:
    """Return one row for each parameter of a model, filtered by verdict."""
    most = max((v.share for v in result.verdicts), default=0.0)
    reduced = any(v.terms["omitted"] for v in result.verdicts)
    stated = dict(zip(result.submodel.columns, stated_values(analysis, result), strict=True))

    def share(v: Verdict) -> Cell:
        length = v.share / most if np.isfinite(most) and most > 0 else 0.0
        return Cell(percent_text(100 * v.share), v.share, share=length)

    def in_file(v: Verdict) -> Cell:
        text, label = (stated_text(x, v.sigma_robust) for x in (stated[v.name], v.nominal))
        differs = stated[v.name] is not None and v.terms["omitted"] and text != label
        return Cell(text, stated[v.name], f"label {label}" if differs else "")

    every = with_hints(
        "parameters",
        Column("parameter", get=lambda v: Cell(v.name, note=label_note(v))),
        VALUE,
        SIGMA,
        UNIT,
        Column("σ white", percent_text, "sigma_percent", detail=True),
        Column("σ robust", percent_text, "sigma_robust_percent", detail=reduced),
        Column("σ label", percent_text, "sigma_label_percent"),
        Column(
            "σ bootstrap",
            percent_text,
            lambda v: percent_of(v.sigma_bootstrap, v.value),
            detail=True,
        ),
        Column("σ is of", get=_terms_cell, detail=True),
        *bias_columns(result.verdicts),
        Column("robot file", "number", in_file),
        Column("share of torque", "bar", share),
        Column("10× rule", "text", _paper_cell, detail=True),
        VERDICT,
    )
    own = tuple(c for c in every if reduced or c.title != "σ label")
    return Table.of("", own, result.verdicts, filter_by=-1, long=True)


def _terms_cell(v: Verdict) -> Cell:
    """Return the shares that terms have of the variance of a label, the largest first."""
    total = v.sigma_label**2
    if not 0 < total < np.inf:
        return Cell(NONE, 0.0)
    order = sorted(v.terms, key=lambda term: -v.terms[term])
    each = [f"{term} {percent(v.terms[term] ** 2 / total, 2)}" for term in order[:3]]
    shown = [text for term, text in zip(order, each, strict=False) if v.terms[term] > 0]
    return Cell(", ".join(shown), v.terms[order[0]] ** 2 / total)


def _paper_cell(v: Verdict) -> Cell:
    return Cell("✓" if v.paper_rule else "–", float(v.paper_rule))


def label_note(v: Verdict) -> str:
    """Return the combination that a name stands for; nothing where it is the parameter alone."""
    alone = " " not in v.label and v.label[:1] not in "−-0123456789"
    return "" if alone else shorten_label(v.label)


def shorten_label(label: str, most: int = 64) -> str:
    """Return the first terms of a long combination, and … for those that the groupings show."""
    if len(label) <= most:
        return label
    cut = max(label.rfind(sign, 0, most) for sign in (" + ", " − ", " = "))
    return f"{label[:cut] if cut > 0 else label[:most]} …"


def stated_values(analysis: Analysis, result: ModelResult) -> list[float | None]:
    """Return what this fit would find on the robot of the file, None where it states nothing.

    A value that stands for more than its label is compared with what the file's robot would show.
    """
    known, base = analysis.robot.nominal, analysis.base
    stated = np.array([any(p.name in known for _, p in base.terms(r)) for r in range(len(base))])
    member = np.abs(result.submodel.M) > 0
    return [
        v.projected if v.projected is not None and stated[member[:, k]].any() else None
        for k, v in enumerate(result.verdicts)
    ]
