"""Excerpts of prepared logs: a diagnosis evaluates many models on few rows.

For long logs, stretches with equal shares of the motion are prepared. Measured derivatives need no
filter. To have fewer rows, torque and columns are still low-passed at ten times the bandwidth of
the motion.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import or_one
from identifiability.logs import Log, signals
from identifiability.logs.log import join_logs
from identifiability.logs.rows import forget
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import bandwidth_of_windows
from identifiability.robot import Robot

from .dataset import Dataset, prepare_log
from .preparation import Preparation, make_plan

#: Samples after decimation that a diagnosis looks at in one log, and in all that are fitted; more
#: are thinned to stretches.
MOST_SAMPLES, MOST_IN_ALL = 3000, 4000
STRETCH = 300

#: Samples of each stretch of a long log from which its motion is measured.
LOOKS = 64


def most_rows(logs: Sequence[Log]) -> int:
    """Return the number of rows of each log in an excerpt of all."""
    return min(MOST_SAMPLES, MOST_IN_ALL // len(logs))


def prepare_excerpt(
    robot: Robot, log: Log, how: Preparation | None, most: int = MOST_SAMPLES
) -> Dataset:
    """Return a prepared log with at most some rows, decimated to ten times its bandwidth.

    Parameters
    ----------
    robot : Robot
    log : Log
        Of a long one stretches with equal shares of its motion are prepared.
    how : Preparation or None
        None decimates measured derivatives.
    most : int
        Rows after decimation.
    """
    if how is None:
        how = Preparation(decimate=find_factor(log))
    # This many times as many samples are read, in longer stretches.
    read = 40
    if not (log.long and len(log) > read * most):
        return thin(prepare_log(robot, log, how), most)
    windows = share_motion(log, read * STRETCH, most // STRETCH)
    joined = join_logs([log.rows(a, b) for a, b in windows])
    samples = thin(prepare_log(robot, joined, how), most)
    # Gaps between windows are no gaps of the log.
    hints = make_plan(robot, log, how).hints
    motion = replace(samples.motion, first=log.clock.first)
    return replace(samples, motion=motion, hints=(*hints, _tell_windows(log, windows)))


def share_motion(log: Log, length: int, most: int) -> list[tuple[int, int]]:
    """Return at most `most` stretches (start, stop) of a length, with equal shares of the motion.

    Hours at rest hold no information. The path of all joints, in their standard deviations, is
    divided into equal parts, and a stretch lies about the middle of each.
    """
    count = max(1, min(most, len(log) // length))
    step = max(1, length // LOOKS)
    q = log.q[::step]
    forget()
    travel = np.abs(np.diff(q, axis=0)) / or_one(q.std(axis=0))
    path = np.cumsum(travel.sum(axis=1))
    middles = path[-1] * (np.arange(count) + 0.5) / count
    centres = step * np.searchsorted(path, middles)
    starts = []
    earliest = 0
    for k, centre in enumerate(centres.tolist()):
        latest = len(log) - (count - k) * length
        starts.append(min(max(centre - length // 2, earliest), latest))
        earliest = starts[-1] + length
    return [(start, start + length) for start in starts]


def _tell_windows(log: Log, windows: Sequence[tuple[int, int]]) -> Finding:
    """Return the finding that says which windows of a long log are looked at."""
    start, stop = windows[0]
    seconds = float(log.t[stop - 1] - log.t[start])
    hours = (log.clock.last - log.clock.first) / 3600.0
    where = ", ".join(f"{log.t[a]:.0f}" for a, _ in windows)
    return Finding(
        "excerpt",
        log.name,
        count=len(windows),
        seconds=seconds,
        hours=hours,
        where=where,
    )


def find_factor(log: Log) -> int | None:
    """Return the decimation of measured derivatives that keeps ten times the motion's bandwidth.

    It is None if derivatives are not measured or samples are missing, because no filter crosses a
    gap.
    """
    windows = [window for _, window in log.windows()]
    step = float(np.median(np.concatenate([np.diff(w.t) for w in windows])))
    even = log.clock.longest < RULES.gap * step
    if not (even and {"dq", "ddq"} <= set(log.channels)):
        return None
    band = RULES.cutoff_wide * bandwidth_of_windows([w.q for w in windows], step)
    cutoff = min(max(band, RULES.cutoff_lowest), RULES.cutoff_highest / step)
    factor = int(0.5 / (cutoff * step))
    # A short part of a log must keep enough rows.
    while factor > 1 and signals.Decimation(factor).outputs(len(log)) < RULES.fewest:
        factor -= 1
    return factor if factor > 1 else None


def thin(samples: Dataset, most: int = MOST_SAMPLES) -> Dataset:
    """Return evenly spaced stretches of samples that are more than a diagnosis needs."""
    if samples.outputs <= most:
        return samples
    d = samples.decimation
    length = STRETCH
    length = length if d is None else length * d.factor + 2 * d.reach
    count = max(1, min(most // STRETCH, len(samples.tau) // length))
    starts = np.linspace(0, len(samples.tau) - length, count).astype(int)
    rows = (starts[:, None] + np.arange(length)).ravel()
    note = f"{count} stretches of {STRETCH} samples, evenly spaced in time, were looked at"
    return replace(samples.take(rows), notes=(*samples.notes, note))


def thin_all(
    samples: Sequence[Dataset], logs: Sequence[Log], asked: Preparation | None, most: int
) -> tuple[Dataset, ...]:
    """Return excerpts of prepared logs.

    Parameters
    ----------
    samples : sequence of Dataset
        The logs, prepared as a whole.
    logs : sequence of Log
    asked : Preparation or None
        Options of the user.
    most : int
        Rows after decimation.
    """
    found = []
    for each, log in zip(samples, logs, strict=True):
        whole = each
        if asked is None and whole.cutoff is None:
            factor = find_factor(log)
            decimation = signals.Decimation(factor) if factor else None
            whole = replace(whole, decimation=decimation)
        found.append(thin(whole, most))
    return tuple(found)
