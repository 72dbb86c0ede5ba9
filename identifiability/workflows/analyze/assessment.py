"""What is judged: models are fitted, set beside real robots, judged, and one is selected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np
import scipy

from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import (
    Estimate,
    Estimator,
    dependence,
    forbidden_signs,
    leave_open,
)
from identifiability.estimation.evidence import Evidence, Folds, HeldOut, Score, near_best
from identifiability.estimation.fit import Fit, find_left_out
from identifiability.estimation.groups import Alternatives
from identifiability.estimation.noise import Noise
from identifiability.estimation.prediction import Prediction, Task, widening
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, Flag, Verdict, judge, narrow, withdraw
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import WEAK, WEIGHTS, combine_with_file
from identifiability.physical.feasibility import (
    PhysicalResult,
    certify_model,
    choose_prior,
    find_nearest,
    leave_undecided,
)
from identifiability.physical.fitted_model import FittedModel, LeastSquares
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure

# Models are fitted, and the real robot nearest to each is sought.


@frozen
class Settled:
    """A fitted model with the nearest real robot, and what both predict in turns.

    Attributes
    ----------
    model : FittedModel
    robot : PhysicalResult
    free, real : Score or None
        Of the estimated values and of the nearest real robot, on folds; None where there are none.
    crossed : (F, b, 2)
        Base parameters of both, found from each fold's rest.
    """

    model: FittedModel
    robot: PhysicalResult
    free: Score | None
    real: Score | None
    crossed: Array

    @property
    def values(self) -> Array:
        """Base parameters (b, 4): as estimated, and of the nearest real robot.

        Then what a robot file holds of the latter: of its own format, and of the other.
        """
        free = self.model.submodel.expand(self.model.estimate.value)
        return np.column_stack([free, self.robot.base, *self.robot.in_files])

    @property
    def turned(self) -> Array:
        """The same found from each fold's rest, (F, b, 4); files lack as much as of the whole."""
        lacking = self.values[:, 2:] - self.values[:, 1:2]
        return np.concatenate([self.crossed, self.crossed[:, :, 1:] + lacking], axis=2)


@frozen
class FittedLadder:
    """Models that were fitted, with the nearest real robot of each.

    Attributes
    ----------
    settled : tuple of Settled
    folds : Folds or None
        None where nothing was fitted.
    near : (m,) bool
        Which models may stand for the one that predicts the folds best; none where nothing was
        fitted.
    judged : tuple of Evidence
        Of each model against that one; empty where nothing was fitted.
    short : str
        That predictions choose nothing, and why; empty where they do.
    """

    settled: tuple[Settled, ...]
    folds: Folds | None
    near: np.ndarray
    judged: tuple[Evidence, ...] = ()
    short: str = ""

    @property
    def values(self) -> Array:
        """Base parameters (b, 4m) of them, as `Settled.values` has them one by one."""
        return np.concatenate([one.values for one in self.settled], axis=1)

    def in_turns(self) -> Task:
        """Return how stretches (or logs) are predicted by models fitted to the others."""
        assert self.folds is not None
        values = np.concatenate([one.turned for one in self.settled], axis=2)
        return Task(values, self.folds)


def fit_ladder(
    structure: Structure,
    submodels: Sequence[Submodel],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None,
    silence: str,
) -> FittedLadder:
    """Fit models, and say what physics says of each.

    With `silence`, which says why there is nothing to explain, nothing is fitted.

    Parameters
    ----------
    cad_weight : float or None
        Of the prior around the robot file; by default predictions choose it (`choose_prior`).
    """
    if silence:
        none, open_ = np.empty((0, information.size, 2)), []
        for submodel in submodels:
            part = submodel.reduce(information)
            what = structure, submodel, information, part, leave_open(part, estimator)
            robot = leave_undecided(structure, submodel, silence)
            open_.append(Settled(FittedModel(*what), robot, None, None, none))
        return FittedLadder(tuple(open_), None, np.zeros(len(submodels), bool))
    held_out, short = hold_folds(information, estimator)
    found: list[Settled] = []
    scores: list[Score] = []
    for submodel in submodels:  # a smaller one asks for no heavier prior than the unpruned
        model = FittedModel.of(structure, submodel, information, estimator)
        heaviest = found[0].robot.cad_weight if found else np.inf
        one = settle_robot(model, held_out, cad_weight, heaviest, choose=not short)
        certificate, said = certify_model(model)
        said += one.robot.sentence
        robot = replace(one.robot, certificate=certificate, sentence=said)
        found.append(replace(one, robot=robot))
        assert one.free is not None
        scores.append(one.free)
    best = max(scores, key=lambda score: float(score.density.sum()))
    judged = tuple(Evidence.of(score, best) for score in scores)
    return FittedLadder(tuple(found), held_out.folds, near_best(scores), judged, short)


