"""`Pair`: the same motion made twice, on one clock, so that what both logs get wrong cancels.

What a model leaves out is a function of the motion. Where a motion is made again, before and after
something changed, the difference of the torques has none of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from identifiability.estimation.differences import EXCERPT, LogRows
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.noise import JointRuns
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.instruments import find_lag
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.structure import Structure
from identifiability.robot import Robot


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

    def rows(
        self, structure: Structure, base: Array, bodies: Sequence[str], numbers: tuple[int, int]
    ) -> LogRows:
        """Return what the first log's rows differ by from those of the second.

        Parameters
        ----------
        structure, base, bodies
            As of `find_causes`.
        numbers : (int, int)
            Of the two logs among all.
        """
        seen = [
            Excerpt.of(structure.regression([replace(s, instrument=None)]), EXCERPT)
            for s in (self.first, self.second)
        ]
        one, two = (
            LogRows.of(structure, x, base, bodies, n) for x, n in zip(seen, numbers, strict=True)
        )
        t, other = (x.t for x in seen)
        at, there = _match(t, other, LOG_RULES.even * float(np.median(np.diff(t))))
        apart = (np.diff(at) != 1) | (np.diff(there) != 1) | signals.has_gap(t[at])
        starts = np.flatnonzero(np.concatenate([[True], apart])).tolist()
        runs = list(zip(starts, [*starts[1:], len(at)], strict=True))
        own = JointRuns.of(runs, seen[0].data[at] & seen[1].data[there])
        return one.take(at, own).minus(two.take(there, own))


def share_noise(pairs: Sequence[Pair]) -> float:
    """Return how much more pairs scatter for sharing second logs, whose noise they share."""
    serves = [pair.at[1] for pair in pairs]
    return max(((serves.count(k) + 1) / 2 for k in serves), default=1.0)


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


def _match(t: Array, other: Array, close: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of equal times, each ascending."""
    near = np.clip(np.searchsorted(other, t - close), 0, len(other) - 1)
    good = np.abs(other[near] - t) <= close
    return np.flatnonzero(good), near[good]
