"""Assess the models of a ladder: uncertainty, verdicts, errors, feasibility; select one."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np

from identifiability.estimation.decide import decide_rung
from identifiability.estimation.doubt import NO_DOUBT, Doubt
from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import NOTHING, Estimate, settle_signs
from identifiability.estimation.evidence import Mixture
from identifiability.estimation.least_squares import MIXED, dependence
from identifiability.estimation.omitted import find_left_out
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.uncertainty import Uncertainty, assess_uncertainty
from identifiability.estimation.verdict import Class, Thresholds, Verdict, withdraw
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.physical.feasibility import PhysicalResult
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung


@frozen(kw_only=True)
class JudgedModel:
    """A model that was fitted and judged.

    Attributes
    ----------
    rung : Rung
    estimate : Estimate
    verdicts : tuple of Verdict
        Of terms with their shares of functions that were learned.
    error_ra : float
        ε_RA on the logs it was fitted to.
    error_ra_validation : float
        ε_RA on the validation logs.
    error_se : float
        Standard error of the difference of its held-out ε_RA to another model's.
    error_joints, error_joints_validation, error_joints_se : float
        The same three of the error over each joint's own scale, by which models are chosen.
    infeasible : tuple of str
        Parameters with a sign that physics forbids, the paper's test.
    """

    rung: Rung
    estimate: Estimate
    verdicts: tuple[Verdict, ...]
    error_ra: float
    error_ra_validation: float
    error_se: float
    error_joints: float
    error_joints_validation: float
    error_joints_se: float
    infeasible: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.rung.name

    @property
    def signs_possible(self) -> bool:
        """Whether no parameter has a sign that physics forbids, the paper's test."""
        return not self.infeasible

    @property
    def paper_identified(self) -> int:
        """How many parameters pass the 10× rule."""
        return int(self.estimate.paper_rule.sum())

    @property
    def contradicted(self) -> str:
        """What has for certain a sign that physics forbids, for after "because", if any has."""
        sure = [v for v in self.verdicts if v.verdict is Class.IN_DOUBT and v.interval95[1] < 0]
        wrong = [v.name for v in sure if v.name in self.infeasible]
        return f"{listing(wrong, 4)} would have a sign that physics forbids" if wrong else ""

    @property
    def warning(self) -> str:
        """One sentence on what is surely impossible in it, or nothing."""
        if not self.contradicted:
            return ""
        return (
            f"{self.name} is not worth using as it stands: {self.contradicted}, and the logs are "
            "sure of it: look for what the model misses (diagnose), or for an axis or a torque "
            "with the wrong sign."
        )

    @property
    def unjudged(self) -> str:
        """Why none of its parameters is judged; nothing if some are."""
        whole = self.count(Class.NOT_JUDGED) >= self.estimate.determined.sum()
        return self.some_unjudged if whole else ""

    @property
    def some_unjudged(self) -> str:
        """Why some of its parameters are not judged, the first reason; nothing if all are."""
        return next((v.reason for v in self.verdicts if v.verdict is Class.NOT_JUDGED), "")

    def count(self, kind: Class) -> int:
        """Return how many parameters got a verdict."""
        return sum(v.verdict is kind for v in self.verdicts)

    def withdraw(self, why: str) -> Self:
        """Return the model with no parameter believed, for one reason."""
        return replace(self, verdicts=withdraw(self.verdicts, why))

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        return {
            "name": self.name,
            "parameters": len(self.rung),
            "paper_identified": self.paper_identified,
            "identifiable": self.count(Class.IDENTIFIABLE),
            "not_judged": self.count(Class.NOT_JUDGED),
            "error_ra": self.error_ra,
            "error_ra_validation": self.error_ra_validation,
            "error_joints": self.error_joints,
            "error_joints_validation": self.error_joints_validation,
            "infeasible": list(self.infeasible),
            "condition": self.estimate.condition,
        }


