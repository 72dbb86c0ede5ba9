"""`Prediction`: torque predicted along logs in one pass, and its error.

`TorqueUncertainty` bounds its distance from the truth and from a sample.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from identifiability.foundation.linalg import NEARLY, or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import ENDS, REACH
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import find_signal
from identifiability.logs.signals import is_constant
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression

from .estimator import Estimate
from .evidence import LEVELS, Folds
from .fit import Fit, remembering_covariance

# `TorqueUncertainty`: how far predicted torque may lie from the truth and from a sample.
#
# Two intervals. That of the *mean* holds the torque of the model with its true values: the
# uncertainty of the parameters. That of a *new sample* adds the scatter of measured torque about
# it, which longer logs do not reduce. Residuals remember: with an autocorrelation time κ, N samples
# count as N/κ for both, so that the fit swallows κ times more of the noise than of white noise.


@frozen(kw_only=True)
class TorqueUncertainty:
    """Uncertainty of predicted torque.

    Attributes
    ----------
    covariance : (k, k)
        Of the values, with what the noise remembers; zero for columns that were not fitted.
    unknown : (k, d)
        Directions that the fitted motion does not determine, scaled by the size of their columns.
    low, raw : (n,) [N·m or N]
        Standard deviation of low-passed and of measured torque about the prediction.
    dof : (n,)
        Independent samples that these were estimated from.
    """

    covariance: Array
    unknown: Array
    low: Array
    raw: Array
    dof: Array

    def reach(self, W: Array) -> tuple[Array, Array, Array]:
        """Return half widths of 95 % intervals of the mean, a low-passed and a raw sample, (N, n).

        Infinite where the motion excites directions that the fitted motion never showed.

        Parameters
        ----------
        W : (N, n, k)
        """
        variance = np.maximum(np.einsum("anj,jk,ank->an", W, self.covariance, W), 0.0)
        # A direction that the fitted motion never showed acts above this share of the torque of its
        # columns there.
        endless = np.abs(W @ self.unknown) > 1e-5
        variance[endless.any(2)] = np.inf
        few = stdtrit(self.dof, ENDS[1])
        deviations = (self.low, self.raw)
        low, raw = (few * np.sqrt(variance + sd**2) for sd in deviations)
        return REACH * np.sqrt(variance), low, raw


def measure_spread(
    information: Information, known: Fit, rms: tuple[Array, Array], unseen: tuple[Array, Array]
) -> TorqueUncertainty:
    """Return the uncertainty of the torque that a fit predicts.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    known : Fit
        Of their values.
    rms, unseen : ((n,), (n,)) [N·m or N]
        Root mean square of the error of low-passed and of raw torque on the fitted and on unseen
        motion; the latter NaN where there is none. The larger one counts: what the model misses is
        seen on unseen motion only.
    """
    fit = known.estimate
    n = information.actuators
    independent = information.rows_each / fit.times
    dof = np.maximum(independent - len(fit.kept) / n, 1.0)
    swallowed = np.sqrt(independent / dof)
    pairs = zip(rms, unseen, strict=True)
    low, raw = (np.fmax(own * swallowed, other) for own, other in pairs)
    covariance, unknown = measure_errors(information, fit, widening(information, known))
    covariance = covariance + known.together.T @ known.together
    return TorqueUncertainty(covariance=covariance, unknown=unknown, low=low, raw=raw, dof=dof)


def measure_errors(information: Information, fit: Estimate, wider: float) -> tuple[Array, Array]:
    """Return the covariance (k, k) of the values of a fit, and its unseen directions, (k, d).

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    wider : float
        Factor of variance, such as that of `widening`.
    """
    kept = list(fit.kept)
    covariance = np.zeros((information.size, information.size))
    if kept:
        covariance[np.ix_(kept, kept)] = wider * remembering_covariance(information, fit)
    return covariance, _never_shown(information, fit)


def measure_offsets(information: Information, fit: Estimate) -> Array:
    """Return the changes (k, n) of the values of a fit by a torque offset of 1 N·m or N per joint.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    kept = list(fit.kept)
    R = information.factor(fit.weights)[:, kept]
    unit = or_one(np.linalg.norm(R, axis=0))
    # The sum of a column is its product with the column of an offset.
    products = fit.weights[:, None] * information.sums[:, kept] / unit
    inverse = np.linalg.pinv(R / unit)
    changes = np.zeros((information.size, information.actuators))
    changes[kept] = inverse @ inverse.T @ products.T / unit[:, None]
    return changes


