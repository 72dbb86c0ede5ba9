"""ε_RA, how well it is known, and the stretches of time: one definition for every verb.

What to use when: `relative_error` and `change_interval` for samples that are all held;
`ErrorSums` and `standard_error` for logs of any length, whose errors are added up over stretches of
time in one pass. Means that variation is measured from are known before (`Layout`), so parts of a
log can be worked on anywhere. `divide_blocks` and `choose_folds` say what is left out while the
rest is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.shares import ENDS
from identifiability.foundation.values import frozen

#: Stretches of time whose errors give the standard error of ε_RA, each at least so many
#: autocorrelation times of the error long, as long as `FEWEST` are left.
STRETCHES, MEMORIES, FEWEST = 20, 5.0, 4

#: Stretches that are drawn again and again for an interval: more, as each weighs by itself.
DRAWN_STRETCHES = 24

#: Stretches over which models are compared while one is chosen; at least `FEWEST` of each log.
CHOICE_STRETCHES = 16

#: From this many logs on a choice leaves out whole logs; of fewer, stretches.
FEWEST_LOGS = 4

#: Folds of the blocked cross-validation when there is one log.
FOLDS = 5

#: Samples of a log that are all held for figures and autocorrelations; of longer logs only so
#: many windows of so many samples are, evenly spaced.
EXCERPT, WINDOWS, WINDOW = 100_000, 4, 10_000


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
    parts = split_evenly(error.sum(1), DRAWN_STRETCHES)
    size = np.array([p.sum() for p in split_evenly(deviation.sum(1), DRAWN_STRETCHES)])
    change = np.array([float(np.sum(p[:, 1] - p[:, 0])) for p in parts])
    counts = rng.multinomial(len(parts), np.full(len(parts), 1 / len(parts)), size=draws)
    low, high = np.quantile((counts @ change) / (counts @ size), ENDS)
    return float(low), float(high)


def choose_folds(log: np.ndarray) -> np.ndarray:
    """Return the fold of each block or sample: whole logs where there are several, else stretches.

    Parameters
    ----------
    log : (B,) int
        Which log it comes from.
    """
    count = len(log)
    return log if log.max(initial=0) > 0 else (np.arange(count) * min(FOLDS, count)) // count


def divide_blocks(log: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the stretch (B,) of each block, and the fold (S,) of each stretch, for a choice.

    Parameters
    ----------
    log : (B,) int
        Which log a block comes from.
    counts : (B,) int
        Its samples.
    """
    logs = np.unique(log)
    stretch = np.empty(len(counts), int)
    fold: list[int] = []
    for k, one in enumerate(logs):
        rows = np.flatnonzero(log == one)
        share = counts[rows].sum() / counts.sum()
        wanted = max(FEWEST, round(CHOICE_STRETCHES * share))
        pieces = min(wanted, len(rows))
        stretch[rows] = len(fold) + np.arange(len(rows)) * pieces // len(rows)
        # Two or three folds cannot contradict anything: then stretches of the logs are the folds.
        whole = len(logs) >= FEWEST_LOGS
        fold += [k] * pieces if whole else list(range(len(fold), len(fold) + pieces))
    return stretch, np.array(fold)


