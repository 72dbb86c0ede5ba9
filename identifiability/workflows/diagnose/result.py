"""`Diagnosis`: what is missing, with the evidence. `to_frame`, `to_json`, `write_report`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.effects.vocabulary import file_kinds, values_in_file
from identifiability.estimation.estimate import estimate, find_estimator
from identifiability.estimation.fit import Fit as Known
from identifiability.estimation.prediction import measure_spread, predict
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import digits, error_text, exact, join, percent
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.physical.cad_prior import WEAK, real_robot_dict, share_weight
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import LadderEntry, ModelEntry, full_model, ladder_text
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.workflow import hold_folds, settle_robot
from identifiability.workflows.answers import (
    after_mass,
    answer_next,
    state_error,
    tone_of,
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
from identifiability.workflows.diagnose.changes import table_changes
from identifiability.workflows.diagnose.findings import (
    PLACES,
    Findings,
    NamedEffect,
    Odds,
    call,
    headline,
    state,
    state_remainder,
)
from identifiability.workflows.diagnose.forward import ForwardGap, Physical, compare_forward
from identifiability.workflows.predict import Fit, Predicts, settled
from identifiability.workflows.rules import RULES as WORKFLOW_RULES
from identifiability.workflows.session import weigh_rows

if TYPE_CHECKING:
    from identifiability.workflows.commanded import Moved
    from identifiability.workflows.opening import Recordings

#: What the table says of an effect at a place, and of each parameter there.
PLACE, PARAMETER = ("effect", "joint", "shape", "log_odds"), ("parameter", "value", "error", "unit")


@frozen
class Diagnosis(Result, Findings, Predicts):
    """What is missing, with the evidence. `to_frame`, `to_json`, `write_report` give it away."""

    schema: ClassVar[str] = "identifiability/diagnosis/1"

    #: How far rollouts of the nearest real robot are off, of logs of commands.
    moved: Moved | None = None

    @cached_property
    def physical(self) -> dict[str, Any]:
        """The real robot nearest to the data with the named effects, as `export` reads it."""
        with one_thread("blas"):  # the same bits however many threads there are
            return nearest_dict(self)

    @cached_property
    def fit(self) -> Fit:
        """The model with the named effects: values, covariance, and how torque scatters."""
        with one_thread("blas"):
            return keep_completed(self)

    def moved_by(self, logs: Recordings) -> Diagnosis:
        """Return the diagnosis with how far rollouts are off, where logs are of commands."""
        if not logs.commanded:
            return self
        moved = logs.measure_rollouts(self.robot, self.physical["parameters"])
        said = () if moved is None else (moved.statement,)
        return replace(self, moved=moved, hints=(*said, *self.hints))

    def write_model(self, path: str | Path) -> Path:
        """Write the model with the named effects as a model file, for every other verb."""
        return self.note_written("model", write_text(path, self.model_text))

    @property
    def model_text(self) -> str:
        """The model with the named effects, their places and shapes, as the text of its file."""
        title = self.robot.title or self.robot.name
        return ladder_text(self.to_ladder(), f"{title}: the diagnosed model.")

    def to_ladder(self) -> LadderEntry:
        """Return the model with the named effects as a ladder of one model."""
        effects = list(self.model.texts)
        return LadderEntry(models=[ModelEntry(name="the diagnosed model", effects=effects)])

    def answers(self) -> tuple[Answer, ...]:
        """Return what is missing, what it explains, what is left, what to do next."""
        what = after_mass(_what(self), self.mass_warning)
        return what, _gap(self), _left(self), answer_next(next_commands(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, ."""
        return (WORKFLOW_RULES, ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return what changed in mid-log, the effects that were named, and the errors of joints."""
        named = Table.of("Effects that were missing", NAMED, self.effects)
        caption = "Each joint by itself on unseen motion, over its own scale"
        errors = Table.of(caption, ERRORS, self.error_frame().itertuples())
        changed = (table_changes(self.changes),) if self.changes else ()
        return (*changed, *((named,) if self.effects else ()), errors)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        return state(self)

    @property
    def unexplained(self) -> str:
        """What is left, in words."""
        return state_remainder(self)

    def to_frame(self) -> pd.DataFrame:
        """Return one row for every named effect and place.

        `before` and `after` are ε_RA on unseen motion without and with the whole effect.
        """
        rows = []
        for e in self.effects:
            for p in e.placements:
                where = (e.name, p.place, p.shape, p.odds)
                which = (", ".join(e.alternatives), e.before, e.after)
                rows += [(*where, *row, *which) for row in p.rows]
        return pd.DataFrame(rows, columns=[*PLACE, *PARAMETER, "or", "before", "after"])

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of each joint on unseen motion before and after.

        Over the joint's own scale (`torque_errors.joint_errors`), and in N or N·m (`rms`), of the
        torque that was fitted, low-passed with the columns where these were.
        """
        found = self.gap.prediction
        error, rms = found.joint_error(), found.joint_rms()
        columns = {
            "joint": self.robot.joints,
            "unit": self.robot.torque_units,
            "before": error[:, 0],
            "after": error[:, -1],
            "rms_before": rms[:, 0],
            "rms_after": rms[:, -1],
        }
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        return {
            "schema": self.schema,
            "robot": self.completed.robot.identity,
            "model": list(self.structure.model.texts),
            **pick(self, "fixed", "statement", "hints", "seed"),
            "physical": exact(self.physical, "parameters", "shapes", "gravity"),
            "before": pick(self, error_ra="error_before", error_ra_validation="held_before"),
            "effects": [_effect_row(e) for e in self.effects],
            "refuted": [pick(x, "name", "place", "unseen", odds="before") for x in self.refuted],
            "changes": [c.to_dict() for c in self.changes],
            "after": pick(self, error_ra="error_after", error_ra_validation="held_after"),
            "errors": {"joints": self.error_frame().to_dict("records")},
            "earlier": {"source": "", "error_ra_validation": None, "turns": []},  # for one release
            "change": {"interval95": list(self.interval), "measured": f"on {self.verified_on}"},
            "roles": {
                "chosen": "by the evidence of the fitted logs",
                "verified": self.verified_on,
                "fitted": list(given_paths(self.samples)),
                "verified_logs": list(given_paths(self.validation)),
                "left_out": [c.log for c in self.changes if c.whole],
                "alternative": self.alternative,
            },
            "real_robot": None,  # for one release
            "forward": None if self.forward is None else _forward_row(self.forward),
            "fit": self.fit.to_dict(),
            **({} if self.moved is None else {"rollout": self.moved.to_dict()}),
            "unexplained": {
                "statement": self.unexplained,
                "rms": {x.joint: x.rms for x in self.discrepancies},
            },
            "aliases": [],  # for one release
            "not_applicable": [vars(r) for r in self.refusals],
            "evidence": [_odds_row(x) for x in self.evidence],
            "steps": [],  # for one release
            "preparation": {
                s.path or s.name: list(s.notes) for s in (*self.samples, *self.validation)
            },
            "provenance": dict(self.provenance),
        }


def pick(value: Any, *names: str, **renamed: str) -> dict[str, Any]:
    """Return some attributes as JSON has them, by their names or by others."""
    fields = {new: getattr(value, name) for new, name in ({n: n for n in names} | renamed).items()}
    return {name: list(x) if isinstance(x, tuple) else x for name, x in fields.items()}


def _forward_row(gap: ForwardGap) -> dict[str, Any]:
    errors = pick(gap, "error_before", "error_after", change_interval95="interval")
    return {**pick(gap, "horizon", "note"), "stretches": len(gap.before), **errors}


def _odds_row(x: Odds) -> dict[str, Any]:
    after = x.after if np.isfinite(x.after) else None
    return {"effect": x.name, "place": x.place, "log_odds": x.before, "log_odds_after": after}


def _effect_row(e: NamedEffect) -> dict[str, Any]:
    """Return an effect as JSON has it; what only older readers ask for is null."""
    verified = {
        "error_ra_validation_before": "before",
        "error_ra_validation_after": "after",
        "change_interval95": "interval",
        "log_odds": "odds",
        "log_odds_unseen": "unseen",
    }
    return {
        **pick(e, "joints", "weight", "confirmed", "everywhere", effect="name", **verified),
        "p_value": None,
        "unnamed": e.unnamed,
        "nearest": list(e.nearest),
        "or": list(e.alternatives),
        "confusable_with": [
            {"effect": r.family, "joint": r.place, "undecided": True}
            for p in e.placements
            for r in p.rivals
        ],
        "places": [
            {
                **pick(p, "shape", "rms", "weight", joint="place", log_odds="odds"),
                "or": [{"effect": r.family, "joint": r.place} for r in p.rivals],
                "parameters": {name: value for name, value, *_ in p.rows},
            }
            for p in e.placements
        ],
    }


def simulate_forward(d: Findings, rng: np.random.Generator) -> ForwardGap:
    """Return the gap in motion of a diagnosis, on the motion that verified it."""
    try:
        before, after = (real_robot(d, s) for s in (d.structure, d.completed))
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    return replace(compare_forward(before, after, d.validation, rng), nearest=after)


def next_commands(d: Diagnosis) -> list[tuple[str, str]]:
    """Return lines for the terminal, the most useful first."""
    robot = source_name(d.robot)
    logs = name_logs(d.robot, given_paths(d.samples), how=d.preparation)
    logs += held_back(d.validation, d.samples)
    if not d.effects:
        analyze = f"identifiability analyze {robot} {logs} --report report.html"
        return [("See which parameters these logs determine:", analyze)]
    ask = f"identifiability diagnose {robot} {logs} --next motion.json"
    apart = [("Find the motion that tells one name from the other:", ask)]
    again = f"identifiability diagnose {robot} {logs}"
    judge = f"identifiability analyze {robot} {logs} --ladder {{file}} --report report.html"
    text, name = name_export(d.robot, d.fit.names)
    use = f"identifiability export {robot} {{file}} --out {name}"
    return [
        *(apart if any(e.alternatives for e in d.effects) else ()),
        (
            "Judge the parameters of the diagnosed model:",
            on_file(d, "model", "model.toml", f"{again} --out", judge),
        ),
        (
            text,
            on_file(d, "json", "diagnose.json", f"{again} --json", use),
        ),
    ]


ODDS = "Log odds for it on the fitted motion, all that was asked counted [nat]."


def _what(d: Diagnosis) -> Answer:
    question = "What is missing?"
    if not d.effects and not d.changes:
        return Answer(question, "Nothing that can be named.", headline(d), "grey")
    named = [f"{call(c.names)} in a part of {c.log}" for c in d.changes]
    named += [f"{e.called} in {join(e.joints, PLACES)}" for e in d.effects]
    short = join(named)
    return Answer(question, f"{short[0].upper()}{short[1:]}.", headline(d), "vermilion")


def _gap(d: Diagnosis) -> Answer:
    question = "How much of the gap does it explain?"
    if not d.effects:
        short = f"The error on unseen motion stays at {percent(d.held_before)}."
        return Answer(question, short, f"Measured on {d.verified_on}.")
    short = f"The error goes from {percent(d.held_before)} to {percent(d.held_after)}."
    text = f"All joints together on {d.verified_on}, which was not fitted."
    return Answer(question, short, text, "green" if d.interval[1] < 0 else "amber")


def _left(d: Diagnosis) -> Answer:
    error = d.held_after if d.effects else d.held_before
    question = "How good is the model then?"
    if not np.isfinite(error):
        return Answer(question, "There is no error to tell.", d.unexplained, "grey")
    judged, short, spread = state_error(error, d.robot.joints, d.error_frame()["after"].to_numpy())
    return Answer(question, short, f"{spread}{d.unexplained}", tone_of(judged))


# What is missing and how large errors are, as tables.


NAMED = (
    Column("effect", "code", lambda e: " or ".join([e.name, *e.alternatives])),
    Column("where", get=lambda e: ", ".join(e.joints)),
    Column("log odds", digits(3), "odds", ODDS),
    Column("on unseen motion", digits(3), "unseen"),
    Column("unseen error before", error_text, "before"),
    Column("after", error_text, "after"),
)

ERRORS = with_hints(
    "gap-joints",
    Column("joint", get="joint"),
    Column("before", error_text, "before"),
    Column("after", error_text, "after"),
    Column("rms before", digits(3), "rms_before", detail=True),
    Column("rms after", digits(3), "rms_after"),
    Column("unit", get="unit"),
)


def keep_completed(d: Findings) -> Fit:
    """Return the model with the named effects, with the values that its error is stated of.

    Intervals are those of a refit, whatever was known beforehand.
    """
    structure = d.completed
    submodel = full_model(structure.base, "the diagnosed model")
    regression = structure.regression(d.samples, keep=True)
    regression = replace(regression, instruments=None)
    information = gather_information(regression)
    fit = estimate(information)
    values: Array = structure.G @ _standard_values(d)
    found = predict(regression, values[:, None])
    low, raw = found.joint_rms()[:, 0], found.joint_rms(raw=True)[:, 0]
    unseen = d.gap.prediction.joint_rms()[:, -1]
    unseen_raw = np.sqrt(np.maximum(raw**2 - low**2, 0.0) + unseen**2)
    known = Known.of(information, fit, np.random.default_rng(d.seed), 0)
    spread = measure_spread(information, fit, known, (low, raw), (unseen, unseen_raw))
    return Fit(
        structure=structure,
        submodel=submodel,
        values=values,
        spread=spread,
        preparation=settled(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
    )


def _standard_values(d: Findings) -> Array:
    """Return values of the completed model's columns, the smallest of those that fit, (p,)."""
    columns, own = d.completed.columns, d.structure
    off = np.linalg.pinv(own.G) @ (d.values - own.nominal_base)
    phi, last = np.zeros(len(columns)), {name: k for k, name in enumerate(columns)}
    for name, x, more in zip(own.columns, own.nominal, off, strict=True):
        phi[columns.index(name)] = x + more
    for p in (p for e in d.effects for p in e.placements):
        phi[[last[name] for name in p.parameters]] += p.fitted
    return phi


def fit_physical(
    structure: Structure,
    samples: Sequence[Dataset],
    unseen: Sequence[Dataset] = (),
    cad_weight: float | None = None,
) -> Physical:
    """Return the real robot that explains some logs best under a model.

    How strongly it is drawn to the robot file is chosen by what it predicts of stretches of the
    logs, as of an analysis, where others are there to judge it; without any it is so weakly.
    It is not chosen where it is given.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    information = gather_information(structure.regression(samples, keep=True))
    joints, wls = structure.robot.joints, find_estimator("wls")
    information = weigh_rows(joints, samples, information, wls)[0]
    submodel, fit = full_model(structure.base), estimate(information)
    model = FittedModel(structure, submodel, information, information, fit)
    if unseen and cad_weight is None:
        held_out, short = hold_folds(information, wls)
        found = settle_robot(model, held_out, None, choose=not short).robot
    else:
        found = find_nearest(model, WEAK if cad_weight is None else cad_weight)
    if found.nearest is None:
        raise IdentifiabilityError(found.sentence.strip())
    return Physical(structure, found.parameters(), found.cad_weight)


def real_robot(d: Findings, structure: Structure) -> Physical:
    """Return the real robot of a diagnosis under the model without or with the named effects.

    With the file's values kept it is these, and what the named effects add.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    if len(d.known.free):
        weight = share_weight(d.known.share) if d.known.share else None
        return fit_physical(structure, d.samples, d.validation, weight)
    values = {name: d.robot.nominal.get(name, 0.0) for name in d.structure.columns}
    values = dict.fromkeys(structure.columns, 0.0) | values
    named = d.effects if structure is d.completed else ()
    for p in (p for e in named for p in e.placements):
        for name, value in zip(p.parameters, p.fitted.tolist(), strict=True):
            values[name] += value
    return Physical(structure, values)


def nearest_dict(d: Findings) -> dict[str, Any]:
    """Return the real robot with the named effects, with its errors on the fitted logs."""
    structure, known = d.completed, None if d.forward is None else d.forward.nearest
    try:
        real = real_robot(d, structure) if known is None else known
    except IdentifiabilityError as error:
        nothing = real_robot_dict(structure, {}, (np.nan,) * 3, np.empty((0, 3)))
        return {**nothing, "reason": str(error)}
    values = dict(real.values)
    # A named effect may have the columns of one in the model: these stand for both.
    names = structure.columns
    first = np.array([names.index(n) == k for k, n in enumerate(names)])
    files = [values_in_file(structure.robot, values, kind) for kind in file_kinds(structure.robot)]
    phi = np.array([[v[n] for n in names] for v in (values, *files)]).T
    regression = replace(structure.regression(d.samples, keep=True), instruments=None)
    found = predict(regression, structure.G @ (phi * first[:, None]))
    errors, each = found.relative_error(), found.joint_error()
    held_out = (float(errors[0]), float(errors[1]), float(errors[2]))
    return real_robot_dict(structure, _fold(values), held_out, each, d.samples, real.cad_weight)


def _fold(values: dict[str, float]) -> dict[str, float]:
    """Return values in which no joint has a Coulomb level for both directions and one for each."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