def allow_offsets(information: Information, fit: Estimate) -> Array:
    """Return the changes (k, n) of the values of a fit by torque offsets that the logs allow.

    One standard deviation of an offset of each joint, if the model had it: at most the root mean
    square of the joint's torque. Zero where the model has a constant torque.
    """
    changes = measure_offsets(information, fit)
    rows = information.rows_each
    outside = rows - np.einsum("nk,kn->n", information.sums[:, :-1], changes)
    largest = information.torque / np.maximum(rows, 1)
    noise = fit.variance * fit.times
    lacking = (outside > NEARLY * rows) & (largest > 0)
    size = noise * largest / np.where(lacking, outside * largest + noise, 1.0)
    return changes * np.sqrt(np.where(lacking, size, 0.0))


def widening(information: Information, known: Fit) -> float:
    """Return the ratio of the variances by resampling and scores to those by formula.

    One factor for all of them keeps their correlations: few parameters may leave their mutual
    differences open, while the torque determines them well. It is below 1 where noise swings back
    from sample to sample, as steps of encoders do behind a derivative.
    """
    fit = known.estimate
    kept = list(fit.kept)
    if not kept:
        return 1.0
    variance = np.diag(remembering_covariance(information, fit))
    wide = known.noise[kept] ** 2 + known.terms["logs"][kept] ** 2
    sure = np.isfinite(wide) & (variance > 0)
    if sure.any():
        return float(np.mean(wide[sure] / variance[sure]))
    return 1.0


def _never_shown(information: Information, fit: Estimate) -> Array:
    """Return the directions that change no torque along the fitted motion, (k, dropped)."""
    weighted, plain = (
        np.linalg.norm(information.factor(w)[:, :-1], axis=0) for w in (fit.weights, None)
    )
    directions = fit.open / or_one(weighted)[:, None]
    size = plain / np.sqrt(information.samples)
    # A column which never acted counts for this share of the largest one.
    least = 1e-3 * size.max(initial=0.0)
    return directions / np.maximum(size @ np.abs(directions), least or 1.0)


# How far predicted torque is from the measured: one definition.
#
# ε_RA (`Prediction.relative_error`) is the paper's, which adds up N and N·m as they are; the errors
# of joints over their own scale (`Prediction.joint_error`) see small joints as well as large ones.


def loaded_joints(rms: Array) -> list[int]:
    """Return the joints with torque; all where there is none.

    Joints without a drive, such as a base, have none along most motions.
    """
    loaded = np.flatnonzero(rms > 0)
    return (loaded if len(loaded) else np.arange(len(rms))).tolist()


# `Prediction`: torque predicted along logs in one pass, and how far it is from the measured.
#
# In sample, on held-out logs, and by blocked cross-validation, where folds take turns.


