"""`ErrorSums`: all that prediction errors say, summed over stretches of time; parts add up.

What is needed of a log of any length: how far predictions are off in each stretch, joint and
model, and how much the torque varies there. Means that variation is measured from are known before
(`Layout`), so one pass suffices and parts of a log can be worked on anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Samples of a log that are all held for figures and autocorrelations; of longer logs only so
#: many windows of so many samples are, evenly spaced.
EXCERPT, WINDOWS, WINDOW = 100_000, 4, 10_000


@frozen
class Layout:
    """Where stretches and windows of logs begin, and what their torque is on average.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    log, first : (S,) int
        Log of each stretch and the sample of it that the stretch begins with.
    windows : tuple of (int, int, int)
        Log, first and last (exclusive) sample of each window that is held.
    mean : float
        Of the torque over all joints and logs.
    joint_mean : (n,)
    log_mean : (L,)
        Over all joints of a log.
    signal : (n,) bool
        Joints at which there is something to explain (`samples.survey.find_signal`).
    """

    counts: np.ndarray
    log: np.ndarray
    first: np.ndarray
    windows: tuple[tuple[int, int, int], ...]
    mean: float
    joint_mean: Array
    log_mean: Array
    signal: np.ndarray

    @staticmethod
    def of(counts: Sequence[int], torque: Array, stretches: int, signal: np.ndarray) -> Layout:
        """Return the layout of logs.

        Parameters
        ----------
        counts : sequence of int
            Samples of each log.
        torque : (L, n)
            Sum of the torque of each log.
        stretches : int
            Over all logs; each has at least one.
        signal : (n,) bool
            Joints at which there is something to explain.
        """
        total = max(sum(counts), 1)
        log, first, windows = [], [], []
        for k, count in enumerate(counts):
            parts = min(max(1, round(stretches * count / total)), max(count, 1))
            sizes = [count // parts + (i < count % parts) for i in range(parts)]
            first += np.cumsum([0, *sizes[:-1]]).tolist()
            log += [k] * parts
            windows += [(k, a, b) for a, b in _windows(count)]
        n = torque.shape[1]
        each = np.maximum(np.array(counts, float), 1.0)
        return Layout(
            np.array(counts, int), np.array(log, int), np.array(first, int), tuple(windows),
            float(torque.sum() / (total * n)), torque.sum(0) / total, torque.sum(1) / (each * n),
            signal,
        )  # fmt: skip

    def offset(self, log: int) -> int:
        """Return the number of samples of all logs before one."""
        return int(self.counts[:log].sum())

    def stretch(self, log: int, start: int, stop: int) -> np.ndarray:
        """Return the stretch of the samples [start, stop) of a log, (n,) int."""
        mine = np.flatnonzero(self.log == log)
        found = np.searchsorted(self.first[mine], np.arange(start, stop), "right") - 1
        which: np.ndarray = mine[found]
        return which

    def shown(self, log: int, start: int, stop: int) -> list[tuple[int, slice]]:
        """Return the windows that hold samples of [start, stop), and which of these."""
        out = []
        for k, (of, first, last) in enumerate(self.windows):
            low, high = max(first, start), min(last, stop)
            if of == log and low < high:
                out.append((k, slice(low - start, high - start)))
        return out


def _windows(count: int) -> list[tuple[int, int]]:
    if count <= EXCERPT:
        return [(0, count)]
    starts = np.linspace(0, count - WINDOW, WINDOWS).astype(int).tolist()
    return [(s, s + WINDOW) for s in starts]


@frozen
class ErrorSums:
    """Sums over S stretches of time.

    Attributes
    ----------
    log, counts : (S,) int
        Log and samples of each stretch.
    absolute, squares : (S, n, m) [N·m or N, and squared]
        Of the errors of each joint and model.
    torque_squares : (S, n)
        Of the measured torque.
    deviation, own, local : (S, n)
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

    def select(self, models: Sequence[int]) -> ErrorSums:
        """Return the sums of some models."""
        at = list(models)
        return replace(self, absolute=self.absolute[:, :, at], squares=self.squares[:, :, at])

    def merge(self, least: float, fewest: int) -> np.ndarray:
        """Return where longer stretches begin: at least so many samples, none across logs.

        Stretches are joined with the next of their log, two at a time, while that leaves `fewest`
        over all logs.
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


class Tally:
    """Adds up errors, chunk by chunk and part by part.

    Parameters
    ----------
    layout : Layout
    models : int
    """

    def __init__(self, layout: Layout, models: int) -> None:
        self.layout = layout
        S, n = len(layout.log), len(layout.joint_mean)
        self._counts = np.zeros(S, int)
        self._errors = np.zeros((2, S, n, models))
        self._torque = np.zeros((4, S, n))

    def add(self, log: int, start: int, tau: Array, predicted: Array) -> None:
        """Take in samples of a log from one on: torque (N, n), predictions (N, n, m)."""
        if not len(tau):
            return
        layout = self.layout
        which = layout.stretch(log, start, start + len(tau))
        edges = np.concatenate([[0], np.flatnonzero(np.diff(which)) + 1])
        at = which[edges]
        error = np.abs(tau[:, :, None] - predicted)
        torque = np.stack(
            [
                tau**2,
                np.abs(tau - layout.mean),
                np.abs(tau - layout.joint_mean),
                np.abs(tau - layout.log_mean[log]),
            ]
        )
        self._counts[at] += np.diff([*edges, len(tau)])
        self._errors[0, at] += np.add.reduceat(error, edges, axis=0)
        self._errors[1, at] += np.add.reduceat(error**2, edges, axis=0)
        self._torque[:, at] += np.add.reduceat(torque, edges, axis=1)

    def merge(self, other: ErrorSums) -> None:
        """Take in the sums of other samples."""
        self._counts += other.counts
        self._errors += np.stack([other.absolute, other.squares])
        self._torque += np.stack([other.torque_squares, other.deviation, other.own, other.local])

    def sums(self) -> ErrorSums:
        """Return the sums."""
        squares, deviation, own, local = self._torque
        signal = self.layout.signal
        some = signal.any()  # joints without any are still apart from the mean over all
        return ErrorSums(
            self.layout.log, self._counts.copy(), self._errors[0], self._errors[1], squares,
            deviation * some, own * signal, local * some,
        )  # fmt: skip