@frozen(kw_only=True)
class RungResult(JudgedModel):
    """One model of the ladder, fitted; held out in turns where there are no validation logs.

    Attributes
    ----------
    uncertainty : Uncertainty
    worse_at : tuple of str
        Joints at which it surely errs more on unseen motion than the best model does.
    error_ra_physical : float
        ε_RA of the nearest real robot, on the same samples as `error_ra_validation`.
    error_ra_real, error_ra_file, error_ra_other : float
        ε_RA of the nearest real robot on the logs that were fitted, and of what a robot file
        holds of it without a sidecar: one of the robot's own format, and one of the other.
    physical : PhysicalResult
        Whether a real robot has these parameters, and the nearest that has.
    physical_as_good : bool
        Whether the nearest real robot stands for the estimate: of stretches of the fitted logs it
        does not surely predict worse, and validation logs do not object.
    """

    uncertainty: Uncertainty
    worse_at: tuple[str, ...]
    error_ra_physical: float
    error_ra_real: float
    error_ra_file: float
    error_ra_other: float
    physical: PhysicalResult
    physical_as_good: bool = False

    @property
    def physical_used(self) -> bool:
        """Whether the values to use are those of the nearest real robot.

        They are where no real robot has the estimated ones and it predicts as well, if the model's
        parameters say all of it.
        """
        if self.feasible or not self.physical_as_good:
            return False
        base = self.physical.base
        reach = NOTHING * np.abs(base).max(initial=0.0)
        return bool(np.abs(self.rung.expand(self.physical.value) - base).max() <= reach)

    @property
    def recommended(self) -> Array:
        """Values to predict with, (k,): physically consistent ones where they are as good."""
        return self.physical.value if self.physical_used else self.estimate.value

    @property
    def feasible(self) -> bool:
        """Whether a real robot has these parameters: bodies with mass, friction that brakes."""
        return self.physical.feasible and self.signs_possible

    @property
    def possible(self) -> str:
        """Whether a real robot has these parameters, in a word."""
        if self.feasible:
            return "possible"
        open_ = self.physical.certificate is None and self.signs_possible
        return "open" if open_ else "impossible"

    @property
    def autocorrelation_time(self) -> Array:
        """Autocorrelation time of each actuator's residual, (n,) [samples]."""
        return self.uncertainty.times

    @property
    def margin(self) -> float:
        """Margin of the physical certificate; negative when no real robot has the parameters."""
        return self.physical.margin

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        return super().row() | {
            "description": self.rung.description,
            "error_ra_validation_se": self.error_se,
            "error_joints_validation_se": self.error_joints_se,
            "worse_at": list(self.worse_at),
            "feasible": self.feasible,
            "signs_possible": self.signs_possible,
            "physical_margin": self.margin,
            "error_ra_physical": self.error_ra_physical,
        }


def assess_ladder(
    models: Sequence[FittedModel],
    physical: Sequence[PhysicalResult],
    fitted: Prediction,
    held_out: Prediction,
    thresholds: Thresholds,
    rng: np.random.Generator,
    replicates: int,
    doubt: Doubt = NO_DOUBT,
) -> tuple[RungResult, ...]:
    """Return the results of all m models.

    Parameters
    ----------
    models : sequence of FittedModel
    physical : sequence of PhysicalResult
        Of each model.
    fitted, held_out : Prediction
        By all estimates, then by all nearest real robots, on the logs they were fitted to and on
        others; of the former also by what robot files hold of the latter.
    thresholds : Thresholds
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap.
    doubt : Doubt, optional
        Functions that are missing beside all base parameters.
    """
    m = len(models)
    error, held_error = fitted.relative_error(), held_out.relative_error()
    joints, held_joints = fitted.error_over_joints(), held_out.error_over_joints()
    best = int(np.nanargmin(held_joints[:m])) if np.isfinite(held_joints[:m]).any() else 0
    spread, joints_spread = (
        held_out.standard_error(best),
        held_out.standard_error_over_joints(best),
    )
    above = held_out.joints_above(best)
    torque = float(np.sqrt(np.mean(fitted.rms**2)))
    results = []
    spoken = bool(models) and bool(models[0].estimate.kept)
    full = fit_whole(models[0].estimate.estimator, models[0].whole) if spoken else None
    for k, (model, real) in enumerate(zip(models, physical, strict=True)):
        rung, reduced, fit = model.rung, model.information, model.estimate
        residual = fitted.residual[:, :, k]
        uncertainty = assess_uncertainty(reduced, fit, residual, fitted.series, rng, replicates)
        told, spread_told = model.told, uncertainty
        if told is not model:
            spread_told = assess_uncertainty(
                told.information, told.estimate, residual, fitted.series, rng, replicates
            )
        result = RungResult(
            rung=rung,
            estimate=fit,
            uncertainty=uncertainty,
            verdicts=decide_told(told, spread_told, torque, thresholds, full, doubt),
            error_ra=float(error[k]),
            error_ra_validation=float(held_error[k]),
            error_se=float(spread[k]),
            error_joints=float(joints[k]),
            error_joints_validation=float(held_joints[k]),
            error_joints_se=float(joints_spread[k]),
            worse_at=tuple(np.array(model.structure.robot.joints)[above[:, k]].tolist()),
            error_ra_physical=float(held_error[m + k]),
            error_ra_real=float(error[m + k]),
            error_ra_file=float(error[2 * m + k]),
            error_ra_other=float(error[3 * m + k]),
            infeasible=forbidden_signs(told.rung, told.information, told.estimate),
            physical=real,
            physical_as_good=stands_for(held_out, real, k, m + k),
        )
        results.append(result)
    return tuple(results)


