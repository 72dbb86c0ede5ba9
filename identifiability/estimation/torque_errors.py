"""How far predicted torque is from the measured, and how well that is known: one definition.

Logs are divided in time: what errors are added up over, what is left out, what is held out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.evidence import Evidence, Level, Score
from identifiability.estimation.rules import RULES
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.regression import choose_windows

# How logs are divided in time: what errors are added up over, what is left out, what is held.
#
# What to use when: `Layout` for the standard errors of errors; `evidence.Folds` for what is left
# out while the rest is fitted, and `Turns` for who predicts it then.


#: Stretches of time over which errors are added up, for their standard errors.
STRETCHES = 20


@frozen
class Layout:
    """Where stretches of logs begin, and what their torque is on average.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    windows : tuple of (w, 2) int
        Samples [start, stop) of each log that stretches are made of.
    log, first : (S,) int
        Log of each stretch and the sample of it that the stretch begins with.
    mean : float [N·m or N]
        Of the torque over all joints and logs.
    joint_mean : (n,) [N·m or N]
    log_mean : (L,) [N·m or N]
        Over all joints of a log.
    signal : (n,) bool
        Joints at which there is something to explain (`samples.survey.find_signal`).
    """

    counts: np.ndarray
    windows: tuple[np.ndarray, ...]
    log: np.ndarray
    first: np.ndarray
    mean: float
    joint_mean: Array
    log_mean: Array
    signal: np.ndarray

    @staticmethod
    def of(
        counts: Sequence[int], torque: Array, signal: np.ndarray, rows: np.ndarray | None = None
    ) -> Layout:
        """Return the layout of logs, with about `STRETCHES` over all and one in each window.

        Parameters
        ----------
        counts : sequence of int
            Samples of each log.
        torque : (L, n) [N·m or N]
            Sum of the torque of each log.
        signal : (n,) bool
            Joints at which there is something to explain.
        rows : (L, n) int, optional
            Samples at which torque of each joint is data; all by default.
        """
        every = np.outer(counts, np.ones(torque.shape[1], int)) if rows is None else rows
        windows = choose_windows(counts)
        sizes = [w[:, 1] - w[:, 0] for w in windows]
        shown = max(sum(s.sum() for s in sizes), 1)
        log, first = [], []
        for k, (starts, lengths) in enumerate(zip(windows, sizes, strict=True)):
            for start, c in zip(starts[:, 0].tolist(), lengths.tolist(), strict=True):
                parts = min(max(1, round(STRETCHES * c / shown)), max(c, 1))
                at = np.arange(parts)
                first.append(start + at * (c // parts) + np.minimum(at, c % parts))
                log += [k] * parts
        return Layout(
            counts=np.array(counts, int),
            windows=windows,
            log=np.array(log, int),
            first=np.concatenate(first),
            mean=float(torque.sum() / max(every.sum(), 1)),
            joint_mean=torque.sum(0) / np.maximum(every.sum(0), 1),
            log_mean=torque.sum(1) / np.maximum(every.sum(1), 1),
            signal=signal,
        )

    def stretch(self, log: int, start: int, stop: int) -> np.ndarray:
        """Return the stretch of the samples [start, stop) of a window of a log, (n,) int."""
        mine = np.flatnonzero(self.log == log)
        found = np.searchsorted(self.first[mine], np.arange(start, stop), "right") - 1
        which: np.ndarray = mine[found]
        return which

    def series(self, log: int, start: int) -> int:
        """Return the number of the window, over all logs, in which a sample of a log lies."""
        before = sum(len(w) for w in self.windows[:log])
        return before + int(np.searchsorted(self.windows[log][:, 0], start, "right")) - 1


@frozen
class Turns:
    """Which set of values predicts a sample: runs of consecutive samples take turns.

    Attributes
    ----------
    ends : (B,) int
        Sample, over all logs, at which each run ends.
    fold : (B,) int
    """

    ends: np.ndarray
    fold: np.ndarray

    def of(self, start: int, stop: int) -> np.ndarray:
        """Return the fold of the samples [start, stop), (n,) int."""
        found: np.ndarray = self.fold[np.searchsorted(self.ends, np.arange(start, stop), "right")]
        return found


def take_turns(information: Information, folds: np.ndarray) -> Turns:
    """Return who predicts which sample, from the fold of each block."""
    return Turns(np.cumsum(information.counts), folds)


# How far predicted torque is from the measured, and how well that is known: one definition.
#
# What to use when: models are chosen by the error over each joint's own scale
# (`error_over_joints`), which sees small joints as well as large ones; ε_RA (`relative_error`) is
# the paper's, which adds up N and N·m as they are. `change_interval` is for samples that are all
# held; `ErrorSums` and the standard errors for logs of any length, whose errors are added up over
# stretches of time in one pass. Means that variation is measured from are known before (`Layout`),
# so parts of a log can be worked on anywhere.


#: Stretches that are drawn again and again for an interval: more, as each weighs by itself.
DRAWN_STRETCHES = 24


def relative_error(error: Array, deviation: Array) -> Array:
    """Return ε_RA of each model, ``Σ|τ̂ - τ*| / Σ|τ* - mean τ*|`` [Díaz 2010, Eq. 18], (m,).

    NaN where there is nothing to explain.

    Parameters
    ----------
    error : (N, n, m) [N·m or N]
        Absolute errors of each sample and joint, or their sums over stretches of time.
    deviation : (N, n) [N·m or N]
        Distances of the measured torque from its mean over everything, or their sums.
    """
    total = float(deviation.sum())
    ratio: Array = error.sum((0, 1)) / (total if total > 0 else np.nan)
    return ratio


def joint_errors(squares: Array, variation: Array) -> Array:
    """Return the error of each joint over its own scale, (n, m).

    The root mean square of its error over that of its torque about its mean; NaN where the torque
    never varies.

    Parameters
    ----------
    squares : (S, n, m) [(N·m)² or N²]
        Squared errors of m models, or their sums over stretches of time.
    variation : (S, n) [(N·m)² or N²]
        Squared distances of the measured torque from its mean over the joint, or their sums.
    """
    own = variation.sum(0)
    ratio: Array = np.sqrt(squares.sum(0) / np.where(own > 0, own, np.nan)[:, None])
    return ratio


def joint_weights(variation: Array) -> Array:
    """Return what a squared error of each joint weighs, (…, n): all joints alike in all.

    Parameters
    ----------
    variation : (…, n) [(N·m)² or N²]
        As in `joint_errors`, its sum; a joint without any weighs nothing.
    """
    seen = variation > 0
    weights = np.where(seen, 1.0, 0.0) / np.where(seen, variation, 1.0)
    count = seen.sum(-1, keepdims=True)
    return weights / np.where(count > 0, count, np.nan)


def error_over_joints(squares: Array, variation: Array) -> Array:
    """Return the error over each joint's own scale, root mean square over the joints, (m,).

    Zero is perfect, one as good as each joint's mean. Joints whose torque never varies have no say;
    NaN where there is nothing to explain. Parameters are those of `joint_errors`.
    """
    total: Array = np.sqrt(joint_weights(variation.sum(0)) @ squares.sum(0))
    return total


def loaded_joints(rms: Array) -> list[int]:
    """Return the joints whose torque there is something to say of; all where there is none.

    What nothing drives, as a base, has none along most motions.
    """
    loaded = np.flatnonzero(rms > 0)
    return (loaded if len(loaded) else np.arange(len(rms))).tolist()


def split_evenly(x: Array, parts: int) -> list[Array]:
    """Return consecutive parts of about equal length, none empty."""
    return [part for part in np.array_split(x, parts) if len(part)]


def change_interval(
    error: Array, deviation: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float]:
    """Return the 95 % interval of the change of ε_RA from one model to another.

    Whole stretches of time are drawn again and again [Künsch 1989].

    Parameters
    ----------
    error, deviation : (N, n, 2) and (N, n) [N·m or N]
        As in `relative_error`.
    rng : numpy.random.Generator
    draws : int
    """
    change = (error[:, :, 1] - error[:, :, 0]).sum(1)
    return ratio_interval(change, deviation.sum(1), rng, draws)


def ratio_interval(
    part: Array, whole: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float]:
    """Return the 95 % interval of the sum of some numbers (N,) over that of others (N,) [1].

    Whole stretches of time are drawn again and again [Künsch 1989].
    """
    parts, wholes = (
        np.array([p.sum() for p in split_evenly(x, DRAWN_STRETCHES)]) for x in (part, whole)
    )
    counts = rng.multinomial(len(parts), np.full(len(parts), 1 / len(parts)), size=draws)
    size = counts @ wholes
    low, high = np.quantile((counts @ parts) / np.where(size > 0, size, 1.0), ENDS)
    return float(low), float(high)


@frozen
class ErrorSums:
    """All that errors of prediction say, summed over S stretches of time; parts add up.

    Attributes
    ----------
    log, counts : (S,) int
        Log and samples of each stretch.
    rows : (S, n) int
        Those of them at which torque of each joint is data.
    absolute, squares : (S, n, m) [N·m or N, and squared]
        Of the errors of each joint and model.
    torque_squares : (S, n) [(N·m)² or N²]
        Of the measured torque.
    deviation, own, local : (S, n) [N·m or N]
        Distances of the torque from its mean over everything, over the joint, over the log: the
        denominators of relative errors. Zero where there is nothing to explain.
    variation : (S, n) [(N·m)² or N²]
        Squared distances from the mean over the joint.
    """

    log: np.ndarray
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
        start: int,
        tau: Array,
        predicted: Array,
        data: np.ndarray | None = None,
    ) -> ErrorSums:
        """Return the sums of some samples of a log, the first of which is its `start`-th.

        Measured torque tau (N, n) and predicted torque (N, n, m) are in N·m or N; where they are
        no `data` (N, n), they are not looked at.
        """
        data = np.ones(tau.shape, bool) if data is None else data
        which = layout.stretch(log, start, start + len(tau))
        edges = np.flatnonzero(np.diff(which, prepend=-1))
        means = (layout.mean, layout.joint_mean, layout.log_mean[log])
        error = np.abs(tau[:, :, None] - predicted) * data[:, :, None]
        deviation, own, local = (np.abs(tau - mean) * data for mean in means)
        signal = layout.signal
        some = signal.any()  # joints without any are still apart from the mean over all
        spread = deviation * some, own * signal, local * some, own**2 * signal
        sums = []
        every = np.ones(len(tau), int), data.astype(int)
        for rows in (*every, error, error**2, tau**2 * data, *spread):
            sums.append(np.zeros((len(layout.log), *rows.shape[1:]), rows.dtype))
            if len(rows):
                sums[-1][which[edges]] = np.add.reduceat(rows, edges, axis=0)
        return ErrorSums(layout.log, *sums)

    def __add__(self, other: ErrorSums) -> ErrorSums:
        """Return the sums over the samples of both, in the same layout."""
        mine, others = ([*vars(sums).values()][1:] for sums in (self, other))
        return ErrorSums(self.log, *map(np.add, mine, others))

    def select(self, models: Sequence[int]) -> ErrorSums:
        """Return the sums of some models."""
        at = list(models)
        return replace(self, absolute=self.absolute[:, :, at], squares=self.squares[:, :, at])

    def merge(self, least: float, fewest: int) -> np.ndarray:
        """Return where longer stretches begin: at least so many samples, none across logs.

        They are joined, two at a time, while that leaves `fewest` over all logs.
        """
        first = np.arange(len(self.counts))
        size = 1
        while True:
            lengths = np.add.reduceat(self.counts, first)
            if lengths.mean() >= least:
                return first
            size *= 2
            longer = np.concatenate(
                [np.flatnonzero(self.log == k)[::size] for k in np.unique(self.log)]
            )
            if len(longer) < fewest or len(longer) == len(first):
                return first
            first = longer


def standard_error(sums: ErrorSums, memory: Array | float, against: int | None = None) -> Array:
    """Return the standard error of ε_RA, or of its difference to a model's, (m,).

    Errors of consecutive samples are dependent; sums over stretches of time that are several
    autocorrelation times long are nearly not. No stretch crosses from one log to another.

    Parameters
    ----------
    sums : ErrorSums
    memory : float or (m,) [samples]
        Autocorrelation time of the error of each model.
    against : int, optional
    """
    return relative_error(
        _scatter_each(sums, sums.absolute.sum(1), memory, against)[None, None], sums.deviation
    )


def standard_error_over_joints(
    sums: ErrorSums, memory: Array | float, against: int | None = None
) -> Array:
    """Return the same of the error over each joint's own scale, (m,)."""
    error = error_over_joints(sums.squares, sums.variation)
    shares = np.einsum("snm,n->sm", sums.squares, joint_weights(sums.variation.sum(0)))
    # What adds up over time is the error's square: d(e²) = 2 e de.
    return _scatter_each(sums, shares / np.where(error > 0, 2 * error, 1.0), memory, against)