@frozen
class Prediction:
    """Measured torque and its prediction by some models along logs.

    Of long logs it is about windows only (`regression.windows`), of others about every sample.

    Attributes
    ----------
    total : int
        Samples of the logs, those between the windows too.
    signal : (n,) bool
        Joints at which there is something to explain.
    t : tuple of (N_l,) [s]
        Times of the samples of each of L logs.
    tau, raw : (N, n) [N·m or N]
        Their measured torque, logs one after the other: low-passed with the columns, and as it was
        measured at the same samples.
    log : (N,) int
        Which log a sample comes from.
    data : (N, n) bool
        Where torque is data; elsewhere measured and predicted torque are not looked at.
    errors : (2, 2, L, n, m) [N·m or N, and squared]
        Of low-passed and of raw torque, sums of absolute errors and of their squares; of raw torque
        where no joint dwells.
    predicted : (N, n, m) [N·m or N]
        Prediction of each of m models; none of a task that keeps none.
    """

    total: int
    signal: np.ndarray
    t: tuple[Array, ...]
    tau: Array
    raw: Array
    log: np.ndarray
    data: np.ndarray
    errors: Array
    predicted: Array

    @staticmethod
    def of(
        t: Sequence[Array],
        tau: Array,
        predicted: Array,
        log: np.ndarray,
        data: np.ndarray | None = None,
        raw: Array | None = None,
    ) -> Prediction:
        """Return the prediction of some samples that are all held.

        Parameters
        ----------
        t : sequence of (N_l,) [s]
        tau : (N, n) [N·m or N]
        predicted : (N, n, m) [N·m or N]
        log : (N,) int
        data : (N, n) bool, optional
            Where torque is data; everywhere by default.
        raw : (N, n) [N·m or N], optional
            Torque as it was measured; `tau` by default.
        """
        data = np.ones(tau.shape, bool) if data is None else data
        raw = tau if raw is None else raw
        low = tau.min(0, initial=np.inf, where=data)
        high = tau.max(0, initial=-np.inf, where=data)
        own = [log == k for k in range(len(t))]
        errors = [sum_errors([(x[k], data[k]) for x in (tau, raw)], predicted[k]) for k in own]
        samples = tuple(t), tau, raw, log, data
        errors_each = np.stack(errors, 2)
        return Prediction(len(tau), ~is_constant(low, high), *samples, errors_each, predicted)

    @property
    def residual(self) -> Array:
        """Measured less predicted torque, (N, n, m)."""
        return (self.tau[:, :, None] - self.predicted) * self.data[:, :, None]

    @property
    def rms(self) -> Array:
        """Root mean square of the measured torque of each joint, (n,)."""
        return np.sqrt(np.sum(self.tau**2 * self.data, axis=0) / self._rows)

    @property
    def _rows(self) -> np.ndarray:
        """Number of valid samples of each joint, (n,), one at least."""
        return np.maximum(self.data.sum(0), 1)

    def apart(
        self, at: np.ndarray | slice = slice(None), axis: int | None = None, *, raw: bool = False
    ) -> Array:
        """Return the distance of torque from its mean, summed over all joints or over each.

        Zero where torque is no data, or there is nothing to explain; (N, n).
        """
        tau = (self.raw if raw else self.tau)[at]
        data = self.data[at]
        sums = np.sum(tau, axis=axis, where=data)
        counts = np.maximum(data.sum(axis), 1)
        mean = sums / counts
        some = data * (self.signal if axis == 0 else self.signal.any())
        return np.abs(tau - mean) * some

    def select(self, models: Sequence[int]) -> Prediction:
        """Return the prediction of some models."""
        at = list(models)
        errors = self.errors[..., at]
        predicted = self.predicted[:, :, at]
        return replace(self, errors=errors, predicted=predicted)

    def relative_error(self, log: int | None = None, *, raw: bool = False) -> Array:
        """Return ε_RA of each model, (m,); NaN where there is nothing to explain.

        Parameters
        ----------
        log : int, optional
            Of one log alone, relative to the variation of its torque.
        raw : bool
            Of the torque as it was measured, not as it was low-passed.
        """
        at, own = (
            (slice(None), slice(None)) if log is None else (self.log == log, slice(log, log + 1))
        )
        errors = self.errors[int(raw), 0, own].sum((0, 1))
        return _ratio(errors, self.apart(at, raw=raw).sum())

    def variation(self, log: int) -> float:
        """Return the mean distance of a log's torque from its mean [N or N·m]."""
        at = self.log == log
        return float(self.apart(at).sum() / max(1, self.data[at].sum()))

    def constant_error(self) -> float:
        """Return ε_RA of predicting each joint's mean torque: the baseline of every model."""
        own, every = (self.apart(axis=axis).sum() for axis in (0, None))
        return float(_ratio(own, every))

    def joint_error(self, *, raw: bool = False) -> Array:
        """Return each joint's error over its own scale (n, m), `raw` of measured torque.

        The root mean square of its error over that of its torque about its mean; NaN where the
        torque never varies.
        """
        variation = np.sum(self.apart(axis=0, raw=raw) ** 2, axis=0)
        squares = self.errors[int(raw), 1].sum(0)
        return np.sqrt(_ratio(squares, variation[:, None]))

    def joint_rms(self, *, raw: bool = False) -> Array:
        """Return the root mean square of each joint's error, (n, m) [N·m or N]."""
        squares = self.errors[int(raw), 1].sum(0)
        return np.sqrt(squares / self._rows[:, None])

    def by_joint(self, of: str = "") -> dict[str, Array]:
        """Return errors of the first model by joint, low-passed and raw, as columns of a table."""
        out: dict[str, Array] = {}
        for which, raw in (("", False), ("_raw", True)):
            out[f"error{which}{of}"] = self.joint_error(raw=raw)[:, 0]
            out[f"rms{which}{of}"] = self.joint_rms(raw=raw)[:, 0]
        return out

    def surely_better(self, one: int, other: int, errors: float = 1.0) -> bool:
        """Return whether a model errs less than another by more than some standard errors.

        Of the difference of absolute errors over stretches of the samples that are held, as a name
        is confirmed on unseen motion; False where none are held. Each joint counts by its own
        scale: the torque of a shoulder would hide the error of a wrist.
        """
        variation = np.sqrt(np.mean(self.apart(axis=0) ** 2, axis=0))
        return _surely_positive(self._gains(one, other) / or_one(variation), errors)

    def surely_better_in_all(self, one: int, other: int, errors: float) -> bool:
        """Return the same of all joints together, whose error is the one that is stated."""
        return _surely_positive(self._gains(one, other), errors)

    def _gains(self, one: int, other: int) -> Array:
        """Return by how much the absolute error of a model is less than another's, (N, n).

        No rows where no samples are held.
        """
        if not len(self.predicted):
            return np.empty((0, len(self.data.T)))
        sizes = np.abs(self.residual[:, :, [one, other]])
        return sizes[:, :, 1] - sizes[:, :, 0]


