"""How logs are divided in time: what errors are added up over, what is left out, what is held.

What to use when: `Layout` for the standard errors of errors; `divide_blocks` and `choose_folds` for
what is left out while the rest is fitted, and `Turns` for who predicts it then.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.regression import choose_windows

#: Stretches of time over which errors are added up, for their standard errors.
STRETCHES = 20

#: Least number of stretches of each log over which models are compared while one is chosen, and
#: their number over all logs.
FEWEST, CHOICE_STRETCHES = 4, 16

#: From this many logs on a choice leaves out whole logs; of fewer, stretches.
FEWEST_LOGS = 4

#: Folds of the blocked cross-validation when there is one log.
FOLDS = 5


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


def leave_out(information: Information, folds: np.ndarray, fold: int) -> Information:
    """Return the information of all blocks but those of one fold."""
    return information.take(folds != fold)
