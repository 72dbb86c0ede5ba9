"""`Diagnosis`: disagreement of model and data, and missing effects with their evidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from identifiability.bending import Bending
from identifiability.effects import find_family, title_of
from identifiability.estimation.estimate import with_known
from identifiability.estimation.fit import Fit as Known
from identifiability.estimation.groups import NO_MISSING_EFFECTS, MissingEffects
from identifiability.estimation.prediction import Prediction, measure_offsets, measure_spread
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.verdict import to_row
from identifiability.foundation.engines import one_thread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.keyed import Row
from identifiability.foundation.names import Array, NumberByName, Strings, name_each
from identifiability.foundation.output import write_text
from identifiability.foundation.presenter import present, presented
from identifiability.foundation.result import Result
from identifiability.foundation.values import Json, frozen
from identifiability.logs.prepare import Preparation, Samples
from identifiability.physical.cad_prior import real_robot_dict, share_weight, state_mass
from identifiability.physical.feasibility import PhysicalResult
from identifiability.regression.columns import Refusal
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderEntry, ladder_text, model_entry
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, list_asked_effects
from identifiability.robot import Robot
from identifiability.workflows.analyze.result import Analysis, disagree
from identifiability.workflows.changes import Change
from identifiability.workflows.predict import (
    Fit,
    PositionPrediction,
    Predicts,
    list_missing,
    move_fitted,
    with_cutoff,
)
from identifiability.workflows.provenance import given_paths

from .forward import ForwardGap, Physical, compare_forward
from .problem import (
    Discrepancy,
    KnownValues,
    Problem,
    Recommended,
    WeighedFit,
    fit_structure,
    nearest_robot,
    weigh_fit,
)

if TYPE_CHECKING:
    from identifiability.quality.recordings import Recordings
    from identifiability.reading import CarriedReading


class Rival(NamedTuple):
    """A competing hypothesis for the same rows: "A or B"."""

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
        Of the mixed model, with standard errors; those of a tilted base are of the refitted model.
        The error of a law of friction includes that of its shape.
    rms : float [N·m or N]
        Of the torque that it adds: at a motor of several joints along this motor, else at the
        joint where it is largest.
    peak : float [N·m or N]
        Largest torque that it adds there along the fitted rows.
    torque_unit : str
        Unit of both.
    joint : str
        The joint where its torque is largest.
    share : float
        Rms of its torque there, relative to the variation of the measured torque.
    rivals : tuple of Rival
    weight : float
        Its posterior probability among all competing hypotheses.
    odds, unseen : float [nat]
        Log odds for the effect on the fitted motion, and its gain on unseen motion.
    sure : bool
        Whether the effect is named there. Else only its values elsewhere need it.
    shape_error : float
        Standard error of the shape; nan for families without one that is estimated.
    exponent : float
        Exponent of the speed in its law; nan for families without one.
    """

    place: str
    shape: float
    parameters: Strings
    units: Strings
    values: Array
    errors: Array
    rms: float
    peak: float
    torque_unit: str
    joint: str
    share: float
    rivals: tuple[Rival, ...] = ()
    weight: float = 1.0
    odds: float = np.nan
    unseen: float = np.nan
    sure: bool = True
    shape_error: float = np.nan
    exponent: float = np.nan

    @property
    def rows(self) -> list[tuple[str, float, float, str]]:
        """Name, value, standard error and unit of each parameter."""
        values, errors = self.values.tolist(), self.errors.tolist()
        return list(zip(self.parameters, values, errors, self.units, strict=True))


@frozen
class Curve:
    """Learned law of an effect along the fitted motion.

    Attributes
    ----------
    title : str
    joint, of : int
        Actuated joint where it is largest, and joint whose motion it is drawn over.
    against : {"velocity", "position", "load", "time", "session"}
    x, learned, spread, data : (N,)
        Motion; torque of the effect with its standard error; and the low-passed residual without
        the effect. Only torque with hysteresis, or of several joints' motion, is low-passed.
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
        Whether it acts at all possible places.
    nearest : tuple of str
        For a nonparametric function: the likeliest named families instead of it.
    """

    name: str
    placements: tuple[Placement, ...]
    before: float
    after: float
    interval: tuple[float, float]
    everywhere: bool = False
    nearest: Strings = ()

    @property
    def title(self) -> str:
        """In words."""
        return title_of(self.name)

    @property
    def unnamed(self) -> bool:
        """Whether it is a nonparametric function."""
        return find_family(self.name).unnamed

    @property
    def confirmed(self) -> bool:
        """Whether unseen motion alone confirms it."""
        return self.unseen >= ESTIMATION_RULES.keep

    @property
    def weight(self) -> float:
        """Posterior probability of the name: the least over its places."""
        return min(p.weight for p in self.placements)

    @property
    def odds(self) -> float:
        """Least log odds over its places [nat]."""
        return min(p.odds for p in self.placements)

    @property
    def unseen(self) -> float:
        """Gain of the effect on unseen motion [nat]."""
        return min(p.unseen for p in self.placements)

    @property
    def joints(self) -> Strings:
        """Where it surely is."""
        return tuple(dict.fromkeys(p.place for p in self.placements if p.sure))

    @property
    def alternatives(self) -> Strings:
        """Families that the data do not distinguish from this one: the name is "A or B"."""
        rivals = [r for p in self.placements for r in p.rivals]
        return tuple(dict.fromkeys(r.family for r in rivals))