def _surely_positive(gains: Array, errors: float) -> bool:
    """Return whether the sum of gains (N, n) exceeds some standard errors; False without any.

    Stretches of the samples scatter by the standard error.
    """
    if not len(gains):
        return False
    parts = [x.sum() for x in np.array_split(gains, LEVELS.folds)]
    standard_error = np.std(parts, ddof=1) * np.sqrt(len(parts))
    return bool(np.sum(parts) > errors * standard_error)


def _ratio(part: Array, whole: Array | float) -> Array:
    """Return a ratio, NaN where there is nothing to divide by."""
    return part / np.where(whole > 0, whole, np.nan)


def sum_errors(measured: Iterable[tuple[Array, np.ndarray]], predicted: Array) -> Array:
    """Return sums of errors and of their squares, by kind of torque and its data, (2, 2, n, m)."""
    sums = []
    for tau, data in measured:
        error = np.abs(tau[:, :, None] - predicted) * data[:, :, None]
        sums.append([error.sum(0), (error**2).sum(0)])
    return np.array(sums)


#: Stretches that are resampled for an interval: more than for folds, because each counts
#: separately.
DRAWN_STRETCHES = 24


def change_interval(
    error: Array, deviation: Array, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the 95 % interval of the change of ε_RA from one model to another.

    Whole stretches of time are resampled [Künsch 1989].

    Parameters
    ----------
    error : (N, n, 2) [N·m or N]
        Absolute errors of each sample and joint.
    deviation : (N, n) [N·m or N]
        Distances of the measured torque from its mean over everything.
    rng : numpy.random.Generator
    """
    count = min(DRAWN_STRETCHES, len(error))
    differences = error[:, :, 1] - error[:, :, 0]
    both = (differences.sum(1), deviation.sum(1))
    parts, wholes = (np.add.reduceat(x, np.arange(count) * len(x) // count) for x in both)
    counts = rng.multinomial(count, np.full(count, 1 / count), size=2000)
    size = counts @ wholes
    low, high = np.quantile((counts @ parts) / np.where(size > 0, size, 1.0), ENDS)
    return float(low), float(high)


@frozen
class Task:
    """Models to be predicted with: base parameters, one set for each fold.

    Attributes
    ----------
    values : (F, b, m)
    folds : Folds or None
        Which set predicts a sample; the first without.
    kept : bool
        Whether predictions are kept, not only sums of errors.
    """

    values: Array
    folds: Folds | None = None
    kept: bool = True

    def predict(self, W: Array, start: int) -> Array:
        """Return the torque (N, n, m) of samples from one on, over all logs, with W (N, n, b)."""
        at = np.zeros(len(W), int)
        out = np.empty((*W.shape[:2], self.values.shape[2]))
        at = at if self.folds is None else self.folds.at(start, start + len(W))
        for fold in np.unique(at):
            out[at == fold] = W[at == fold] @ self.values[fold]
        return out


def predict(regression: Regression, values: Array) -> Prediction:
    """Predict torque with base parameter values of m models, (b, m)."""
    return predict_all(regression, [Task(values[None])])[0]


def predict_all(regression: Regression, tasks: Sequence[Task]) -> list[Prediction]:
    """Return several predictions of the same logs, going through their windows once.

    Chunks that were kept when their information was gathered are not computed again.
    """
    surveys = [s.survey for s in regression.samples]
    starts = np.cumsum([0, *(s.outputs for s in surveys)])
    rows = list[tuple[np.ndarray, ...]]()
    every = [list[Array]() for _ in tasks]
    shape = 2, 2, len(surveys), len(surveys[0].rows)
    errors = [np.zeros((*shape, task.values.shape[2])) for task in tasks]
    for part in regression.parts():
        for chunk in part.shown():
            data = chunk.data | part.regression.dwelling
            log = np.full(len(chunk.t), chunk.log)
            measured = (chunk.tau, data), (chunk.raw, chunk.data)
            rows.append((chunk.t, chunk.tau, chunk.raw, log, data))
            for task, own, sums in zip(tasks, every, errors, strict=True):
                predicted = task.predict(chunk.W, int(starts[chunk.log]) + chunk.start)
                sums[:, :, chunk.log] += sum_errors(measured, predicted)
                own.append(predicted[: None if task.kept else 0])
    t, tau, raw, log, data = map(np.concatenate, zip(*rows, strict=True))
    signal = find_signal(surveys)
    times = tuple(t[log == k] for k in range(len(surveys)))
    held = int(starts[-1]), signal, times, tau, raw, log, data
    found = zip(errors, map(np.concatenate, every), strict=True)
    return [Prediction(*held, sums, predicted) for sums, predicted in found]
