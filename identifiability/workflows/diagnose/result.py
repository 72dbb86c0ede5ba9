"""`Diagnosis`: where model and data disagree, what is missing, with the evidence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd

from identifiability.effects import find_family, title_of
from identifiability.estimation.estimate import with_known
from identifiability.estimation.fit import Fit as Known
from identifiability.estimation.prediction import Prediction, measure_spread, predict
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.answers import Answer, Column, Note, Table
from identifiability.foundation.engines import one_thread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.keyed import Row, name_estimates
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import BASE, Array
from identifiability.foundation.output import write_text
from identifiability.foundation.quoting import option_for_shell
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rounding import REACH, digits, error_text, join, percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.physical.cad_prior import real_robot_dict, share_weight, state_mass
from identifiability.reading.rules import RULES as READING_RULES
from identifiability.regression.columns import Refusal
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderEntry, ModelEntry, full_model, ladder_text
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze.result import disagree
from identifiability.workflows.answers import (
    after_mass,
    answer_next,
    answer_quality,
    reserve,
    state_contradicted,
    state_uneven,
    with_hints,
)
from identifiability.workflows.commands import (
    EXPORT,
    compare_line,
    export_line,
    given_paths,
    held_back,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.diagnose.changes import Change, table_changes
from identifiability.workflows.diagnose.forward import ForwardGap, Physical, compare_forward
from identifiability.workflows.diagnose.problem import (
    Discrepancy,
    KnownValues,
    Problem,
    WeighedFit,
    fit_structure,
    nearest_robot,
    weigh_fit,
)
from identifiability.workflows.predict import (
    Fit,
    PositionPrediction,
    Predicts,
    move_fitted,
    with_cutoff,
)

if TYPE_CHECKING:
    from identifiability.quality.recordings import Recordings


#: Names that a sentence says of one effect; JSON has them all.
LIKELIEST = 4


class Rival(NamedTuple):
    """Another name for the same rows: "A or B"."""

    family: str
    place: str


@frozen
class Placement:
    """A named effect at one place.

    Attributes
    ----------
    place : str
    shape : float
        nan for families without one.
    parameters, units : tuple of str
    values, errors : (k,)
        Of the mixed model, with standard errors.
    rms : float [N·m or N]
        Of the torque that it adds at the joint where it is largest.
    rivals : tuple of Rival
    weight : float
        Its posterior probability among all that may be in its place.
    odds, unseen : float [nat]
        Log odds for it on the fitted motion, and what it gains on unseen motion.
    """

    place: str
    shape: float
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    errors: Array
    rms: float
    rivals: tuple[Rival, ...] = ()
    weight: float = 1.0
    odds: float = float("nan")
    unseen: float = float("nan")

    @property
    def rows(self) -> list[tuple[str, float, float, str]]:
        """Name, value, standard error and unit of each parameter."""
        values, errors = self.values.tolist(), self.errors.tolist()
        return list(zip(self.parameters, values, errors, self.units, strict=True))


@frozen
class Curve:
    """What an effect was learned to be, along the fitted motion.

    Attributes
    ----------
    title : str
    joint, of : int
        Actuated joint where it is largest, and joint whose motion it is drawn over.
    against : {"velocity", "position", "load", "time", "session"}
    x, learned, spread, data : (N,)
        Motion; torque of the effect, low-passed only where it remembers or is no function of one
        joint's motion, and its standard error; and the low-passed residual without the effect.
    """

    title: str
    joint: int
    of: int
    against: str
    x: Array
    learned: Array
    spread: Array
    data: Array


@frozen
class NamedEffect:
    """An effect that was found missing and added.

    Attributes
    ----------
    name : str
    placements : tuple of Placement
    before, after : float
        Held-out ε_RA of the model without and with it.
    interval : (float, float)
        95 % of the change.
    everywhere : bool
        Whether it is at all places where it can be.
    nearest : tuple of str
        Of such a function: the likeliest names in its stead.
    """

    name: str
    placements: tuple[Placement, ...]
    before: float
    after: float
    interval: tuple[float, float]
    everywhere: bool = False
    nearest: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """In words."""
        return title_of(self.name)

    @property
    def unnamed(self) -> bool:
        """Whether it is a function without a name."""
        return find_family(self.name).unnamed

    @property
    def confirmed(self) -> bool:
        """Whether unseen motion says so by itself."""
        return self.unseen >= ESTIMATION_RULES.keep

    @property
    def weight(self) -> float:
        """How sure the name is: the least posterior probability over its places."""
        return min(p.weight for p in self.placements)

    @property
    def odds(self) -> float:
        """Least log odds over its places [nat]."""
        return min(p.odds for p in self.placements)

    @property
    def unseen(self) -> float:
        """What it gains on unseen motion [nat]."""
        return min(p.unseen for p in self.placements)

    @property
    def joints(self) -> tuple[str, ...]:
        """Where it is."""
        return tuple(dict.fromkeys(p.place for p in self.placements))

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Families that the data do not tell from this one: the name is "A or B"."""
        rivals = [r for p in self.placements for r in p.rivals]
        return tuple(dict.fromkeys(r.family for r in rivals))

    @property
    def names(self) -> list[str]:
        """The name with its place, and its alternatives, with theirs where these are others."""
        rivals = [r for p in self.placements for r in p.rivals]
        others = [title_of(r.family) if r.place in self.joints else _at(*r) for r in rivals]
        return list(dict.fromkeys([_at(self.name, _where(self)), *others]))

    @property
    def called(self) -> str:
        """The same as one name, the likeliest alternatives: what is said first may not be surer."""
        more = len(self.names) - LIKELIEST
        others = [f"one of {more} more"] if more > 0 else []
        return " or ".join([*self.names[:LIKELIEST], *others])