def hold_folds(information: Information, estimator: Estimator) -> tuple[HeldOut, str]:
    """Return folds of the fitted logs; those of logs too short for a choice, and why they are."""
    fit = estimator.fit(information)
    noise = Noise.of(fit.variance, fit.times)
    try:
        return HeldOut.of(information, noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return HeldOut.of(information, noise, Folds.short(information)), short


def settle_robot(
    model: FittedModel,
    held_out: HeldOut,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
) -> Settled:
    """Return the nearest real robot of a model, and what both predict in turns.

    Parameters
    ----------
    model : FittedModel
    held_out : HeldOut
        Folds of what was fitted.
    cad_weight : float or None
        As in `fit_ladder`.
    heaviest : float
        Weight that is tried.
    choose : bool
        Whether folds may choose; else the prior is weak, unless it is given.
    """
    submodel, fit = model.submodel, model.estimate
    free = held_out.refit(fit, submodel.M, submodel.fixed)
    score = held_out.score(free)
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held_out, score, tried)
    values = np.full(free.shape, np.nan) if chosen is None else chosen.values
    if weight is None:
        weight = WEAK if chosen is None else chosen.weight
    nearest = find_nearest(model, weight)
    if chosen is not None and choose:
        nearest = replace(nearest, as_good=chosen.as_good)
    real = None if chosen is None else chosen.score
    return Settled(model, nearest, score, real, np.stack([free, values], 2))


# What is judged of each.


#: Keys of models that answer for one release; null in JSON.
GONE = (
    *("error_joints", "error_joints_validation", "error_joints_validation_se"),
    *("worse_at", "physical_margin"),
)