@frozen
class Layout:
    """Where stretches of logs begin, and what their torque is on average.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
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
    log: np.ndarray
    first: np.ndarray
    mean: float
    joint_mean: Array
    log_mean: Array
    signal: np.ndarray

    @staticmethod
    def of(counts: Sequence[int], torque: Array, signal: np.ndarray) -> Layout:
        """Return the layout of logs, with about `STRETCHES` over all and one in each at least.

        Parameters
        ----------
        counts : sequence of int
            Samples of each log.
        torque : (L, n) [N·m or N]
            Sum of the torque of each log.
        signal : (n,) bool
            Joints at which there is something to explain.
        """
        total = max(sum(counts), 1)
        parts = [min(max(1, round(STRETCHES * c / total)), max(c, 1)) for c in counts]
        first = [
            np.arange(k) * (c // k) + np.minimum(np.arange(k), c % k)
            for c, k in zip(counts, parts, strict=True)
        ]
        return Layout(
            counts=np.array(counts, int),
            log=np.repeat(np.arange(len(counts)), parts),
            first=np.concatenate(first),
            mean=float(torque.sum() / (total * torque.shape[1])),
            joint_mean=torque.sum(0) / total,
            log_mean=torque.sum(1) / (np.maximum(counts, 1.0) * torque.shape[1]),
            signal=signal,
        )

    def stretch(self, log: int, start: int, stop: int) -> np.ndarray:
        """Return the stretch of the samples [start, stop) of a log, (n,) int."""
        mine = np.flatnonzero(self.log == log)
        found = np.searchsorted(self.first[mine], np.arange(start, stop), "right") - 1
        which: np.ndarray = mine[found]
        return which

    def shown(self, log: int, start: int, stop: int) -> list[tuple[int, slice]]:
        """Return which samples of [start, stop) are held, by the number of their window."""
        count = int(self.counts[log])
        starts = np.linspace(0, count - WINDOW, WINDOWS).astype(int).tolist()
        every = [(s, s + WINDOW) for s in starts] if count > EXCERPT else [(0, count)]
        inside = ((max(first, start), min(last, stop)) for first, last in every)
        numbered = enumerate(inside, log * WINDOWS)
        return [(k, slice(a - start, b - start)) for k, (a, b) in numbered if a < b]


@frozen
class ErrorSums:
    """All that errors of prediction say, summed over S stretches of time; parts add up.

    Attributes
    ----------
    log, counts : (S,) int
        Log and samples of each stretch.
    absolute, squares : (S, n, m) [N·m or N, and squared]
        Of the errors of each joint and model.
    torque_squares : (S, n) [(N·m)² or N²]
        Of the measured torque.
    deviation, own, local : (S, n) [N·m or N]
        Distances of the torque from its mean over everything, over the joint, over the log: the
        denominators of relative errors. Zero where there is nothing to explain.
    """

    log: np.ndarray
    counts: np.ndarray
    absolute: Array
    squares: Array
    torque_squares: Array
    deviation: Array
    own: Array
    local: Array

    @staticmethod
    def of(layout: Layout, log: int, start: int, tau: Array, predicted: Array) -> ErrorSums:
        """Return the sums of some samples of a log, the first of which is its `start`-th.

        Measured torque tau (N, n) and predicted torque (N, n, m) are in N·m or N.
        """
        which = layout.stretch(log, start, start + len(tau))
        edges = np.flatnonzero(np.diff(which, prepend=-1))
        means = (layout.mean, layout.joint_mean, layout.log_mean[log])
        error = np.abs(tau[:, :, None] - predicted)
        deviation, own, local = (np.abs(tau - mean) for mean in means)
        signal = layout.signal
        some = signal.any()  # joints without any are still apart from the mean over all
        spread = deviation * some, own * signal, local * some
        sums = []
        for rows in (np.ones(len(tau), int), error, error**2, tau**2, *spread):
            sums.append(np.zeros((len(layout.log), *rows.shape[1:]), rows.dtype))
            if len(rows):
                sums[-1][which[edges]] = np.add.reduceat(rows, edges, axis=0)
        return ErrorSums(layout.log, *sums)

    def __add__(self, other: ErrorSums) -> ErrorSums:
        """Return the sums over the samples of both, in the same layout."""
        mine, others = ([*vars(sums).values()][1:] for sums in (self, other))
        return ErrorSums(self.log, *map(np.add, mine, others))

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
    absolute = sums.absolute.sum(1)
    if against is not None:
        absolute = absolute - absolute[:, [against]]
    least = MEMORIES * np.broadcast_to(memory, absolute.shape[1])
    spread = np.array([_scatter(sums, x, m) for x, m in zip(absolute.T, least, strict=True)])
    return relative_error(spread[None, None], sums.deviation)


def _scatter(sums: ErrorSums, x: Array, least: float) -> float:
    """Return the standard error of Σ x over stretches of at least so many samples."""
    first = sums.merge(least, FEWEST)
    counts = np.add.reduceat(sums.counts, first)
    total = np.add.reduceat(x, first)
    k = len(first)
    if k < 2:
        return float("nan")
    # Stretches differ in length: what counts is how far they are from their share of the sum.
    apart = total - counts * (total.sum() / counts.sum())
    return float(np.sqrt(k / (k - 1) * (apart**2).sum()))