@frozen
class Odds:
    """Log odds of a family at a place, or in all joints.

    Attributes
    ----------
    name, place : str
    before, after : float [nat]
        Beside the model, and beside what was named as well; nan of what was named itself.
    unseen : float [nat]
        What it gains on unseen motion; nan where it was not asked.
    """

    name: str
    place: str
    before: float
    after: float = float("nan")
    unseen: float = float("nan")


@frozen(kw_only=True)
class Diagnosis(Result, Predicts):
    """What is missing, with the evidence. `to_frame`, `to_json`, `write_report` give it away.

    Attributes
    ----------
    problem : Problem
        What was diagnosed, and from what.
    effects : tuple of NamedEffect
        In order of addition; empty when nothing can be named.
    curves : tuple of Curve
        One for each named effect and place.
    gap : Prediction
        Of unseen motion, by the base model, then after each effect.
    error_before, error_after : float
        ε_RA on the fitted logs.
    held_before, held_after : float
        ε_RA on unseen motion.
    refuted : tuple of Odds
        Of what fitted motion named and unseen motion did not confirm; in no model.
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies : tuple of Discrepancy
        Where what is left of the fitted motion sits.
    refusals : tuple of Refusal
    evidence : tuple of Odds
        Of all that was asked, the likeliest first.
    values : (b,)
        Base parameters of that model.
    completed : Structure
        The robot under the base model, with the named effects where folds of the fitted logs prefer
        it.
    information : Information
        About its base parameters, with equal rows.
    included : int
        How many of the effects are in the model, the first ones.
    moved : PositionPrediction or None
        How far rollouts of the nearest real robot are off, of logs of commands.
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    nothing : str
        Why nothing was looked for, for after "because"; empty where it was.
    alternative : str
        Under which other reading of the logs it was diagnosed, in a sentence; empty for none.
    """

    schema: ClassVar[str] = "identifiability/diagnosis/1"

    problem: Problem
    effects: tuple[NamedEffect, ...]
    curves: tuple[Curve, ...]
    gap: Prediction
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    refuted: tuple[Odds, ...]
    interval: tuple[float, float]
    discrepancies: tuple[Discrepancy, ...]
    refusals: tuple[Refusal, ...]
    evidence: tuple[Odds, ...]
    values: Array
    completed: Structure
    information: Information
    included: int = 0
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    nothing: str = ""
    alternative: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
    moved: PositionPrediction | None = None

    @property
    def structure(self) -> Structure:
        """The robot under the model that was diagnosed."""
        return self.problem.structure

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.problem.robot

    @property
    def samples(self) -> tuple[Dataset, ...]:
        """Fitted logs."""
        return self.problem.samples

    @property
    def validation(self) -> tuple[Dataset, ...]:
        """Held-out logs."""
        return self.problem.validation

    @property
    def known(self) -> KnownValues:
        """What is known of the model's values before the logs."""
        return self.problem.known

    @property
    def fixed(self) -> bool:
        """Whether the model keeps these values."""
        return self.problem.fixed

    @property
    def seed(self) -> int:
        """Of every random choice."""
        return self.problem.seed

    @property
    def verified_on(self) -> str:
        """The unseen motion in words."""
        return self.problem.verified_on

    @property
    def preparation(self) -> Preparation:
        """How logs were turned into motion, with one cut-off."""
        return self.problem.preparation

    @property
    def changes(self) -> tuple[Change, ...]:
        """What changed in the middle of fitted logs."""
        return self.problem.changes

    @property
    def commanded(self) -> bool:
        """Whether servos made the torque of commands."""
        return self.problem.commanded

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects of the model that was diagnosed."""
        return self.structure.model.names

    @property
    def model(self) -> Model:
        """The base model with the named effects that it includes."""
        return self.completed.model

    @cached_property
    def refit(self) -> WeighedFit:
        """The completed model, refitted to weighted rows."""
        known = with_known(self.information, self.completed.known)
        return weigh_fit(self.robot, self.samples, known)

    @property
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        known = None if self.forward is None else self.forward.nearest
        return "" if known is None else state_mass(self.robot, known.values, known.cad_weight)

    @cached_property
    def physical(self) -> dict[str, Any]:
        """The real robot nearest to the data with the named effects, as `export` reads it."""
        with one_thread("blas"):  # the same bits however many threads there are
            return nearest_dict(self)

    @cached_property
    def refitted(self) -> tuple[Information, Known]:
        """A refit of the model with the named effects, whatever was known beforehand."""
        information, fit, *_ = self.refit
        return information, Known.of(information, fit, np.random.default_rng(self.seed), 0)

    @cached_property
    def fit(self) -> Fit:
        """The model with the named effects: values, covariance, and how torque scatters."""
        with one_thread("blas"):
            return keep_completed(self)

    def moved_by(self, logs: Recordings) -> Diagnosis:
        """Return the diagnosis with how far rollouts are off, where logs are of commands."""
        if not logs.commanded:
            return self
        moved = move_fitted(self.robot, self.physical["parameters"], logs, bool(self.included))
        said = () if moved is None else (moved.told,)
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
        effects, random = list(self.model.texts), dict(self.model.random)
        only = ModelEntry(name="the diagnosed model", effects=effects, random=random)
        return LadderEntry(models=[only])

    def answers(self) -> tuple[Answer, ...]:
        """Return what is missing, what it explains, what is left, what to do next."""
        what = after_mass(_what(self), self.mass_warning)
        asked = what, _gap(self), _left(self)
        return (*reserve(asked, self.warnings), answer_next(next_commands(self)))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Findings that change a decision: of the logs, one joint, and contradicted bodies."""
        each = self.error_frame()["after"].to_numpy()
        uneven = state_uneven(self.held_after, self.robot.joints, each)
        seen = (*super().warnings, *uneven)
        if self.nothing or self.fixed:
            return seen
        base, fit = self.completed.base, self.fit
        sigma = np.sqrt(np.diag(fit.base_covariance))
        unknown = np.abs(fit.base_unknown).max(1, initial=0.0) > ROUNDOFF
        sigma = np.where(unknown, np.inf, sigma)
        stated = self.completed.nominal_base
        found = state_contradicted(base, full_model(base), fit.base, stated, sigma)
        return (*seen, *found)

    def tables(self) -> tuple[Table, ...]:
        """Return what changed in mid-log, the effects that were named, and the errors of joints."""
        named = Table.of("Effects that were missing", NAMED, self.effects)
        caption = "Each joint by itself on unseen motion, over its own scale"
        errors = Table.of(caption, ERRORS, self.error_frame().itertuples())
        changed = (table_changes(self.changes, CHANGED),) if self.changes else ()
        return (*changed, *((named,) if self.effects else ()), errors)

    def cautions(self) -> tuple[Note, ...]:
        """Return what else should be known of the named effects, and what was refuted."""
        return tuple(_remark(self))

    @property
    def statement(self) -> str:
        """The answers in plain words, and below them what should be known with them."""
        return "\n- ".join([super().statement, *(note.text for note in self.cautions())])

    @property
    def unexplained(self) -> str:
        """What is left, in words."""
        if max(self.held_after, self.error_after) < ROUNDOFF:
            return "The residual is rounding: the logs are explained to their last digits."
        parts = []
        left = [x for x in self.evidence if np.isfinite(x.after)]
        if left:
            most = max(left, key=lambda x: x.after)
            odds = f"{most.after:.2g}".replace("-", "−")
            parts.append(
                "Nothing that is known explains the rest; the likeliest is "
                f"{_at(most.name, most.place)} (log odds {odds})"
            )
        parts.append(f"The residual looks like {_looks(self)}")
        return " ".join(f"{part}." for part in parts)

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the parameters of the model, then those of the named effects with their odds."""
        yield from self.fit.rows_by_name()
        for effect in self.effects:
            confirmed = "confirmed" if effect.confirmed else "not confirmed"
            for place in effect.placements:
                reason = f"{effect.called}: log odds {place.odds:.3g} on the fitted motion."
                details = {"effect": effect.name, "joint": place.place, "log_odds": place.odds}
                told = {"verdict": confirmed, "reason": reason, "details": details}
                yield from name_estimates(place.rows, **told)

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        return self.fit.explain_absence(name)

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
        place, parameter = "effect joint shape log_odds", "parameter value error unit"
        columns = f"{place} {parameter} or before after".split()
        return by_name(pd.DataFrame(rows, columns=columns))

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of each joint on unseen motion before and after.

        Over the joint's own scale (`Prediction.joint_error`), and in N or N·m (`rms`), of the
        torque that was fitted, low-passed with the columns where these were.
        """
        found = self.gap
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
            "physical": self.physical,
            "before": pick(self, error_ra="error_before", error_ra_validation="held_before"),
            "effects": [_effect_row(e) for e in self.effects],
            "refuted": [pick(x, "name", "place", "unseen", odds="before") for x in self.refuted],
            "changes": [_change_row(c) for c in self.changes],
            "after": pick(self, error_ra="error_after", error_ra_validation="held_after"),
            "errors": {"joints": self.error_frame().to_dict("records")},
            "change": {"interval95": list(self.interval), "measured": f"on {self.verified_on}"},
            "roles": {
                "chosen": "by the evidence of the fitted logs",
                "verified": self.verified_on,
                "fitted": list(given_paths(self.samples)),
                "verified_logs": list(given_paths(self.validation)),
                "left_out": [c.log for c in self.changes if c.whole],
                "alternative": self.alternative,
            },
            "forward": None if self.forward is None else _forward_row(self.forward),
            "fit": self.fit.to_dict(),
            **({} if self.moved is None else {"rollout": self.moved.to_rollout()}),
            "unexplained": {
                "statement": self.unexplained,
                "rms": {x.joint: x.rms for x in self.discrepancies},
            },
            "not_applicable": [vars(r) for r in self.refusals],
            "evidence": [_odds_row(x) for x in self.evidence],
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