@frozen
class Odds:
    """Log odds of a family at a place, or in all joints.

    Attributes
    ----------
    name, place : str
    before, after : float [nat]
        Given the model, and given the named effects as well; nan for named effects.
    unseen : float [nat]
        Gain on unseen motion; nan where it was not asked.
    needed : float [nat]
        Gain on left-out blocks that names a possible effect; nan where another reason decides.
    """

    name: str
    place: str
    before: float
    after: float = np.nan
    unseen: float = np.nan
    needed: float = np.nan


@frozen(kw_only=True)
class Diagnosis(Result, Predicts):
    """Missing effects with their evidence. `to_frame`, `to_json` and `write_report` export it.

    Attributes
    ----------
    problem : Problem
        The diagnosed model and its logs.
    effects : tuple of NamedEffect
        The one that explains most is first; empty when nothing can be named.
    curves : tuple of Curve
        One for each named effect and place.
    gap : Prediction
        Of unseen motion, by the base model, then after each effect.
    fitted : Prediction
        Of the fitted logs, by the base model and by the model to predict with.
    held_before, held_after : float
        ε_RA on unseen motion.
    refuted : tuple of Odds
        Of effects that fitted motion named and unseen motion refuted; in no model.
    possible : tuple of Odds
        Of possible effects that are not named; in no model. `unseen` is the gain on left-out blocks
        of the fitted motion.
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies : tuple of Discrepancy
        Residuals of the fitted motion by joint.
    refusals : tuple of Refusal
    evidence : tuple of Odds
        Of all groups in the search, the likeliest first.
    used : Recommended
        The model to predict with: the completed one, or its reduction by the ladder.
    completed : Structure
        The robot under the base model, with the named effects where folds of the fitted logs prefer
        it.
    information : Information
        About its base parameters, with equal rows.
    weighed : WeighedFit or None
        Its fit to weighted rows, if the values have no prior.
    included : int
        Number of places whose effects are in the model; these are the first ones.
    moved : PositionPrediction or None
        Position errors of rollouts of the nearest physical robot, for logs of commands.
    lacked : MissingEffects
        Effects that the search found and that the completed model still lacks.
    judged : Analysis or None
        Verdicts of `analyze` on the completed model; None where values are kept.
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    bending : Bending or None
        Joints that bend, if that was asked.
    hints : tuple of str
        Possible problems of robot file and logs, for the user to check.
    nothing : str
        Reason, after "because", why there was no search; empty if there was.
    alternative : str
        A sentence on the other reading of the logs under which it was diagnosed; else empty.
    reading : CarriedReading or None
        That reading, if columns or gravity have another one.
    began : float or None [s]
        When the session of the logs began, on the clock of their files; None if they share none.
    """

    schema = "identifiability/diagnosis/1"

    problem: Problem
    effects: tuple[NamedEffect, ...]
    curves: tuple[Curve, ...]
    gap: Prediction
    fitted: Prediction
    held_before: float
    held_after: float
    refuted: tuple[Odds, ...]
    possible: tuple[Odds, ...]
    interval: tuple[float, float]
    discrepancies: tuple[Discrepancy, ...]
    refusals: tuple[Refusal, ...]
    evidence: tuple[Odds, ...]
    used: Recommended
    completed: Structure
    information: Information
    weighed: WeighedFit | None = None
    included: int = 0
    forward: ForwardGap | None = None
    bending: Bending | None = None
    hints: Strings = ()
    nothing: str = ""
    alternative: str = ""
    reading: CarriedReading | None = None
    began: float | None = None
    provenance: Mapping[str, str] = {}
    moved: PositionPrediction | None = None
    lacked: MissingEffects = NO_MISSING_EFFECTS
    judged: Analysis | None = None

    @property
    def structure(self) -> Structure:
        """The robot under the model that was diagnosed."""
        return self.problem.structure

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.problem.robot

    @property
    def samples(self) -> Samples:
        """Fitted logs."""
        return self.problem.samples

    @property
    def validation(self) -> Samples:
        """Held-out logs."""
        return self.problem.validation

    @property
    def known(self) -> KnownValues:
        """Prior knowledge of the model's values."""
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
    def values(self) -> Array:
        """Base parameters of the model to predict with, (b,)."""
        return self.used.base

    @property
    def error_before(self) -> float:
        """ε_RA of the base model on the fitted logs."""
        return float(self.fitted.relative_error()[0])

    @property
    def error_after(self) -> float:
        """ε_RA of the model to predict with on the fitted logs."""
        return float(self.fitted.relative_error()[-1])

    @property
    def verified_on(self) -> str:
        """The unseen motion in words."""
        return self.problem.verified_on

    @property
    def preparation(self) -> Preparation:
        """Preparation of the logs, with one cut-off."""
        return self.problem.preparation

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes in the middle of fitted logs."""
        return self.problem.changes

    @property
    def commanded(self) -> bool:
        """Whether servos made the torque of commands."""
        return self.problem.commanded

    @property
    def base(self) -> Strings:
        """Names of the effects of the model that was diagnosed."""
        return Model.of(*list_asked_effects(self.structure)).names

    @property
    def model(self) -> Model:
        """The base model with the named effects that it includes."""
        return self.completed.model

    @cached_property
    def refit(self) -> WeighedFit:
        """The completed model, refitted to weighted rows."""
        if self.weighed is not None:
            return self.weighed
        known = with_known(self.information, self.completed.known)
        return weigh_fit(self.robot, self.samples, known)

    @property
    def mass_warning(self) -> str:
        """A warning if the total mass of the nearest physical robot is wrong; else empty."""
        known = None if self.forward is None else self.forward.nearest
        return "" if known is None else state_mass(self.robot, known.values, known.cad_weight)

    @cached_property
    def physical(self) -> Json:
        """The physical robot nearest to the data with the named effects, as `export` reads it."""
        with one_thread("blas"):  # the same bits however many threads there are
            return nearest_dict(self)

    @cached_property
    def fit(self) -> Fit:
        """The model with the named effects: values, covariance, and residual scatter."""
        submodel = replace(self.used.submodel, name="the diagnosed model")
        with one_thread("blas"):
            judged = self.judged
            fit = fit_kept(self) if judged is None else replace(judged, nothing="").fit
        fit = replace(fit, submodel=submodel, values=self.used.values)
        return replace(fit, reading=self.reading, began=self.began)

    def moved_by(self, logs: Recordings) -> Diagnosis:
        """Return the diagnosis with position errors of rollouts, for logs of commands."""
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
        entry = model_entry(
            replace(self.used.reduction, name="the diagnosed model"), self.completed
        )
        effects = [*list_asked_effects(self.completed)]
        axes = [axis.name for axis in self.robot.axes]
        texts = (f"{x.name}@{x.place}" if x.place in axes else x.name for x in self.refuted)
        refuted = [*dict.fromkeys(texts)]
        update = {"effects": effects, "refuted": refuted}
        return LadderEntry(models=[entry.model_copy(update=update)])

    @property
    @presented
    def unexplained(self) -> str:
        """Description of the remaining residual."""
        raise NotImplementedError

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the parameters of the model, then those of the named effects with their odds."""
        judged = self.judged
        yield from self.fit.rows_by_name() if judged is None else map(to_row, judged.chosen.rows())
        yield from present(self, "effect_rows")

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        return self.fit.explain_absence(name)

    @presented
    def error_frame(self) -> pd.DataFrame:
        """Return the errors of each joint on unseen motion before and after.

        Over the joint's own scale (`Prediction.joint_error`), and in N or N·m (`rms`), of the
        torque that was fitted, low-passed with the columns where these were.
        """
        raise NotImplementedError

    def to_dict(self) -> Json:
        """Return the result in the documented JSON schema."""
        logs, forward = (*self.samples, *self.validation), self.forward
        stated = pick(self, "fixed", "statement", "hints", "seed", "physical")
        errors = {"joints": self.error_frame().to_dict("records")}
        change = {"interval95": list(self.interval), "measured": f"on {self.verified_on}"}
        preparation = {s.path or s.name: list(s.notes) for s in logs}
        found = {
            "schema": self.schema,
            "robot": self.completed.robot.identity,
            "model": list(list_asked_effects(self.structure)),
            **stated,
            "before": pick(self, error_ra="error_before", error_ra_validation="held_before"),
            **self._missing(),
            "after": pick(self, error_ra="error_after", error_ra_validation="held_after"),
            "errors": errors,
            "change": change,
            "roles": self._roles(),
            "forward": None if forward is None else _forward_row(forward),
            "fit": self.fit.to_dict(),
            "preparation": preparation,
            "provenance": dict(self.provenance),
        }
        judged = self.judged
        if judged is not None:
            found |= {
                "parameters": judged.chosen.rows(),
                "missing_functions": list_missing(judged.missing),
            }
        if self.bending is not None:
            found["bending"] = self.bending.to_dict()
        return found if self.moved is None else found | {"rollout": self.moved.to_rollout()}

    def _missing(self) -> Json:
        """Return missing effects, refuted effects and the unexplained residual, for JSON."""
        rms = {x.joint: x.rms for x in self.discrepancies}
        effects = [_effect_row(e) for e in self.effects]
        refuted = [pick(x, "name", "place", "unseen", odds="before") for x in self.refuted]
        possible = [
            pick(x, "name", "place", odds="before", left_out="unseen") for x in self.possible
        ]
        changes = [_change_row(c) for c in self.changes]
        return {
            "effects": effects,
            "refuted": refuted,
            "possible": possible,
            "changes": changes,
            "unexplained": {"statement": self.unexplained, "rms": rms},
            "not_applicable": [vars(r) for r in self.refusals],
            "evidence": [_odds_row(x) for x in self.evidence],
        }

    def _roles(self) -> Json:
        """Return the logs that chose, verified and were left out, for JSON."""
        fitted = list(given_paths(self.samples))
        verified_logs = list(given_paths(self.validation))
        left_out = [c.log for c in self.problem.left_out if c.whole]
        return {
            "chosen": "by the evidence of the fitted logs",
            "verified": self.verified_on,
            "fitted": fitted,
            "verified_logs": verified_logs,
            "left_out": left_out,
            "alternative": self.alternative,
        }