@frozen(kw_only=True)
class ModelResult:
    """A model that was fitted and judged.

    Its errors are those of the values to use (`recommended`): what is said, written and predicted
    with is the same.

    Attributes
    ----------
    submodel : Submodel
    estimate : Estimate
    fit : Fit
        The estimate with what is not known of it, term by term.
    verdicts : tuple of Verdict
    infeasible : tuple of str
        Parameters with a sign that physics forbids, the paper's test.
    physical : PhysicalResult or None
        Whether a real robot has these parameters, and the nearest that has; None of a model of a
        path that is not to be used.
    fitted, unseen : Prediction
        Of torque along the fitted logs and along unseen motion: by the estimate, and, where it was
        asked for, by the nearest real robot and by what robot files hold of it alone, one of the
        robot's own format and one of the other.
    spread : float
        Relative standard error of the difference of its error on folds to the best model's.
    """

    submodel: Submodel
    estimate: Estimate
    fit: Fit
    verdicts: tuple[Verdict, ...]
    infeasible: tuple[str, ...]
    physical: PhysicalResult | None
    fitted: Prediction
    unseen: Prediction
    spread: float

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.submodel.name

    @cached_property
    def real(self) -> Submodel | None:
        """The model as the nearest real robot has it, if its values are those to use.

        They are unless the estimate is surely better on folds and unseen motion does not refute
        that, by more than its standard error: one motion does not tell what extrapolates. What its
        bodies cannot do without although the model leaves it out is held. None where they cannot
        have alike what the model ties.
        """
        real, M = self.physical, self.submodel.M
        if real is None or not (real.as_good or self.unseen.surely_better(1, 0)):
            return None
        apart = real.base - M @ real.value
        fixed = np.where(M.any(axis=1), self.submodel.fixed, apart)
        reach = NEARLY * np.abs(real.base).max(initial=0.0)
        return replace(self.submodel, fixed=fixed) if np.abs(apart - fixed).max() <= reach else None

    @property
    def physical_used(self) -> bool:
        """Whether the values to use are those of the nearest real robot."""
        return self.real is not None

    @property
    def recommended(self) -> Array:
        """Values to predict with, (k,): physically consistent ones where they are as good."""
        real = self.physical
        return real.value if real is not None and self.physical_used else self.estimate.value

    @cached_property
    def used(self) -> tuple[Prediction, Prediction]:
        """By the values to use alone: along the fitted logs, and along unseen motion."""
        at = [int(self.physical_used)]
        return self.fitted.select(at), self.unseen.select(at)

    @property
    def error_ra(self) -> float:
        """ε_RA of the values to use, on the logs that were fitted."""
        return float(self.fitted.relative_error()[int(self.physical_used)])

    @property
    def error_ra_validation(self) -> float:
        """The same on unseen motion."""
        return float(self.unseen.relative_error()[int(self.physical_used)])

    def unseen_by(self, which: int) -> float:
        """Return ε_RA on unseen motion of the estimate (0), the real robot (1), files (2, 3)."""
        every = self.unseen.relative_error()
        return float(every[which]) if which < len(every) else float("nan")

    @property
    def error_se(self) -> float:
        """Standard error of the difference of its unseen ε_RA to the best model's."""
        return self.spread * self.error_ra_validation

    @property
    def signs_possible(self) -> bool:
        """Whether no parameter has a sign that physics forbids, the paper's test."""
        return not self.infeasible

    @property
    def feasible(self) -> bool:
        """Whether a real robot has these parameters: bodies with mass, friction that brakes."""
        return self.signs_possible and (self.physical is None or self.physical.feasible)

    @property
    def paper_identified(self) -> int:
        """How many parameters pass the 10× rule."""
        return int(self.estimate.paper_rule.sum())

    @property
    def contradicted(self) -> str:
        """What has for certain a sign that physics forbids, for after "because", if any has."""
        sure = [v for v in self.verdicts if Flag.IN_DOUBT in v.flags and v.interval95[1] < 0]
        wrong = [v.name for v in sure if v.name in self.infeasible]
        return f"{listing(wrong, 4)} would have a sign that physics forbids" if wrong else ""

    @property
    def unjudged(self) -> str:
        """Why none of its parameters is judged; nothing if some are."""
        reasons = [v.reason for v in self.verdicts if Flag.NOT_JUDGED in v.flags]
        return reasons[0] if reasons and len(reasons) >= self.estimate.determined.sum() else ""

    def count(self, kind: Class | Flag) -> int:
        """Return how many parameters got a verdict, or a flag."""
        return sum(kind in (v.verdict, *v.flags) for v in self.verdicts)

    def withdraw(self, why: str) -> Self:
        """Return the model with no parameter believed, for one reason."""
        return replace(self, verdicts=withdraw(self.verdicts, why))

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        return {
            "name": self.name,
            "description": self.submodel.description,
            "parameters": len(self.submodel),
            "paper_identified": self.paper_identified,
            "identifiable": self.count(Class.IDENTIFIABLE),
            "not_judged": self.count(Flag.NOT_JUDGED),
            "error_ra": self.error_ra,
            "error_ra_validation": self.error_ra_validation,
            "error_ra_validation_se": self.error_se,
            "error_ra_free": self.unseen_by(0),
            "error_ra_physical": self.unseen_by(1),
            "infeasible": list(self.infeasible),
            "feasible": self.feasible,
            "signs_possible": self.signs_possible,
            "condition": self.estimate.condition,
            **dict.fromkeys(GONE),
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return its parameters as rows: verdicts, and the values that are used of them."""
        pairs = zip(self.verdicts, self.recommended.tolist(), self.meanings, strict=True)
        return [{**v.to_row(), "used": x, "used_stands_for": text} for v, x, text in pairs]

    @property
    def meanings(self) -> tuple[str, ...]:
        """What each value to use stands for, where it surely is not what the name says; else "".

        A reduced model's parameters take over some of what it leaves out, and of what is missing
        beside all base parameters: its values are such combinations, and labels are not.
        """
        beside = self.fit.alternatives
        told = []
        for k, (v, value) in enumerate(zip(self.verdicts, self.recommended, strict=True)):
            text = v.stands_for
            if beside is not None and beside.named[k]:
                text = f"{text or v.name} and a share of {beside.names[k]}"
            far = abs(value - v.value) > REACH * v.sigma_robust
            told.append(text if far and self.estimate.determined[k] else "")
        return tuple(told)


def assess_ladder(
    settled: Sequence[Settled],
    fitted: Prediction,
    unseen: Prediction,
    thresholds: Thresholds,
    rng: np.random.Generator,
    replicates: int,
    missing: Alternatives,
    late: Callable[[Submodel], Mapping[str, Array]] | None = None,
    judged: Sequence[Evidence] = (),
) -> tuple[ModelResult, ...]:
    """Return the results of all m models.

    Parameters
    ----------
    settled : sequence of Settled
    fitted, unseen : Prediction
        By the four accounts of each (`Settled.values`), on the logs that were fitted and on others.
    thresholds : Thresholds
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap.
    missing : Alternatives
        What may be missing beside all base parameters.
    late : callable(Submodel), optional
        What errors that all samples share do to the values of a model, by name.
    judged : sequence of Evidence, optional
        Of each model against the best, on folds.
    """
    torque, results = float(np.sqrt(np.mean(fitted.rms**2))), []
    first = settled[0].model
    full = fit_whole(first.estimate.estimator, first.whole) if first.estimate.kept else None
    for k, one in enumerate(settled):
        model, real = one.model, one.robot
        own = Fit.of(model.information, model.estimate, rng, replicates)
        own = complete_fit(model, own, full, missing, late, real)
        at = range(4 * k, 4 * k + 4)
        result = ModelResult(
            submodel=model.submodel,
            estimate=model.estimate,
            fit=own,
            verdicts=decide_model(model, own, torque, thresholds),
            infeasible=impossible_signs(model),
            physical=real,
            fitted=fitted.select(at),
            unseen=unseen.select(at),
            spread=judged[k].error.se if judged else float("nan"),
        )
        results.append(result)
    return tuple(results)


def complete_fit(
    model: FittedModel,
    fit: Fit,
    full: Estimate | None,
    missing: Alternatives,
    late: Callable[[Submodel], Mapping[str, Array]] | None = None,
    real: PhysicalResult | None = None,
) -> Fit:
    """Return a fit with what moves all samples alike, and what its model leaves out.

    Parameters
    ----------
    model : FittedModel
    fit : Fit
        What noise and logs leave open.
    full : Estimate or None
        Of all base parameters.
    missing : Alternatives
        What may be missing beside these.
    late : callable(Submodel), optional
        As of `assess_ladder`.
    real : PhysicalResult, optional
        The nearest real robot: it may be right, too, where it predicts as well.
    """
    shared, estimate = dict(fit.shared), model.estimate
    if late is not None:
        shared |= late(model.submodel)
    if real is not None and real.as_good and real.nearest is not None:
        apart = model.to_x @ real.nearest.phi - estimate.value
        shared["prior"] = np.where(estimate.determined, apart, 0.0)[None]
    return replace(
        fit,
        shared=shared,
        left_out=find_left_out(model.structure, model.submodel, model.whole, estimate, full),
        alternatives=missing.of_labels(model.submodel, estimate),
    )


def decide_model(
    model: FittedModel, fit: Fit, torque: float, thresholds: Thresholds
) -> tuple[Verdict, ...]:
    """Return the verdicts on a model.

    Parameters
    ----------
    model : FittedModel
    fit : Fit
    torque : float [N·m or N]
        Root mean square of the measured torque.
    thresholds : Thresholds
    """
    submodel, part = model.submodel, model.information
    apart = model.structure.nominal_base - submodel.fixed
    stated = np.linalg.lstsq(submodel.M, apart, rcond=None)[0]
    aliases = _aliases(part, model.estimate, submodel)
    forbidden = forbidden_signs(part, model.estimate, submodel.nonnegative)
    about = submodel.labels, submodel.units, torque, aliases, forbidden, stated
    return judge(fit, *about, thresholds)


Judged = TypeVar("Judged", bound=ModelResult)


def tell_with_file(
    model: FittedModel, result: Judged, share: float, thresholds: Thresholds
) -> tuple[Judged, str]:
    """Return a result whose verdicts say what the file's bodies add, and what logs say of these.

    What logs determine stays; what they leave open may be narrowed by bodies within a share of the
    file's.

    Parameters
    ----------
    model : FittedModel
    result : ModelResult
    share : float
        0 for none.
    thresholds : Thresholds
    """
    robot, fit = model.structure.robot, model.estimate
    if not (share or robot.prior or robot.said.prior_share) or not fit.kept:
        return result, ""
    data = LeastSquares.likelihood(model.information, fit)
    noise = max(widening(model.information, fit, result.fit), 1.0) * data.variance
    # What all samples share lies along directions of its own; the rest is noise of every row.
    along = data.R @ result.fit.together.T
    L = np.linalg.cholesky(noise * np.eye(len(data.R)) + along @ along.T)
    rows, aim = (scipy.linalg.solve_triangular(L, x, lower=True) for x in (data.R, data.z))
    outside, rest = (x / np.sqrt(noise) for x in model.left_out)
    A, b = np.vstack([rows @ model.to_x, outside]), np.concatenate([aim, rest])
    try:
        both = combine_with_file(model.structure, A, b, model.to_x, share)
    except ValueError:  # bodies that no prior can be around are said elsewhere
        return result, ""
    verdicts = list(result.verdicts)
    for k, (v, mean, sd) in enumerate(zip(verdicts, both.mean, both.sd, strict=True)):
        if not (v.open and sd**2 < thresholds.constraint_variance * v.sigma_robust**2):
            continue
        low, high = float(mean - REACH * sd), float(mean + REACH * sd)
        text = (
            f"Who believes {both.words} is left with {low:.3g} … {high:.3g} (95 %); the file "
            "narrows it, not the log."
        )
        verdicts[k] = narrow(v, Flag.BY_PRIOR, text, (low, high))
    return replace(result, verdicts=tuple(verdicts)), both.hint


def impossible_signs(model: FittedModel) -> tuple[str, ...]:
    """Return the parameters with a sign that physics forbids, the paper's test."""
    submodel = model.submodel
    forbidden = forbidden_signs(model.information, model.estimate, submodel.nonnegative)
    return tuple(c for c, bad in zip(submodel.columns, forbidden, strict=True) if bad)


def _aliases(information: Information, fit: Estimate, submodel: Submodel) -> tuple[str, ...]:
    """Return, for each undetermined parameter, what this motion cannot tell it from."""
    out = [""] * len(submodel)
    dropped = [c for c in range(len(submodel)) if c not in set(fit.kept)]
    leans = dependence(information, fit.kept, fit.weights)
    for k in np.flatnonzero(~fit.determined):
        own, rest = (fit.kept, dropped) if k in fit.kept else (dropped, fit.kept)
        at = own.index(int(k))
        row = np.abs(leans[at] if k in fit.kept else leans[:, at])
        others = [submodel.columns[rest[i]] for i in np.argsort(-row)]
        count = int((row > NEARLY).sum())
        out[k] = (
            f"This motion determines only its combination with {listing(others[:count], 4)}."
            if count
            else "This motion never makes it act on the torque."
        )
    return tuple(out)


def select_model(results: Sequence[ModelResult], near: np.ndarray) -> int:
    """Return the smallest of the models that may stand for the best, possible ones first.

    Folds of the fitted logs choose (`evidence.near_best`); logs that are held out do not.

    Of those that they leave, models come last of which the data call something identifiable that
    physics forbids, and models that a real robot can have first, then those without forbidden
    signs.

    Parameters
    ----------
    results : sequence of m ModelResult
    near : (m,) bool
    """
    error = np.array([r.error_ra_validation for r in results])
    if not np.isfinite(error).any():
        return len(results) - 1
    good = np.flatnonzero(near) if near.any() else np.arange(len(results))

    def rank(k: int) -> tuple[bool, bool, bool, int, float]:
        r = results[k]
        impossible = bool(r.contradicted), not r.feasible, not r.signs_possible
        return *impossible, len(r.submodel), float(error[k])

    return min(good.tolist(), key=rank)
