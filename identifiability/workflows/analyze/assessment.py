"""Assess the models of a ladder: uncertainty, verdicts, errors, feasibility; select one.

`Laddered` is what analyze and prune answer alike about the model to use.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd
import scipy

from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import Estimate, dependence, settle_signs
from identifiability.estimation.evidence import Evidence, Level
from identifiability.estimation.fit import Fit, find_left_out
from identifiability.estimation.groups import NO_ALTERNATIVES, Alternatives
from identifiability.estimation.prediction import (
    Prediction,
    measure_errors,
    measure_spread,
    widening,
)
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, Verdict, judge_model, withdraw
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.linalg import NEARLY, ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH, percent
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import exact
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.physical.cad_prior import (
    combine_with_file,
    real_robot_dict,
    state_mass,
    state_masses,
)
from identifiability.physical.feasibility import PhysicalResult
from identifiability.physical.fitted_model import FittedModel, LeastSquares
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderSource, Submodel
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows import predict
from identifiability.workflows.answers import state_joints
from identifiability.workflows.opening import state_provenance
from identifiability.workflows.predict import Predicts, settled
from identifiability.workflows.session import Opening

if TYPE_CHECKING:
    import pandas as pd

    from identifiability.estimation.rollouts import Rollouts
    from identifiability.workflows.commanded import Moved


# Assess the models of a ladder: uncertainty, verdicts, errors, feasibility; select one.


@frozen(kw_only=True)
class JudgedModel:
    """A model that was fitted and judged.

    Attributes
    ----------
    submodel : Submodel
    estimate : Estimate
    verdicts : tuple of Verdict
        Of terms with their shares of functions that were learned.
    error_ra : float
        ε_RA on the logs it was fitted to.
    error_ra_validation : float
        ε_RA on the validation logs.
    spread : float
        Relative standard error of the difference of its error on folds to the best model's.
    infeasible : tuple of str
        Parameters with a sign that physics forbids, the paper's test.
    """

    submodel: Submodel
    estimate: Estimate
    verdicts: tuple[Verdict, ...]
    error_ra: float
    error_ra_validation: float
    spread: float
    infeasible: tuple[str, ...]

    @property
    def error_se(self) -> float:
        """Standard error of the difference of its unseen ε_RA to the best model's."""
        return self.spread * self.error_ra_validation

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.submodel.name

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
            "parameters": len(self.submodel),
            "paper_identified": self.paper_identified,
            "identifiable": self.count(Class.IDENTIFIABLE),
            "not_judged": self.count(Class.NOT_JUDGED),
            "error_ra": self.error_ra,
            "error_ra_validation": self.error_ra_validation,
            "infeasible": list(self.infeasible),
            "condition": self.estimate.condition,
        }