def pick(value: Any, *names: str, **renamed: str) -> Json:
    """Return some attributes for JSON, by their names or by other names."""
    every = name_each(names, names) | renamed
    fields = {new: getattr(value, name) for new, name in every.items()}
    return {name: list(x) if isinstance(x, tuple) else x for name, x in fields.items()}


def _forward_row(gap: ForwardGap) -> Json:
    errors = pick(gap, "error_before", "error_after", change_interval95="interval")
    return {**pick(gap, "horizon", "note"), "stretches": len(gap.before), **errors}


def _odds_row(x: Odds) -> Json:
    after = x.after if np.isfinite(x.after) else None
    return {"effect": x.name, "place": x.place, "log_odds": x.before, "log_odds_after": after}


def _change_row(c: Change) -> Json:
    """Return a change for JSON, without an instant that was not logged."""
    ends = {"from": [c.start], "to": [c.stop], "from95": c.began, "to95": c.ended}
    known = {name: [x if np.isfinite(x) else None for x in at] for name, at in ends.items()}
    picked = pick(c, "log", "weight", effect="family", joint="place", log_odds="odds")
    bounds = {name: known[name][0] for name in ("from", "to")}
    parameters = name_each(c.names, c.sizes)
    errors = name_each(c.names, c.sd)
    return {
        **picked,
        **known,
        **bounds,
        "or": _rival_rows(c.rivals),
        "parameters": parameters,
        "errors": errors,
    }


