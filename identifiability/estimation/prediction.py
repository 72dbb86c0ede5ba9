"""`Prediction`: torque predicted along logs in one pass, and how far it is from the measured.

`TorqueUncertainty` says how far it may lie from the truth and from a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import chain
from operator import add

import numpy as np
from scipy.special import stdtrit

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import LEVELS, Folds
from identifiability.estimation.fit import Fit, remembering_covariance
from identifiability.foundation.engines import Engine, Steps
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import ENDS, REACH
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import find_signal
from identifiability.logs.signals import is_constant
from identifiability.regression.information import Information
from identifiability.regression.regression import LogPart, Regression, map_parts

# `TorqueUncertainty`: how far predicted torque may lie from the truth and from a sample.
#
# Two intervals. That of the *mean* holds the torque of the model with its true values: what the
# parameters do not know. That of a *new sample* adds what a measured torque scatters about it,
# which no longer log makes smaller. Residuals remember: with an autocorrelation time κ, N samples
# count as N/κ for both, so that the fit swallows κ times more of the noise than of white noise.


@frozen(kw_only=True)
class TorqueUncertainty:
    """What is not known of predicted torque.

    Attributes
    ----------
    covariance : (k, k)
        Of the values, with what the noise remembers; zero for columns that were not fitted.
    unknown : (k, d)
        Directions of which the fitted motion says nothing, as long as their columns were large.
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

        Infinite where the motion acts on what the fitted motion never showed.

        Parameters
        ----------
        W : (N, n, k)
        """
        variance = np.maximum(np.einsum("anj,jk,ank->an", W, self.covariance, W), 0.0)
        # A direction that the fitted motion never showed acts if it makes this share of what its
        # columns made there.
        variance[(np.abs(W @ self.unknown) > 1e-5).any(2)] = np.inf
        few = stdtrit(self.dof, ENDS[1])
        low, raw = (few * np.sqrt(variance + sd**2) for sd in (self.low, self.raw))
        return REACH * np.sqrt(variance), low, raw


def measure_spread(
    information: Information,
    fit: Estimate,
    known: Fit,
    rms: tuple[Array, Array],
    unseen: tuple[Array, Array],
) -> TorqueUncertainty:
    """Return what is not known of the torque that a fit predicts.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    known : Fit
        Of its values.
    rms, unseen : ((n,), (n,)) [N·m or N]
        Root mean square of the error of low-passed and of raw torque on the fitted and on unseen
        motion; the latter NaN where there is none. The larger one counts: what the model misses is
        seen on unseen motion only.
    """
    n, kept = information.actuators, list(fit.kept)
    independent = information.rows_each / fit.times
    dof = np.maximum(independent - len(kept) / n, 1.0)
    swallowed = np.sqrt(independent / dof)
    low, raw = (np.fmax(own * swallowed, other) for own, other in zip(rms, unseen, strict=True))
    covariance, unknown = measure_errors(information, fit, widening(information, fit, known))
    covariance = covariance + known.together.T @ known.together
    return TorqueUncertainty(covariance=covariance, unknown=unknown, low=low, raw=raw, dof=dof)


def measure_errors(
    information: Information, fit: Estimate, wider: float = 1.0
) -> tuple[Array, Array]:
    """Return the covariance (k, k) of the values of a fit, and what it never saw, (k, d).

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


def widening(information: Information, fit: Estimate, known: Fit) -> float:
    """Return by how much variances differ from those by formula, as resampling and scores say.

    One factor for all of them keeps how they depend on each other: what few parameters do not know
    of each other, torque may know well. It is below 1 where noise swings back from sample to
    sample, as steps of encoders do behind a derivative.
    """
    kept = list(fit.kept)
    if not kept:
        return 1.0
    variance = np.diag(remembering_covariance(information, fit))
    wide = known.noise[kept] ** 2 + known.terms["logs"][kept] ** 2
    sure = np.isfinite(wide) & (variance > 0)
    return float(np.mean(wide[sure] / variance[sure])) if sure.any() else 1.0


def _never_shown(information: Information, fit: Estimate) -> Array:
    """Return the directions that change no torque along the fitted motion, (k, dropped)."""
    weighted, plain = (
        np.linalg.norm(information.factor(w)[:, :-1], axis=0) for w in (fit.weights, None)
    )
    directions = fit.open / np.where(weighted > 0, weighted, 1.0)[:, None]
    size = plain / np.sqrt(information.samples)
    # A column which never acted counts for this share of the largest one.
    least = 1e-3 * size.max(initial=0.0)
    scaled: Array = directions / np.maximum(size @ np.abs(directions), least or 1.0)
    return scaled


