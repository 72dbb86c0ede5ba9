"""`Pair`: the same motion made twice, on one clock, so that what both logs get wrong cancels.

What a model leaves out is a function of the motion. Where a motion is made again, before and after
something changed, the difference of the torques has none of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.instruments import find_lag
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.gather import BLOCKS
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

#: What gives the columns along logs.
Columns = Callable[[Sequence[Samples]], Regression]


@frozen
class Pair:
    """A motion and its repetition, prepared on one clock.

    Attributes
    ----------
    first, second : Samples
    at : (int, int)
        Which of the logs they are, of two lists.
    later : float [s]
        How much later the second log's clock shows the same motion.
    """

    first: Samples
    second: Samples
    at: tuple[int, int]
    later: float

    def turned(self) -> Pair:
        """Return the pair with the second log first."""
        return Pair(self.second, self.first, (self.at[1], self.at[0]), -self.later)

    def rows(
        self, structure: Structure, first: Columns | None = None
    ) -> tuple[Array, Array, Array, Array, np.ndarray]:
        """Return base columns (N, n, b) and torque (N, n) of the first, then of the second.

        And where both are data, (N, n) bool: all are zero where a joint dwells in either. Of the
        first log a regression may give other columns.
        """
        t, *own = _gather(first or structure.regression, self.first)
        other, *second = _gather(structure.regression, self.second)
        at, there = _match(t, other, LOG_RULES.even * float(np.median(np.diff(t))))
        one, two = [x[at] for x in own], [x[there] for x in second]
        data = one[2] & two[2]
        for x in (*one[:2], *two[:2]):
            x[~data] = 0.0
        return one[0], one[1], two[0], two[1], data


def share_noise(pairs: Sequence[Pair]) -> float:
    """Return how much more pairs scatter for sharing second logs, whose noise they share."""
    serves = [pair.at[1] for pair in pairs]
    return max(((serves.count(k) + 1) / 2 for k in serves), default=1.0)


def pair_information(
    names: Sequence[str], columns: Array, torque: Array, data: np.ndarray
) -> Information:
    """Return the information of columns (N, n, k) and torque (N, n) that a pair differs by."""
    size = -(-len(torque) // BLOCKS)
    log = np.zeros(len(torque), int)
    return Information.of_rows(names, columns, torque, log, size, moves=data)


def find_pairs(
    robot: Robot, logs: Sequence[Recording], others: Sequence[Recording], how: Preparation
) -> list[Pair]:
    """Return every log whose motion one of the others repeats, the repetition on its clock.

    Of several repetitions the one is taken that served least so far.

    Parameters
    ----------
    robot : Robot
    logs, others : sequence of Log or LogFile
        Logs that are too long for memory have no pair.
    how : Preparation
        With its cut-off.
    """
    known = {k: prepare_samples(robot, x, how) for k, x in enumerate(others) if isinstance(x, Log)}
    served = dict.fromkeys(known, 0)
    pairs = []
    for k, log in enumerate(logs):
        if not isinstance(log, Log) or not known:
            continue
        own = prepare_samples(robot, log, how)
        for at in sorted(known, key=lambda i: served[i]):
            later = find_lag(own.motion, known[at].motion)
            found = None if later is None else _on_one_clock(robot, log, others[at], later, how)
            if found is not None and later is not None:
                served[at] += 1
                pairs.append(Pair(*found, (k, at), later))
                break
    return pairs


def _on_one_clock(
    robot: Robot, log: Log, other: Recording, later: float, how: Preparation
) -> tuple[Samples, Samples] | None:
    """Return both logs over the time that they share; None where that is too little."""
    assert isinstance(other, Log)
    at = log.t + later
    inside = np.flatnonzero((at >= other.t[0]) & (at <= other.t[-1]))
    if len(inside) < max(LOG_RULES.fewest, LOG_RULES.nearly_all * len(log)):
        return None
    log = log.rows(int(inside[0]), int(inside[-1]) + 1)
    same = other.each(lambda x: CubicSpline(other.t, x)(log.t + later), t=log.t)
    first, second = (prepare_samples(robot, x, how) for x in (log, same))
    return first, second


def _gather(columns: Columns, samples: Samples) -> tuple[Array, Array, Array, np.ndarray]:
    """Return times (N,), columns (N, n, b), torque and whether it is data (N, n) along a log."""
    (part,) = columns([replace(samples, instrument=None, echoes=())]).parts()
    rows = [(c.t, c.W.copy(), c.tau, c.data) for c in part.chunks()]  # W is a buffer
    t, W, tau, data = map(np.concatenate, zip(*rows, strict=True))
    return t, W, tau, data


def _match(t: Array, other: Array, close: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of equal times, each ascending."""
    near = np.clip(np.searchsorted(other, t - close), 0, len(other) - 1)
    good = np.abs(other[near] - t) <= close
    return np.flatnonzero(good), near[good]