def joints_above(sums: ErrorSums, memory: Array | float, against: int) -> np.ndarray:
    """Return the joints at which each model surely errs more than another does, (n, m) bool.

    By the judge (`evidence`), over stretches of time. Where one joint is hard to predict its
    scatter hides in any sum what a model does to the others.

    Parameters are those of `standard_error`.
    """
    own, count = sums.variation.sum(0), sums.squares.shape[2]
    least = RULES.memories * np.broadcast_to(memory, count)
    above = np.zeros((len(own), count), bool)
    for m in range(count):
        first = sums.merge(float(least[m]), RULES.errors_fewest)
        both = np.add.reduceat(sums.squares[:, :, [m, against]], first, axis=0)
        a, b = (Score.of_errors(x, own, 0.0) for x in np.moveaxis(both, 2, 0))
        above[:, m] = [level is Level.WORSE for level in Evidence.of(a, b).joint_levels]
    return above


def _scatter_each(sums: ErrorSums, x: Array, memory: Array | float, against: int | None) -> Array:
    """Return the standard error of Σ x of each model, or of its difference to another's, (m,)."""
    if against is not None:
        x = x - x[:, [against]]
    least = RULES.memories * np.broadcast_to(memory, x.shape[1])
    return np.array([_scatter(sums, y, m) for y, m in zip(x.T, least, strict=True)])


def _scatter(sums: ErrorSums, x: Array, least: float) -> float:
    """Return the standard error of Σ x over stretches of at least so many samples."""
    first = sums.merge(least, RULES.errors_fewest)
    counts = np.add.reduceat(sums.counts, first)
    total = np.add.reduceat(x, first)
    k = len(first)
    if k < 2:
        return float("nan")
    # Stretches differ in length: what counts is how far they are from their share of the sum.
    apart = total - counts * (total.sum() / counts.sum())
    return float(np.sqrt(k / (k - 1) * (apart**2).sum()))