# How far predicted torque is from the measured: one definition.
#
# What to use when: models are chosen by the error over each joint's own scale
# (`Prediction.error_over_joints`), which sees small joints as well as large ones; ε_RA
# (`Prediction.relative_error`) is the paper's, which adds up N and N·m as they are.
# `change_interval` is for samples that are all held; `ErrorSums` for logs of any length, whose
# errors are added up in one pass. Means that variation is measured from are known before
# (`Layout`), so parts of a log can be worked on anywhere.


@frozen
class Layout:
    """How long logs are, and what their torque is on average.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    mean : float [N·m or N]
        Of the torque over all joints and logs.
    joint_mean : (n,) [N·m or N]
    log_mean : (L,) [N·m or N]
        Over all joints of a log.
    signal : (n,) bool
        Joints at which there is something to explain (`samples.survey.find_signal`).
    """

    counts: np.ndarray
    mean: float
    joint_mean: Array
    log_mean: Array
    signal: np.ndarray

    @staticmethod
    def of(counts: Sequence[int], torque: Array, signal: np.ndarray, rows: np.ndarray) -> Layout:
        """Return the layout of logs.

        Parameters
        ----------
        counts : sequence of int
            Samples of each log.
        torque : (L, n) [N·m or N]
            Sum of the torque of each log.
        signal : (n,) bool
            Joints at which there is something to explain.
        rows : (L, n) int
            Samples at which torque of each joint is data.
        """
        whole, joints, logs = (torque.sum(k) / np.maximum(rows.sum(k), 1) for k in (None, 0, 1))
        return Layout(np.array(counts, int), float(whole), joints, logs, signal)


#: Stretches that are drawn again and again for an interval: more, as each weighs by itself.
DRAWN_STRETCHES = 24


