"""The motion of a diagnosis: what is fitted, what verifies, how much of it.

An error that was minimised is no evidence: the motion on which the gap is quoted is not fitted.
Whole logs are kept apart where there are enough; else a log is divided into stretches of time, with
a pause between that nobody looks at.
A diagnosis asks few rows many questions, so long logs are looked at in evenly spaced stretches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.rounding import format_count, join
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.log import join_logs
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.prepare.dataset import prepare_log
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import bandwidth_of_windows
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

#: What follows the name of a log in that of a part of it.
PART = ", part "
#: Share of the only log that verifies, and samples that this part must have.
LAST: Tolerance = 0.25
SHORTEST = 100
#: Share of either part that is left out where the log is divided.
PAUSE: Tolerance = 0.05
#: Samples after decimation that a diagnosis looks at in one log, and in all that are fitted; more
#: are thinned to stretches.
MOST_SAMPLES, MOST_IN_ALL = 6000, 8000
STRETCH = 300
#: Of a file so many times as many samples are read, in longer stretches.
READ = 40


@frozen
class Roles:
    """Logs by what they are for.

    Attributes
    ----------
    fit : tuple of Log
        What the model is fitted to and the evidence is from.
    verify : tuple of Log
        What may refute a name, and what the gap is measured on.
    verified_on : str
        In words, to follow "on".
    """

    fit: tuple[Log, ...]
    verify: tuple[Log, ...]
    verified_on: str


def assign_roles(logs: Sequence[Log], validate: Sequence[Log]) -> Roles:
    """Return the roles of fitted and held-out logs.

    Every held-out log verifies. Without any the last log is set aside, or the last part of the
    only one.

    Parameters
    ----------
    logs : sequence of Log
    validate : sequence of Log

    Raises
    ------
    LogError
        If the only log is too short to be divided.
    """
    logs, validate = list(logs), list(validate)
    aside = ""
    if not validate and len(logs) == 1:
        return _one_log(logs[0])
    if not validate:
        *logs, last = logs
        validate, aside = [last], ", which was set aside"
    verified_on = f"{join([log.name for log in validate])}{aside}"
    return Roles(tuple(logs), tuple(validate), verified_on)


def _one_log(log: Log) -> Roles:
    fewest = SHORTEST / LAST
    if len(log) < fewest:
        raise LogError(
            f"{log.name} has {format_count(len(log), 'sample')}, too few to name effects from one "
            f"part and verify them on another; give a log of at least {fewest:.0f} samples, or a "
            "second one."
        )
    end = (1 - LAST) * len(log)
    start = end + PAUSE * (len(log) - end)
    fit = log.cut(0, int((1 - PAUSE) * end), f"{log.name}{PART}1")
    verify = log.cut(int(np.ceil(start)), len(log), f"{log.name}{PART}2")
    verified_on = f"the last {100 * LAST:.0f} % of {log.name}, set aside"
    return Roles((fit,), (verify,), verified_on)


def prepare_rows(
    robot: Robot, log: Log, how: Preparation | None, most: int = MOST_SAMPLES
) -> Dataset:
    """Return a log ready for a diagnosis: decimated to its band, thinned if it is very long.

    Measured derivatives do not need a filter, but questions need few rows: torque and columns are
    low-passed alike to ten times the band of the motion.
    """
    looks = [window for _, window in log.windows()]
    step = float(np.median(np.concatenate([np.diff(w.t) for w in looks])))
    even = log.clock.longest.length < LOG_RULES.gap * step  # no filter reaches across a gap
    if how is None and even and {"dq", "ddq"} <= set(log.channels):
        band = LOG_RULES.cutoff_wide * bandwidth_of_windows([w.q for w in looks], step)
        factor = int(
            0.5 / (min(max(band, LOG_RULES.cutoff_lowest), LOG_RULES.cutoff_highest / step) * step)
        )
        # Of a short part of a log enough must be left.
        while factor > 1 and signals.Decimation(factor).outputs(len(log)) < LOG_RULES.fewest:
            factor -= 1
        how = Preparation(decimate=max(factor, 1))
    how = how or Preparation()
    if log.long:
        long = len(log) > READ * most
        windows = spread(len(log), READ * STRETCH, most // STRETCH) if long else [(0, len(log))]
        log = join_logs([log.rows(a, b) for a, b in windows])
    return thin(prepare_log(robot, log, how), most)


def along_rollouts(
    structure: Structure,
    samples: Sequence[Dataset],
    logs: Sequence[Log],
    values: Mapping[str, float],
) -> tuple[Dataset, ...]:
    """Return samples of logs of commands along the motion of their rollouts.

    Torque of commands is made of the very positions that columns are made of, so that steps of
    encoders stand in both, and columns that no fit was calibrated for look like them. What torque
    is more than the rolled out robot's along the measured motion is put upon what it is along the
    rollout, which differs little from it and has no steps.

    Parameters
    ----------
    structure : Structure
    samples : sequence of Dataset
    logs : sequence of Log
        What they were prepared from.
    values : mapping
        Standard parameters by name of what was rolled out.
    """
    robot, model = structure.robot, structure.model
    known = {**robot.nominal, **values}
    phi = np.array([known.get(name, 0.0) for name in structure.columns])
    out = list[Dataset]()
    for own, log in zip(samples, logs, strict=True):
        found = None
        if log.rollout is not None:
            found = add_instrument(robot, log, own)
        if found is not None and found.instrument is not None:
            moved = found.instrument
            more = (model.regressor(robot, moved) - model.regressor(robot, own.motion)) @ phi
            own = replace(own, motion=moved, tau=own.tau + more)  # noqa: PLW2901 - the same
        out.append(own)
    return tuple(out)


def thin(samples: Dataset, most: int = MOST_SAMPLES) -> Dataset:
    """Return evenly spaced stretches of samples that are more than a diagnosis needs."""
    if samples.outputs <= most:
        return samples
    d, length = samples.decimation, STRETCH
    length = length if d is None else length * d.factor + 2 * d.reach
    windows = spread(len(samples.tau), length, most // STRETCH)
    rows = np.concatenate([np.arange(a, b) for a, b in windows])
    note = f"{len(windows)} stretches of {STRETCH} samples, evenly spaced in time, were looked at"
    return replace(samples.take(rows), notes=(*samples.notes, note))


def spread(samples: int, length: int, most: int) -> list[tuple[int, int]]:
    """Return evenly spaced stretches (start, stop) of a length, so many at most."""
    starts = np.linspace(0, samples - length, max(1, min(most, samples // length))).astype(int)
    return [(int(s), int(s) + length) for s in starts]