def decide_told(
    told: FittedModel,
    uncertainty: Uncertainty,
    torque: float,
    thresholds: Thresholds,
    full: Estimate | None,
    doubt: Doubt,
    models: Mixture | None = None,
) -> tuple[Verdict, ...]:
    """Return the verdicts on a model as it is told (`FittedModel.told`).

    Parameters
    ----------
    told : FittedModel
    uncertainty : Uncertainty
    torque : float [N·m or N]
        Root mean square of the measured torque.
    thresholds : Thresholds
    full : Estimate or None
        Of all base parameters.
    doubt : Doubt
        Functions that are missing beside these.
    models : Mixture, optional
        What all models of a path say of its labels.
    """
    rung, part, fit = told.rung, told.information, told.estimate
    stated = np.linalg.lstsq(rung.M, told.structure.nominal_base - rung.held, rcond=None)[0]
    left_out = find_left_out(told.structure, rung, told.whole, fit, full)
    aliases = _aliases(part, fit, rung)
    own = doubt.of_labels(rung, fit)
    return decide_rung(
        rung, part, fit, uncertainty, torque, aliases, thresholds, stated, left_out, own, models
    )


def stands_for(held_out: Prediction, real: PhysicalResult, one: int, other: int) -> bool:
    """Return whether the nearest real robot stands for the estimate, unless unseen motion objects.

    Folds of the fitted logs choose, and what is held out has a veto: where one of the two surely
    errs more there, over all joints or at any, and the other does not, that one is used.
    """
    worse, better = (
        bool(held_out.joints_above(a)[:, b].any()) or _surely_above(held_out, a, b)
        for a, b in ((one, other), (other, one))
    )
    return real.as_good if worse == better else better


def _surely_above(held_out: Prediction, against: int, model: int) -> bool:
    rise = held_out.error_over_joints()[model] - held_out.error_over_joints()[against]
    return bool(rise > REACH * held_out.standard_error_over_joints(against)[model])


def forbidden_signs(rung: Rung, information: Information, fit: Estimate) -> tuple[str, ...]:
    """Return the parameters with a sign that physics forbids, the paper's test."""
    settled = settle_signs(information, fit, rung.nonnegative)
    forbidden = rung.nonnegative & fit.determined & (settled < 0)
    return tuple(c for c, bad in zip(rung.columns, forbidden, strict=True) if bad)


def _aliases(information: Information, fit: Estimate, rung: Rung) -> tuple[str, ...]:
    """Return, for each undetermined parameter, what this motion cannot tell it from."""
    out = [""] * len(rung)
    dropped = [c for c in range(len(rung)) if c not in set(fit.kept)]
    leans = dependence(information, fit.kept, fit.weights)
    for k in np.flatnonzero(~fit.determined):
        own, rest = (fit.kept, dropped) if k in fit.kept else (dropped, fit.kept)
        at = own.index(int(k))
        row = np.abs(leans[at] if k in fit.kept else leans[:, at])
        others = [rung.columns[rest[i]] for i in np.argsort(-row)]
        count = int((row > MIXED).sum())
        out[k] = (
            f"This motion determines only its combination with {listing(others[:count], 4)}."
            if count
            else "This motion never makes it act on the torque."
        )
    return tuple(out)


def select_model(results: Sequence[RungResult]) -> int:
    """Return the smallest model within one standard error of the best, and worse at no joint.

    Among those that predict as well as the best, models come last of which the data call something
    identifiable that physics forbids, and models that a real robot can have first, then those
    without forbidden signs.
    """
    error = np.array([r.error_joints_validation for r in results])
    if not np.isfinite(error).any():
        return len(results) - 1
    best = float(np.nanmin(error))
    slack = [best + np.nan_to_num(r.error_joints_se) for r in results]
    good = [k for k, r in enumerate(results) if error[k] <= slack[k] and not r.worse_at]

    def rank(k: int) -> tuple[bool, bool, bool, int, float]:
        r = results[k]
        impossible = bool(r.contradicted), not r.feasible, not r.signs_possible
        return *impossible, len(r.rung), float(error[k])

    return min(good, key=rank)