def _change_row(c: Change) -> dict[str, Any]:
    """Return a change as JSON has it; no instant where it was not logged."""
    ends = {"from": [c.start], "to": [c.stop], "from95": c.began, "to95": c.ended}
    known = {name: [x if np.isfinite(x) else None for x in at] for name, at in ends.items()}
    return {
        **pick(c, "log", "weight", effect="family", joint="place", log_odds="odds"),
        **known,
        **{name: known[name][0] for name in ("from", "to")},
        "or": [{"effect": family, "joint": place} for family, place in c.rivals],
        "parameters": dict(zip(c.names, c.sizes.tolist(), strict=True)),
        "errors": dict(zip(c.names, c.sd.tolist(), strict=True)),
    }


def _effect_row(e: NamedEffect) -> dict[str, Any]:
    """Return an effect as JSON has it."""
    verified = {
        "error_ra_validation_before": "before",
        "error_ra_validation_after": "after",
        "change_interval95": "interval",
        "log_odds": "odds",
        "log_odds_unseen": "unseen",
    }
    return {
        **pick(e, "joints", "weight", "confirmed", "everywhere", effect="name", **verified),
        "unnamed": e.unnamed,
        "nearest": list(e.nearest),
        "or": list(e.alternatives),
        "confusable_with": [
            {"effect": r.family, "joint": r.place} for p in e.placements for r in p.rivals
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


def simulate_forward(d: Diagnosis, rng: np.random.Generator) -> ForwardGap:
    """Return the gap in motion of a diagnosis, on the motion that verified it."""
    try:
        after = real_robot(d, d.completed)
        before = real_robot(d, d.problem.plain, after.cad_weight)
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    found = compare_forward(before, after, d.validation, rng)
    return replace(found, nearest=after)


def next_commands(d: Diagnosis) -> list[tuple[str, str]]:
    """Return lines for the terminal, the most useful first."""
    robot = source_name(d.robot)
    paths = given_paths(d.samples)
    given = name_logs(d.robot, paths, how=d.preparation)
    logs, model = given + held_back(d.validation, d.samples), d.provenance.get("model")
    again = f"identifiability diagnose {robot} {logs}"
    if model:
        again = f"{again} {option_for_shell('--model', model)}"
    undecided = any(e.alternatives for e in d.effects) and not d.written("next")
    tells = "Find the motion that tells one name from the other:", f"{again} --next motion.json"
    out = [tells] if undecided else []
    if logs_disagree(d):
        text, compare = compare_line(d.robot, paths, d.preparation)
        line = compare
        if d.included:
            make = f"{again} --out"
            line = on_file(d, "model", "model.toml", make, lambda x: f"{compare} --ladder {x}")
        out.insert(0, (text, line))
    if d.included:
        judge = f"identifiability analyze {robot} {logs}"
        use = partial("{} --ladder {} --report report.html".format, judge)
        line = on_file(d, "model", "model.toml", f"{again} --out", use)
        out.append(("Judge the parameters of the diagnosed model:", line))
    export = partial(export_line, d.robot)
    return [*out, (EXPORT, on_file(d, "json", "diagnose.json", f"{again} --json", export))]


def logs_disagree(d: Diagnosis) -> bool:
    """Return whether the fitted logs disagree although the named effects are in the model."""
    motions = d.refitted[1].motions
    apart = motions is not None and disagree(motions)
    shares = [x.explained.get("log", 0.0) for x in d.discrepancies]
    # A quarter of the residual.
    return apart or max(shares, default=0.0) > 0.25


ODDS = "Log odds for it on the fitted motion, all that was asked counted [nat]."


def _what(d: Diagnosis) -> Answer:
    model = d.alternative.partition(":")[0]
    told = [f"{model}."] if model else []
    told += [f"{_capital(c.called)}. What was logged meanwhile was left out." for c in d.changes]
    named = [f"{' or '.join([c.what, *c.others])} in a part of {c.log}" for c in d.changes]
    named += map(_state_effect, d.effects)
    if not d.effects:
        why = "No effect can be named" if d.evidence else _state_untried(d)
        told.append(
            f"{why}: {d.known.words} predict{'' if d.fixed else 's'} unseen motion "
            f"({d.verified_on}) with an error of {percent(d.held_before)}."
        )
    short = f"{_capital(join(named, PLACES))}." if named else "Nothing that can be named."
    odds = max([e.odds for e in d.effects] + [c.odds for c in d.changes], default=0.0)
    unsure = odds < READING_RULES.log_odds and not d.interval[1] < 0
    weak = unsure or not (d.included or d.changes)
    if named and weak:
        short = f"Nothing that makes the error smaller. Likeliest beside it: {short}"
    return Answer("What is missing?", short, " ".join(told), "grey" if weak else "vermilion")


def _gap(d: Diagnosis) -> Answer:
    question = "How much of the gap does it explain?"
    if not (d.included or d.changes):
        short = f"The error on unseen motion stays at {percent(d.held_before)}."
        why = " With it other motion is not predicted better." if d.effects else ""
        return Answer(question, short, f"Measured on {d.verified_on}.{why}")
    ends = [f"{100 * x:+.2g}".replace("-", "−") for x in d.interval]
    before = f"{percent(d.held_before)} ({d.known.words.rstrip(',')})"
    short = f"The error goes from {before} to {percent(d.held_after)}"
    short += f" (95 %: {' … '.join(ends)} points)." if any(d.interval) else "."
    text = f"All joints together on {d.verified_on}, which was not fitted."
    if 0 < d.included < len(d.effects):
        some = join([e.title for e in d.effects[: d.included]])
        text += f" By {some} alone: with the rest other motion is not predicted better."
    return Answer(question, short, text, "green" if d.interval[1] < 0 else "amber")


def _left(d: Diagnosis) -> Answer:
    question = "How good is the model then?"
    each = d.error_frame()["after"].to_numpy()
    about = d.held_after, d.robot.joints, each, d.unexplained, question
    told = answer_quality(*about, warnings=d.warnings)
    return told if d.moved is None else d.moved.warn(told)


#: Places that the headline lists of each effect.
PLACES = 3
#: Share of its variance from which on what a residual depends on is said.
VISIBLE: Tolerance = 0.05


def _at(name: str, place: str) -> str:
    """Return an effect and where it is; of the base its title says it."""
    return title_of(name) if place == BASE else f"{title_of(name)} in {place}"


def _where(e: NamedEffect) -> str:
    """Return where an effect is, in words."""
    return "all joints" if e.everywhere else join(e.joints, PLACES)


def _state_untried(d: Diagnosis) -> str:
    """Return why no family was tried, and the beginning of the sentence after that."""
    if d.nothing:
        return f"Nothing is named, because {d.nothing}. As it is"
    why = {f"{r.family} ({r.reason})": 0 for r in d.refusals}
    text = join(list(why))
    return f"Nothing was left to name: {text}. Give other families, or none for all. As it is"


def _remark(d: Diagnosis) -> Iterator[Note]:
    """Yield what else should be known of the named effects, and what was refuted."""
    if d.forward is not None and d.forward.measured:
        better = d.forward.interval[1] < 0
        yield Note("good" if better else "note", "In simulated motion", d.forward.statement)
    for e in d.effects:
        if e.alternatives:
            text = f"This motion cannot tell {e.called} apart: {advice(e)}."
            yield Note("note", "A or B", text)
        if e.unnamed:
            near = join(e.nearest)
            text = (
                f"Nearest to it are {near}." if near else "No effect that has a name can be there."
            )
            text = f"No name explains this in {_where(e)} as well. {text}"
            yield Note("note", "Without a name", text)
        if not e.confirmed:
            text = f"Unseen motion alone does not say so of {e.title}: treat it with caution."
            yield Note("note", "Not confirmed", text)
    for x in d.refuted:
        yield Note("note", "Refuted", _state_refuted(x, d))
    for hint in d.remarks:
        yield Note("note", "Please note", hint)


def _state_effect(e: NamedEffect) -> str:
    sure = f" (log odds {e.odds:.3g})" if np.isfinite(e.odds) else ""
    return f"{e.called}{_state_mass(e)}{sure}"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _state_mass(e: NamedEffect) -> str:
    """Return the mass of what was named, where it has one, with its 95 % interval."""
    masses = []
    for p in e.placements:
        for name, value, error, unit in p.rows:
            if name.endswith(".payload_m"):
                masses.append(f"{value:.3g} ± {REACH * error:.2g} {unit}")
    return f", {' and '.join(masses)}".replace("-", "−") if masses else ""


def _state_refuted(x: Odds, d: Diagnosis) -> str:
    """Return that the motion that verifies did not confirm an effect."""
    what = _capital(_at(x.name, x.place))
    gain = f"{x.unseen:.2g}".replace("-", "−")
    return (
        f"{what} stood out from the fitted motion (log odds {x.before:.3g}) and is left out: on "
        f"{d.verified_on} the torque is not surely likelier with it (log likelihood ratio {gain})."
    )


def advice(e: NamedEffect) -> str:
    """Return the motion that would tell an effect from its alternatives."""
    motions = [find_family(name).told_by for name in (e.name, *e.alternatives)]
    known = join(list(dict.fromkeys(filter(None, motions))))
    return f"{known or 'run other speeds, postures and loads in turn'} to separate them"


def _looks(d: Diagnosis) -> str:
    """Return what the residual depends on most, in words."""
    most = max(d.discrepancies, key=lambda x: max(x.explained.values(), default=0.0))
    where, best = max(most.explained.items(), key=lambda x: x[1])
    if best < VISIBLE:
        return "noise: it depends on none of velocity, position, acceleration, load or time"
    share = f"{percent(best, 2)} of its variance"
    return f"something that depends on the {where} in {most.joint} ({share})"


# What is missing and how large errors are, as tables.


CHANGED = "What changed in the middle of a log, and was left out"
NAMED = (
    Column(
        "effect",
        "code",
        lambda e: " or ".join(dict.fromkeys([e.name, *e.alternatives][:LIKELIEST])),
    ),
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


def keep_completed(d: Diagnosis) -> Fit:
    """Return the model with the named effects, with the values that its error is stated of.

    Intervals are those of a refit, whatever was known beforehand.
    """
    structure = d.completed
    submodel = full_model(structure.base, "the diagnosed model")
    information, known = d.refitted
    found = predict(structure.regression(d.samples), d.values[:, None])
    fitted, unseen = ((x.joint_rms()[:, -1], x.joint_rms(raw=True)[:, -1]) for x in (found, d.gap))
    spread = measure_spread(information, known, fitted, unseen)
    return Fit(
        structure=structure,
        submodel=submodel,
        values=d.values,
        spread=spread,
        preparation=with_cutoff(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
    )


def fit_physical(d: Diagnosis, structure: Structure, cad_weight: float | None = None) -> Physical:
    """Return the physically consistent robot that explains the fitted logs best under a model.

    The weight of the robot file is chosen by predictions of left-out stretches, unless it is given.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    weighed = (
        d.refit
        if structure is d.completed
        else fit_structure(structure, d.problem.regression(structure))
    )
    found = nearest_robot(structure, *weighed[:2], cad_weight)
    if found.nearest is None:
        raise IdentifiabilityError(found.sentence.strip())
    return Physical(structure, found.parameters(), found.cad_weight)


def real_robot(d: Diagnosis, structure: Structure, weight: float | None = None) -> Physical:
    """Return the real robot of a diagnosis under the model without or with the named effects.

    It is drawn to the robot file with a weight, where one is given, and the same one is compared.
    With the file's values kept it is these, and what the named effects add.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    if len(d.known.precision):
        weight = share_weight(d.known.share) if d.known.share else weight
        return fit_physical(d, structure, weight)
    values = {name: d.robot.nominal.get(name, 0.0) for name in d.structure.columns}
    values = dict.fromkeys(structure.columns, 0.0) | values
    if structure is d.completed:
        first, known = len(d.structure.columns), np.zeros(len(structure.columns))
        known[:first] = d.structure.nominal
        more = np.linalg.pinv(structure.G[:, first:]) @ (d.values - structure.G @ known)
        for name, value in zip(structure.columns[first:], more.tolist(), strict=True):
            values[name] += value
    return Physical(structure, values)


def nearest_dict(d: Diagnosis) -> dict[str, Any]:
    """Return the real robot with the named effects, with its errors on the fitted logs."""
    structure, known = d.completed, None if d.forward is None else d.forward.nearest
    try:
        real = real_robot(d, structure) if known is None else known
    except IdentifiabilityError as error:
        return {**real_robot_dict(structure, {}), "reason": str(error)}
    values, weight = _fold(dict(real.values)), real.cad_weight
    return real_robot_dict(structure, values, samples=d.samples, cad_weight=weight)


def _fold(values: dict[str, float]) -> dict[str, float]:
    """Return values in which no joint has a Coulomb level for both directions and one for each."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