@frozen(kw_only=True)
class ModelResult(JudgedModel):
    """One model of the ladder, fitted; held out in turns where there are no validation logs.

    Attributes
    ----------
    error_joints, error_joints_validation : float
        Its two errors over each joint's own scale, by which models are chosen.
    fit : Fit
        The estimate with what is not known of it, term by term.
    worse_at : tuple of str
        Joints at which it surely errs more on folds than the best model does.
    error_ra_physical : float
        ε_RA of the nearest real robot, on the same samples as `error_ra_validation`.
    error_ra_real, error_ra_file, error_ra_other : float
        ε_RA of the nearest real robot on the logs that were fitted, and of what a robot file
        holds of it without a sidecar: one of the robot's own format, and one of the other.
    error_real_joints : (n, 3)
        Errors of the same three, of each joint over its own scale.
    physical : PhysicalResult
        Whether a real robot has these parameters, and the nearest that has.
    """

    error_joints: float
    error_joints_validation: float
    fit: Fit
    worse_at: tuple[str, ...]
    error_ra_physical: float
    error_ra_real: float
    error_ra_file: float
    error_ra_other: float
    error_real_joints: Array
    physical: PhysicalResult

    @property
    def physical_used(self) -> bool:
        """Whether the values to use are those of the nearest real robot.

        They are where no real robot has the estimated ones and it predicts as well, if the model's
        parameters say all of it.
        """
        if self.feasible or not self.physical.as_good:
            return False
        base = self.physical.base
        reach = ROUNDOFF * np.abs(base).max(initial=0.0)
        return bool(np.abs(self.submodel.expand(self.physical.value) - base).max() <= reach)

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
        return self.estimate.times

    @property
    def margin(self) -> float:
        """Margin of the physical certificate; negative when no real robot has the parameters."""
        return self.physical.margin

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        return super().row() | {
            "error_joints": self.error_joints,
            "error_joints_validation": self.error_joints_validation,
            "description": self.submodel.description,
            "error_ra_validation_se": self.error_se,
            "error_joints_validation_se": self.spread * self.error_joints_validation,
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
    missing: Alternatives = NO_ALTERNATIVES,
    *,
    late: Callable[[Submodel], Mapping[str, Array]] | None = None,
    judged: Sequence[Evidence] = (),
) -> tuple[ModelResult, ...]:
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
    missing : Alternatives, optional
        What may be missing beside all base parameters.
    late : callable(Submodel), optional
        What errors that all samples share do to the values of a model, by name.
    judged : sequence of Evidence, optional
        Of each model against the best, on folds.
    """
    m = len(models)
    error, unseen_error = fitted.relative_error(), held_out.relative_error()
    each = fitted.joint_error()
    joints, unseen_joints = fitted.error_over_joints(), held_out.error_over_joints()
    torque = float(np.sqrt(np.mean(fitted.rms**2)))
    results = []
    spoken = bool(models) and bool(models[0].estimate.kept)
    full = fit_whole(models[0].estimate.estimator, models[0].whole) if spoken else None
    for k, (model, real) in enumerate(zip(models, physical, strict=True)):
        submodel, reduced, fit = model.submodel, model.information, model.estimate
        found = complete_fit(
            model, Fit.of(reduced, fit, rng, replicates), full, missing, late, real
        )
        result = ModelResult(
            submodel=submodel,
            estimate=fit,
            fit=found,
            verdicts=decide_model(model, found, torque, thresholds),
            error_ra=float(error[k]),
            error_ra_validation=float(unseen_error[k]),
            error_joints=float(joints[k]),
            error_joints_validation=float(unseen_joints[k]),
            spread=judged[k].error.se if judged else float("nan"),
            worse_at=_worse_at(model, judged[k]) if judged else (),
            error_ra_physical=float(unseen_error[m + k]),
            error_ra_real=float(error[m + k]),
            error_ra_file=float(error[2 * m + k]),
            error_ra_other=float(error[3 * m + k]),
            error_real_joints=each[:, [m + k, 2 * m + k, 3 * m + k]],
            infeasible=forbidden_signs(model),
            physical=real,
        )
        results.append(result)
    return tuple(results)


def _worse_at(model: FittedModel, judged: Evidence) -> tuple[str, ...]:
    levels = zip(model.structure.robot.joints, judged.joint_levels, strict=True)
    return tuple(joint for joint, level in levels if level is Level.WORSE)


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
    return judge_model(submodel, part, fit, torque, aliases, thresholds, stated)


def tell_with_file(
    models: Sequence[FittedModel],
    results: Sequence[ModelResult],
    share: float,
    thresholds: Thresholds,
) -> tuple[tuple[ModelResult, ...], tuple[str, ...]]:
    """Return models whose verdicts say what the file's bodies add, and what logs say of these.

    What logs determine stays; what they leave open may be narrowed by bodies within a share of the
    file's.

    Parameters
    ----------
    models : sequence of FittedModel
    results : sequence of ModelResult
        Of each model.
    share : float
        0 for none.
    thresholds : Thresholds
    """
    robot = models[0].structure.robot
    if not (share or robot.prior or robot.said.prior_share) or not models[0].estimate.kept:
        return tuple(results), ("",) * len(results)
    both = [_add_file(m, r, share, thresholds) for m, r in zip(models, results, strict=True)]
    reported, hints = zip(*both, strict=True)
    return reported, hints


def _add_file(
    model: FittedModel, result: ModelResult, share: float, thresholds: Thresholds
) -> tuple[ModelResult, str]:
    fit = model.estimate
    data = LeastSquares.likelihood(model.information, fit)
    own = np.linalg.pinv(data.R)
    variance = (own**2).sum(1) * data.variance
    # What all samples share lies along directions of its own; the rest is noise of every row.
    shared, wide = result.fit.together, result.fit.scatter**2
    sure = fit.determined & (variance > 0) & np.isfinite(wide)
    wider = max(float(np.mean(wide[sure] / variance[sure])) if sure.any() else 1.0, 1.0)
    along = data.R @ shared.T
    L = np.linalg.cholesky(wider * data.variance * np.eye(len(data.R)) + along @ along.T)
    rows, aim = (scipy.linalg.solve_triangular(L, x, lower=True) for x in (data.R, data.z))
    outside, rest = (x / np.sqrt(wider * data.variance) for x in model.left_out)
    try:
        both = combine_with_file(
            model.structure,
            np.vstack([rows @ model.to_x, outside]),
            np.concatenate([aim, rest]),
            model.to_x,
            share,
        )
    except ValueError:  # bodies that no prior can be around are said elsewhere
        return result, ""
    verdicts = []
    for v, mean, sd in zip(result.verdicts, both.mean, both.sd, strict=True):
        open_ = v.verdict in (Class.WEAK, Class.NOT_IDENTIFIABLE)
        if not open_ or not sd**2 < thresholds.constraint_variance * v.sigma_robust**2:
            verdicts.append(v)
            continue
        low, high = float(mean - REACH * sd), float(mean + REACH * sd)
        text = (
            f"Who believes {both.words} is left with {low:.3g} … {high:.3g} (95 %); the file "
            "narrows it, not the log."
        )
        verdicts.append(
            replace(v, verdict=Class.PRIOR, reason=f"{v.reason} {text}", believed=(low, high))
        )
    return replace(result, verdicts=tuple(verdicts)), both.hint


def forbidden_signs(model: FittedModel) -> tuple[str, ...]:
    """Return the parameters with a sign that physics forbids, the paper's test."""
    submodel, fit = model.submodel, model.estimate
    settled = settle_signs(model.information, fit, submodel.nonnegative)
    forbidden = submodel.nonnegative & fit.determined & (settled < 0)
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
    error = np.array([r.error_joints_validation for r in results])
    if not np.isfinite(error).any():
        return len(results) - 1
    good = np.flatnonzero(near) if near.any() else np.arange(len(results))

    def rank(k: int) -> tuple[bool, bool, bool, int, float]:
        r = results[k]
        impossible = bool(r.contradicted), not r.feasible, not r.signs_possible
        return *impossible, len(r.submodel), float(error[k])

    return min(good.tolist(), key=rank)