def change_interval(
    error: Array, deviation: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float]:
    """Return the 95 % interval of the change of ε_RA from one model to another.

    Whole stretches of time are drawn again and again [Künsch 1989].

    Parameters
    ----------
    error : (N, n, 2) [N·m or N]
        Absolute errors of each sample and joint.
    deviation : (N, n) [N·m or N]
        Distances of the measured torque from its mean over everything.
    rng : numpy.random.Generator
    draws : int
    """
    count = min(DRAWN_STRETCHES, len(error))
    both = ((error[:, :, 1] - error[:, :, 0]).sum(1), deviation.sum(1))
    parts, wholes = (np.add.reduceat(x, np.arange(count) * len(x) // count) for x in both)
    counts = rng.multinomial(count, np.full(count, 1 / count), size=draws)
    size = counts @ wholes
    low, high = np.quantile((counts @ parts) / np.where(size > 0, size, 1.0), ENDS)
    return float(low), float(high)


@frozen
class ErrorSums:
    """All that errors of prediction say, summed over each of L logs; parts add up.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    rows : (L, n) int
        Those of them at which torque of each joint is data.
    absolute, squares : (L, n, m) [N·m or N, and squared]
        Of the errors of each joint and model.
    torque_squares : (L, n) [(N·m)² or N²]
        Of the measured torque.
    deviation, own, local : (L, n) [N·m or N]
        Distances of the torque from its mean over everything, over the joint, over the log: the
        denominators of relative errors. Zero where there is nothing to explain.
    variation : (L, n) [(N·m)² or N²]
        Squared distances from the mean over the joint.
    """

    counts: np.ndarray
    rows: np.ndarray
    absolute: Array
    squares: Array
    torque_squares: Array
    deviation: Array
    own: Array
    local: Array
    variation: Array

    @staticmethod
    def of(
        layout: Layout,
        log: int,
        tau: Array,
        predicted: Array,
        data: np.ndarray,
    ) -> ErrorSums:
        """Return the sums of some samples of a log.

        Measured torque tau (N, n) and predicted torque (N, n, m) are in N·m or N; where they are
        no `data` (N, n), they are not looked at.
        """
        means = (layout.mean, layout.joint_mean, layout.log_mean[log])
        error = np.abs(tau[:, :, None] - predicted) * data[:, :, None]
        deviation, own, local = (np.abs(tau - mean) * data for mean in means)
        signal = layout.signal
        some = signal.any()  # joints without any are still apart from the mean over all
        spread = deviation * some, own * signal, local * some, own**2 * signal
        sums = []
        every = np.ones(len(tau), int), data.astype(int)
        for rows in (*every, error, error**2, tau**2 * data, *spread):
            sums.append(np.zeros((len(layout.counts), *rows.shape[1:]), rows.dtype))
            sums[-1][log] = rows.sum(0)
        return ErrorSums(*sums)

    def __add__(self, other: ErrorSums) -> ErrorSums:
        """Return the sums over the samples of both, in the same layout."""
        return ErrorSums(*map(np.add, vars(self).values(), vars(other).values()))

    def select(self, models: Sequence[int]) -> ErrorSums:
        """Return the sums of some models."""
        at = list(models)
        return replace(self, absolute=self.absolute[:, :, at], squares=self.squares[:, :, at])


def loaded_joints(rms: Array) -> list[int]:
    """Return the joints whose torque there is something to say of; all where there is none.

    What nothing drives, as a base, has none along most motions.
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
    sums, raw : ErrorSums
        Against the torque as it was low-passed with the columns, and against the torque as it was
        measured at the same samples.
    t : tuple of (N_l,) [s]
        Times of the samples of each log, if these are held.
    tau : (N, n) [N·m or N]
        Their measured torque, logs one after the other.
    predicted : (N, n, m) [N·m or N]
        Prediction of each of m models.
    log : (N,) int
        Which log a sample comes from.
    data : (N, n) bool
        Where torque is data; elsewhere measured and predicted torque are zero.
    """

    total: int
    sums: ErrorSums
    raw: ErrorSums
    t: tuple[Array, ...]
    tau: Array
    predicted: Array
    log: np.ndarray
    data: np.ndarray

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
        counts = [int((log == k).sum()) for k in range(len(t))]
        torque = np.array([(tau * data)[log == k].sum(0) for k in range(len(t))])
        rows = np.array([data[log == k].sum(0) for k in range(len(t))])
        low, high = tau.min(0, initial=np.inf, where=data), tau.max(0, initial=-np.inf, where=data)
        layout = Layout.of(counts, torque, ~is_constant(low, high), rows)
        sums, also = (
            reduce(
                add, (ErrorSums.of(layout, k, *(x[log == k] for x in own)) for k in range(len(t)))
            )
            for own in ((tau, predicted, data), (tau if raw is None else raw, predicted, data))
        )
        return Prediction(len(tau), sums, also, tuple(t), tau, predicted, log, data)

    @property
    def samples(self) -> int:
        """Number of samples that the errors are of."""
        return int(self.sums.counts.sum())

    @property
    def whole(self) -> bool:
        """Whether it is about all samples of the logs."""
        return self.samples == self.total

    @property
    def residual(self) -> Array:
        """Measured less predicted torque, (N, n, m)."""
        return self.tau[:, :, None] - self.predicted

    @property
    def rms(self) -> Array:
        """Root mean square of the measured torque of each joint, (n,)."""
        squares: Array = self.sums.torque_squares.sum(0)
        rms: Array = np.sqrt(squares / np.maximum(self.sums.rows.sum(0), 1))
        return rms

    def select(self, models: Sequence[int]) -> Prediction:
        """Return the prediction of some models."""
        at = list(models)
        sums, raw = self.sums.select(at), self.raw.select(at)
        return replace(self, sums=sums, raw=raw, predicted=self.predicted[:, :, at])

    def relative_error(self, log: int | None = None, *, raw: bool = False) -> Array:
        """Return ε_RA of each model, (m,); NaN where there is nothing to explain.

        Parameters
        ----------
        log : int, optional
            Of one log by itself, relative to how much its own torque varies.
        raw : bool
            Of the torque as it was measured, not as it was low-passed.
        """
        sums = self.raw if raw else self.sums
        if log is None:
            return _ratio(sums.absolute.sum((0, 1)), sums.deviation.sum())
        return _ratio(sums.absolute[log].sum(0), sums.local[log].sum())

    def constant_error(self) -> float:
        """Return ε_RA of predicting each joint's mean torque: what any model must beat."""
        return float(_ratio(self.sums.own.sum(), self.sums.deviation.sum()))

    def joint_error(self, *, raw: bool = False) -> Array:
        """Return each joint's error over its own scale (n, m), `raw` of measured torque.

        The root mean square of its error over that of its torque about its mean; NaN where the
        torque never varies.
        """
        sums = self.raw if raw else self.sums
        return np.sqrt(_ratio(sums.squares.sum(0), sums.variation.sum(0)[:, None]))

    def joint_rms(self, *, raw: bool = False) -> Array:
        """Return the root mean square of each joint's error, (n, m) [N·m or N]."""
        squares: Array = (self.raw if raw else self.sums).squares.sum(0)
        rms: Array = np.sqrt(squares / np.maximum(self.sums.rows.sum(0), 1)[:, None])
        return rms

    def by_joint(self, of: str = "") -> dict[str, Array]:
        """Return errors of the first model by joint, low-passed and raw, as columns of a table."""
        out: dict[str, Array] = {}
        for which, raw in (("", False), ("_raw", True)):
            out[f"error{which}{of}"] = self.joint_error(raw=raw)[:, 0]
            out[f"rms{which}{of}"] = self.joint_rms(raw=raw)[:, 0]
        return out

    def surely_better(self, one: int, other: int) -> bool:
        """Return whether a model errs less than another by more than one standard error.

        Of the difference of absolute errors over stretches of the samples that are held, as a name
        is confirmed on unseen motion; False where none are held.
        """
        size = np.abs(self.residual[:, :, [one, other]]).sum(1)
        parts = [x.sum() for x in np.array_split(size[:, 1] - size[:, 0], LEVELS.folds)]
        return bool(np.sum(parts) > np.std(parts, ddof=1) * np.sqrt(len(parts)))

    def error_over_joints(self) -> Array:
        """Return the error over each joint's own scale, root mean square over the joints, (m,).

        Zero is perfect, one as good as each joint's mean. Joints whose torque never varies have no
        say; NaN where there is nothing to explain.
        """
        each = self.joint_error() ** 2
        known = each[np.isfinite(each).all(1)]
        return np.sqrt(_ratio(known.sum(0), float(len(known))))


def _ratio(part: Array, whole: Array | float) -> Array:
    """Return a ratio, NaN where there is nothing to divide by."""
    found: Array = part / np.where(whole > 0, whole, np.nan)
    return found


@frozen
class Task:
    """Models to be predicted with: base parameters, one set for each fold.

    Attributes
    ----------
    values : (F, b, m)
    folds : Folds or None
        Which set predicts a sample; the first without.
    kept : bool
        Whether samples are held, not only sums.
    """

    values: Array
    folds: Folds | None = None
    kept: bool = True

    def predict(self, W: Array, start: int) -> Array:
        """Return the torque (N, n, m) of samples from one on, over all logs, with W (N, n, b)."""
        at, out = np.zeros(len(W), int), np.empty((*W.shape[:2], self.values.shape[2]))
        at = at if self.folds is None else self.folds.at(start, start + len(W))
        for fold in np.unique(at):
            out[at == fold] = W[at == fold] @ self.values[fold]
        return out


def predict(regression: Regression, values: Array, *, engine: Engine | None = None) -> Prediction:
    """Predict torque with base parameter values of m models, (b, m)."""
    return predict_all(regression, [Task(values[None])], engine=engine)[0]


def predict_all(
    regression: Regression,
    tasks: Sequence[Task],
    *,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> list[Prediction]:
    """Return several predictions of the same logs, going through their windows once.

    What was kept when their information was gathered is not computed again.

    Parameters
    ----------
    regression : Regression
    tasks : sequence of Task
    engine : Engine, optional
        Where stretches of long logs are worked on; here without.
    progress : callable(int, int), optional
    """
    surveys = [s.survey for s in regression.samples]
    counts = [s.outputs for s in surveys]
    torque = np.array([s.torque for s in surveys])
    layout = Layout.of(counts, torque, find_signal(surveys), np.array([s.rows for s in surveys]))
    work = partial(_predict_part, tasks=tuple(tasks), layout=layout)
    parts = [part for part in regression.parts() if part.is_shown]
    found = map_parts(work, parts, engine, progress)
    return [_join(one, counts) for one in zip(*found, strict=True)]


#: Errors of low-passed and of measured torque; time, torque, prediction, log and data of samples.
Pass = tuple[ErrorSums, ErrorSums, list[np.ndarray]]


def _predict_part(part: LogPart, tasks: Sequence[Task], layout: Layout) -> list[list[Pass]]:
    """Return what each chunk of a part says of each task."""
    found: list[list[Pass]] = [[] for _ in tasks]
    for chunk in part.shown():
        before = int(layout.counts[: chunk.log].sum())
        log, data = np.full(len(chunk.t), chunk.log), chunk.data | part.regression.dwelling
        for task, own in zip(tasks, found, strict=True):
            predicted = task.predict(chunk.W, before + chunk.start)
            low, raw = (
                ErrorSums.of(layout, chunk.log, tau, predicted, own_data)
                for tau, own_data in ((chunk.tau, data), (chunk.raw, chunk.data))
            )
            kept = np.arange(len(log) if task.kept else 0)
            samples = [x[kept] for x in (chunk.t, chunk.tau, predicted, log, data)]
            own.append((low, raw, samples))
    return found


def _join(found: Sequence[list[Pass]], counts: Sequence[int]) -> Prediction:
    low, raw, samples = zip(*chain.from_iterable(found), strict=True)
    t, tau, predicted, log, data = map(np.concatenate, zip(*samples, strict=True))
    times = tuple(t[log == k] for k in range(len(counts)))
    sums = reduce(add, low), reduce(add, raw)
    return Prediction(sum(counts), *sums, times, tau, predicted, log, data)