def _effect_row(e: NamedEffect) -> Json:
    """Return an effect as JSON has it."""
    verified = {
        "error_ra_validation_before": "before",
        "error_ra_validation_after": "after",
        "change_interval95": "interval",
        "log_odds": "odds",
        "log_odds_unseen": "unseen",
    }
    names = "joints", "weight", "confirmed", "everywhere", "unnamed", "nearest"
    places = [
        {
            **pick(
                p,
                "shape",
                "shape_error",
                "exponent",
                "rms",
                "share",
                "weight",
                joint="place",
                log_odds="odds",
            ),
            "or": _rival_rows(p.rivals),
            "parameters": name_each(p.parameters, p.values),
        }
        for p in e.placements
    ]
    picked = pick(e, *names, effect="name", **verified)
    rivals = _rival_rows(r for p in e.placements for r in p.rivals)
    return {
        **picked,
        "or": list(e.alternatives),
        "confusable_with": rivals,
        "places": places,
    }


def _rival_rows(rivals: Iterable[tuple[str, str]]) -> list[dict[str, str]]:
    return [{"effect": family, "joint": place} for family, place in rivals]


def simulate_forward(d: Diagnosis, rng: np.random.Generator) -> ForwardGap:
    """Return the gap in motion of a diagnosis, on the motion that verified it."""
    try:
        after = real_robot(d, d.completed)
        before = real_robot(d, d.problem.plain, after.cad_weight)
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    found = compare_forward(before, after, d.validation, rng)
    return replace(found, nearest=after)