# Of one model what analyze and prune tell alike: its errors by joint and log.


#: What is told of a log, and more of a joint: in N or N·m, and of the torque as it was measured.
OF_LOG = ("error", "error_validation")
OF_JOINT = (
    *("rms", "rms_validation", "error_raw", "error_raw_validation"),
    *("rms_raw", "rms_raw_validation"),
)


def tell_errors(
    robot: Robot,
    samples: Sequence[Dataset],
    validation: Sequence[Dataset],
    fitted: Prediction,
    unseen: Prediction,
) -> pd.DataFrame:
    """Return one row a joint and a log: its error fitted and held out; NaN where it has none.

    Of a joint it is over the joint's own scale (`torque_errors.joint_errors`), and in N or N·m
    (`rms`), of the torque that was fitted, low-passed with the columns where these were; `raw` is
    the same prediction against the torque as it was measured at the same samples.

    Parameters
    ----------
    robot : Robot
    samples, validation : sequences of Dataset
        Logs that were fitted, and that were held out; without these the former were held out in
        turns.
    fitted, unseen : Prediction
        By the model alone, on the former and on what was held out.
    """
    both = (fitted, unseen)
    numbers = [p.joint_error()[:, 0] for p in both]
    for raw in (False, True):
        numbers += [p.joint_error(raw=True)[:, 0] for p in both] if raw else []
        numbers += [p.joint_rms(raw=raw)[:, 0] for p in both]
    each = zip(robot.joints, robot.torque_units, *map(np.ndarray.tolist, numbers), strict=True)
    rows = [("joint", *row) for row in each]
    blank = (np.nan,) * len(OF_JOINT)
    for k, s in enumerate(samples):
        crossed = np.nan if validation else float(unseen.relative_error(k)[0])
        rows.append(
            ("log", s.path or s.name, "", float(fitted.relative_error(k)[0]), crossed, *blank)
        )
    for k, s in enumerate(validation):
        error = float(unseen.relative_error(k)[0])
        rows.append(("log", s.path or s.name, "", np.nan, error, *blank))
    return pd.DataFrame(rows, columns=["of", "name", "unit", *OF_LOG, *OF_JOINT])


