"""Logs of several sides as one question; the same motion made twice cancels what both get wrong.

What a model leaves out is a function of the motion. Where a motion is made again, before and after
something changed, the difference of the torques, on one clock, has none of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from identifiability.estimation.differences import EXCERPT, Differences, LogRows, find_lacks
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.noise import JointRuns
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.instruments import find_lag
from identifiability.logs.prepare.longsamples import Prepared
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
        Which of the logs they are.
    """

    first: Samples
    second: Samples
    at: tuple[int, int]


def look(structure: Structure, samples: Sequence[Prepared], values: int) -> Excerpt:
    """Return the rows of logs, if there are enough for so many values.

    Raises
    ------
    LogError
    """
    seen = Excerpt.of(structure.regression(samples), EXCERPT)
    fewest = int(np.bincount(seen.log, minlength=len(samples)).min())
    if fewest < LOG_RULES.fewest or fewest * len(structure.robot.joints) <= values:
        raise LogError(
            f"{fewest} samples are too few to say how {values} values scatter; give longer or "
            "more logs, or a smaller model (--ladder)."
        )
    return seen


def find_differences(
    structure: Structure,
    seen: Excerpt,
    base: Array,
    bodies: Sequence[str],
    pairs: Sequence[Pair],
    **asked: Any,
) -> Differences:
    """Return what may differ between logs, by pairs alone where there are some.

    Parameters
    ----------
    structure, seen, base, bodies
        As of `LogRows.of`; the rows of all logs.
    pairs : sequence of Pair
    asked
        `known`, `patterns` and `always` of `Differences`.
    """
    what, serves = (structure, base, bodies), Counter(p.at[1] for p in pairs)
    return Differences(
        rows=subtract(structure, base, bodies, pairs)
        if pairs
        else LogRows.of(structure, seen, base, bodies),
        logs=len(asked["patterns"][0]),
        lacks=None if pairs else find_lacks(structure, seen),
        # Those that share a log share its noise.
        shared=(max(serves.values(), default=1) + 1) / 2,
        **asked,
    )


def subtract(
    structure: Structure, base: Array, bodies: Sequence[str], pairs: Sequence[Pair]
) -> LogRows:
    """Return what the rows of logs differ by from those of their repetitions."""
    numbers = np.array([p.at for p in pairs]).T
    sides = [p.first for p in pairs], [p.second for p in pairs]
    plain = [[replace(s, instrument=None, echoes=()) for s in side] for side in sides]
    seen = [Excerpt.of(structure.regression(side), EXCERPT) for side in plain]
    rows = [
        replace(LogRows.of(structure, x, base, bodies), log=own[x.log])
        for x, own in zip(seen, numbers, strict=True)
    ]
    keys = [x.log + 1j * x.t for x in seen]
    _, at, there = np.intersect1d(*keys, return_indices=True)
    t, log = seen[0].t[at], seen[0].log[at]
    apart = (np.diff(at) != 1) | (np.diff(there) != 1) | (np.diff(log) != 0) | signals.has_gap(t)
    starts = np.flatnonzero(np.concatenate([[True], apart])).tolist()
    runs = list(zip(starts, [*starts[1:], len(at)], strict=True))
    both = JointRuns.of(runs, seen[0].data[at] & seen[1].data[there])
    return rows[0].take(at, both).minus(rows[1].take(there, both))


def find_pairs(robot: Robot, logs: Sequence[Recording], later: int, how: Preparation) -> list[Pair]:
    """Return the first so many logs with one of the rest that repeats its motion, if all have one.

    Of several repetitions the one is taken that served least so far. Logs that are too long for
    memory have none.
    """
    known = {
        k: prepare_samples(robot, x, how)
        for k, x in enumerate(logs)
        if isinstance(x, Log) and k >= later
    }
    pairs: list[Pair] = []
    for k, log in enumerate(logs[:later]):
        if not isinstance(log, Log) or not known:
            return []
        own = prepare_samples(robot, log, how)
        serves = Counter(p.at[1] for p in pairs)
        for at in sorted(known, key=serves.__getitem__):
            shift = find_lag(own.motion, known[at].motion)
            found = None if shift is None else _on_one_clock(robot, log, logs[at], shift, how)
            if found is not None:
                pairs.append(Pair(*found, (k, at)))
                break
        else:
            return []
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