def logs_disagree(d: Diagnosis) -> bool:
    """Return whether the fitted logs disagree although the named effects are in the model."""
    motions = None if d.judged is None else d.judged.full.fit.motions
    apart = motions is not None and disagree(motions)
    shares = [x.explained.get("log", 0.0) for x in d.discrepancies]
    # A quarter of the residual.
    return apart or max(shares, default=0.0) > 0.25


def fit_kept(d: Diagnosis) -> Fit:
    """Return the model with the named effects and kept values.

    Intervals are those of a refit without prior knowledge of the values.
    """
    information, estimate, *_ = d.refit
    known = Known.of(information, estimate, np.random.default_rng(d.seed), 0)
    each = ((x.joint_rms()[:, -1], x.joint_rms(raw=True)[:, -1]) for x in (d.fitted, d.gap))
    spread = measure_spread(information, known, *each)
    return Fit(
        structure=d.completed,
        submodel=d.used.submodel,
        values=d.used.values,
        spread=spread,
        preparation=with_cutoff(d.preparation, d.samples),
        base_covariance=spread.covariance,
        base_unknown=spread.unknown,
        offsets=measure_offsets(information, estimate),
    )


def fit_physical(
    structure: Structure, weighed: WeighedFit, cad_weight: float | None = None
) -> Physical:
    """Return the physically consistent robot that explains weighted rows best under a model.

    The weight of the robot file is chosen by predictions of left-out stretches, unless it is given.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    return _as_physical(structure, nearest_robot(structure, *weighed[:2], cad_weight))


def _as_physical(structure: Structure, found: PhysicalResult) -> Physical:
    """Return the physically consistent robot that a solver found.

    Raises
    ------
    IdentifiabilityError
        If it found none.
    """
    if found.nearest is None:
        raise IdentifiabilityError(found.sentence.strip())
    return Physical(structure, found.parameters(), found.cad_weight)


def real_robot(d: Diagnosis, structure: Structure, weight: float | None = None) -> Physical:
    """Return the physical robot of a diagnosis under the model without or with the named effects.

    A given weight pulls it to the robot file, the same for both models. If the file's values are
    kept, it has these values and those of the named effects.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    if len(d.known.precision):
        weight = share_weight(d.known.share) if d.known.share else weight
        if structure is not d.completed:
            fitted = fit_structure(structure, d.problem.regression(structure))
            return fit_physical(structure, fitted, weight)
        real = d.judged and d.judged.chosen.physical
        if weight is None and real:
            return _as_physical(structure, real)
        return fit_physical(structure, d.refit, weight)
    values = {name: d.robot.nominal.get(name, 0.0) for name in d.structure.columns}
    values = dict.fromkeys(structure.columns, 0.0) | values
    if structure is d.completed:
        first, known = len(d.structure.columns), np.zeros(len(structure.columns))
        known[:first] = d.structure.nominal
        more = np.linalg.pinv(structure.G[:, first:]) @ (d.values - structure.G @ known)
        for name, value in zip(structure.columns[first:], more.tolist(), strict=True):
            values[name] += value
    return Physical(structure, values)


def nearest_dict(d: Diagnosis) -> Json:
    """Return the physical robot with the named effects, with its errors on the fitted logs."""
    structure, known = d.completed, None if d.forward is None else d.forward.nearest
    try:
        real = real_robot(d, structure) if known is None else known
    except IdentifiabilityError as error:
        return {**real_robot_dict(structure, {}), "reason": str(error)}
    values = _fold(real.values)
    return real_robot_dict(structure, values, samples=d.samples, cad_weight=real.cad_weight)


def _fold(values: NumberByName) -> dict[str, float]:
    """Return values in which no joint has a common Coulomb level and separate ones."""
    out = dict(values)
    for name in [n for n in values if n.endswith(".Fc") and f"{n}+" in values]:
        level = out.pop(name)
        for way in (f"{name}+", f"{name}-"):
            out[way] = out.get(way, 0.0) + level
    return out