def errors_dict(errors: pd.DataFrame) -> dict[str, Any]:
    """Return the rows of `tell_errors` as plain values, those of joints and those of logs."""
    reported = {"joint": ["name", "unit", *OF_LOG, *OF_JOINT], "log": ["name", *OF_LOG]}
    return {
        f"{kind}s": part[reported[str(kind)]].rename(columns={"name": kind}).to_dict("records")
        for kind, part in errors.groupby("of")
    }


def state_raw(unseen: Prediction) -> str:
    """Return what torque the error is of, where it was low-passed; nothing where it was not.

    Parameters
    ----------
    unseen : Prediction
        By the model alone.
    """
    error, raw = unseen.relative_error()[0], unseen.relative_error(raw=True)[0]
    if not np.isfinite(raw) or np.isclose(error, raw, rtol=1e-6):
        return ""
    return (
        "This error is of torque that was low-passed like the model's columns; of the torque as "
        f"it was measured it is {percent(raw)}."
    )


# `Laddered`: what analyze and prune answer alike about the model to use of a ladder.


@frozen(kw_only=True)
class Laddered(Result, Opening, Predicts):
    """A ladder of models, of which one is to be used.

    Attributes
    ----------
    models : tuple of JudgedModel
        The unpruned one first.
    information : Information
        About the base parameters, on the fitted logs.
    selected : int
        The model to use.
    fitted, held_out : Prediction
        Torque predicted on the logs that were fitted, and on validation logs or, without any, on
        stretches (or logs) by models fitted to the others.
    method, seed
        As asked for.
    source : LadderSource or None
        Where the models came from.
    settings : mapping
        Other options that decided the numbers.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    missing : Alternatives
        What may be missing beside the unpruned model.
    moved : Moved or None
        How far rollouts of the nearest real robot are off, of logs of commands.
    late : (w, b)
        By how much base parameters move by errors that all samples of a log share.
    rolled : Rollouts or None
        On which torque of commands was calibrated: delays and their errors.
    """

    models: tuple[JudgedModel, ...]
    information: Information
    selected: int
    fitted: Prediction
    held_out: Prediction
    method: str
    seed: int
    source: LadderSource | None = None
    settings: Mapping[str, object]
    nothing: str = ""
    missing: Alternatives = NO_ALTERNATIVES
    moved: Moved | None = None
    late: Array
    rolled: Rollouts | None = None

    @property
    @abstractmethod
    def _used(self) -> ModelResult:
        """The model to use, with all that was asked of it."""

    @property
    def _alone(self) -> tuple[Prediction, Prediction]:
        """By the model to use alone: on what was fitted, and on what was held out."""
        return self.fitted, self.held_out

    @property
    def _asked(self) -> dict[str, object]:
        """Options beside `settings`."""
        return {"method": self.method}

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed, options, and hashes of the inputs."""
        logs, options = (*self.samples, *self.validation), {**self._asked, **self.settings}
        return state_provenance(self.robot, logs, self.seed, self.source, options)

    @cached_property
    def fit(self) -> predict.Fit:
        """The model to use: values, covariance, and how torque scatters about it.

        Raises
        ------
        IdentifiabilityError
            If no value is believed.
        """
        if self.nothing:
            raise IdentifiabilityError(
                f"Nothing can be predicted, because {self.nothing}; give other logs to fit."
            )
        own, unseen = ((p.joint_rms()[:, 0], p.joint_rms(raw=True)[:, 0]) for p in self._alone)
        used, whole = self._used, self.models[0]
        part = used.submodel.reduce(self.information)
        wider = widening(part, used.estimate, used.fit)
        M, unpruned = whole.submodel.M, whole.submodel.reduce(self.information)
        covariance, unknown = measure_errors(unpruned, whole.estimate, wider)
        return predict.Fit(
            structure=self.structure,
            submodel=used.submodel,
            values=used.recommended,
            spread=measure_spread(part, used.estimate, used.fit, own, unseen),
            preparation=settled(self.settings.get("preparation"), self.samples),
            base_covariance=M @ covariance @ M.T + self.late.T @ self.late,
            base_unknown=M @ unknown,
            errors=self.exported[1],
            missing=self.missing.functions,
        )

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        import pandas as pd  # noqa: PLC0415 - only who wants a table pays for it

        return pd.DataFrame([m.row() for m in self.models])

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the model to use by joint and by log, fitted and held out.

        Relative to how much the torque varies: that of the joint about its own mean (`rms` is in
        N or N·m, `raw` of the torque as it was measured, not low-passed), that of all joints of a
        log about the log's mean (ε_RA of the log by itself). NaN where a log took no part, or the
        torque does not vary.
        """
        return tell_errors(self.robot, self.samples, self.validation, *self._alone)

    @property
    def exported(self) -> tuple[tuple[str, ...], tuple[float, float]]:
        """Parameters of the model to use, and errors of all and of those that an MJCF holds."""
        real = self._real_robot
        return self._used.submodel.columns, (real["error_ra"], real["error_ra_files"]["mjcf"])

    @cached_property
    def _real_robot(self) -> dict[str, Any]:
        """The nearest real robot as plain values, as `export` reads them."""
        used, real = self._used, self._used.physical
        errors = used.error_ra_real, used.error_ra_file, used.error_ra_other
        return real_robot_dict(
            self.structure,
            real.parameters(),
            errors,
            used.error_real_joints,
            self.samples,
            real.cad_weight,
        )

    @property
    def mass_statement(self) -> str:
        """What the nearest real robot and its bodies weigh beside the robot file's, in a line."""
        return state_masses(self.robot, self._used.physical.parameters())

    @property
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        real = self._used.physical
        return "" if self.nothing else state_mass(self.robot, real.parameters(), real.cad_weight)

    def _state(self, answer: str) -> str:
        """Return an answer behind a wrong mass, with what its error is of and what is odd."""
        raw = each = ""
        if not self.nothing:
            unseen = self._alone[1]
            raw = state_raw(unseen)
            together = float(unseen.relative_error()[0])
            each = state_joints(self.robot.joints, unseen.joint_error()[:, 0], together)
        tilt = self.robot.tilt
        about = "" if tilt is None else f"In this model gravity {tilt.text}."
        moved = "" if self.moved is None else self.moved.statement
        weight = "" if self.nothing else state_weight(self.structure, self.models[0].verdicts)
        reported = (self.mass_warning, weight, answer, each, moved, about, raw, *self.hints)
        return " ".join(filter(None, reported))

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        used = self._used
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "statement": self.statement,
            "nothing": self.nothing or None,
            "models": [m.row() for m in self.models],
            "selected": self.models[self.selected].name,
            "errors": errors_dict(self.error_frame()),
            "parameters": [v.to_row() for v in used.verdicts],
            "full_parameters": [v.to_row() for v in self.models[0].verdicts],
            "fit": None if self.nothing else self.fit.to_dict(),
            "missing_functions": self.missing.to_list(),
            "physical": {
                "feasible": used.feasible,
                "margin": used.margin,
                "infeasible": list(used.infeasible),
                "error_ra_validation": used.error_ra_physical,
                "used": used.physical_used,
                "elsewhere": False,  # an older key
                **exact(self._real_robot, "parameters", "shapes", "gravity"),
            },
            **({} if self.moved is None else {"rollout": self.moved.to_dict()}),
            "hints": list(self.hints),
            "preparation": {
                s.path or s.name: list(s.notes) for s in (*self.samples, *self.validation)
            },
            "method": self.method,
            "estimator": used.estimate.estimator.name,
            "provenance": self.provenance,
        }


def state_weight(structure: Structure, verdicts: Sequence[Verdict]) -> str:
    """Return what a robot that floats weighs by its logs, beside its file; nothing of others.

    The mass of all its bodies is one of its base parameters: gravity acts on the whole of it. What
    its limbs weigh is said of the nearest real robot.
    """
    if structure.robot.base is None:
        return ""
    masses = np.array([p.kind == "m" for p in structure.parameters], float)
    names = [n for n, row in zip(structure.base.names, structure.G, strict=True)
             if np.allclose(row, masses, atol=1e-6)]  # fmt: skip
    known = [v for v in verdicts if v.name in names and np.isfinite(v.interval95).all()]
    if not known:
        return ""
    low, high = known[0].interval95
    stated = float(structure.nominal @ masses)
    return (
        f"{structure.robot.title} weighs {known[0].value:.4g} ± {(high - low) / 2:.2g} kg, "
        f"{stated:.4g} by its file."
    )
