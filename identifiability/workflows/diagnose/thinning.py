"""Long logs are looked at in evenly spaced stretches: a diagnosis asks few rows many questions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identifiability.logs import Log
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.longsamples import prepare_samples
from identifiability.logs.prepare.preparation import Preparation, make_plan
from identifiability.logs.prepare.samples import Samples, check_left, join_motions, prepare_rows
from identifiability.logs.signals import Decimation
from identifiability.robot import Robot

#: Samples after decimation that a diagnosis looks at; more are thinned to stretches.
MOST_SAMPLES = 6000
STRETCH = 300


def thin(samples: Samples) -> Samples:
    """Return evenly spaced stretches of samples that are more than a diagnosis needs."""
    if samples.outputs <= MOST_SAMPLES:
        return samples
    windows = _stretches(samples.decimation, len(samples.tau))
    rows = np.concatenate([np.arange(a, b) for a, b in windows])
    return replace(
        samples, motion=samples.motion[rows], tau=samples.tau[rows],
        notes=(*samples.notes, _note(len(windows))),
    )  # fmt: skip


def _stretches(decimation: Decimation | None, samples: int) -> list[tuple[int, int]]:
    """Return evenly spaced stretches (start, stop) with about `MOST_SAMPLES` outputs in all."""
    length = STRETCH
    if decimation is not None:
        length = STRETCH * decimation.factor + 2 * decimation.reach
    count = max(1, min(MOST_SAMPLES // STRETCH, samples // length))
    starts = np.linspace(0, samples - length, count).astype(int)
    return [(int(s), int(s) + length) for s in starts]


def _note(count: int) -> str:
    return f"{count} stretches of {STRETCH} samples, evenly spaced in time, were looked at"


def prepare_thin(
    robot: Robot,
    log: Log | LogFile,
    how: Preparation,
    change: Callable[[Log], Log] = lambda log: log,
) -> Samples:
    """Return a log ready for a diagnosis; of a long one only the stretches looked at are read.

    Parameters
    ----------
    robot : Robot
    log : Log or LogFile
    how : Preparation
    change : callable(Log) -> Log, optional
        Done to the samples first; it may take some away at the end.

    Raises
    ------
    LogError, ClosureError
    """
    if isinstance(log, Log):
        return thin(prepare_samples(robot, change(log), how))
    plan = make_plan(robot, log, how)
    d = plan.decimation
    every = (len(log) if d is None else d.outputs(len(log))) <= MOST_SAMPLES
    windows = [(0, len(log))] if every else _stretches(d, len(log))
    edge = plan.filter_reach
    reach = plan.reach - edge
    parts = []
    for first, last in windows:
        origin = max(0, first - edge)
        raw = change(log.rows(origin, min(len(log), last + edge)))
        own = (first + reach, last - reach)
        parts.append(prepare_rows(robot, raw, origin, plan, own))
    motion = join_motions([p.motion for p in parts])
    tau = np.concatenate([p.tau for p in parts])
    notes = (*plan.notes, *plan.band_notes)
    notes = notes if every else (*notes, _note(len(windows)))
    check_left(log.name, len(motion), sum(b - a for a, b in windows), notes)
    return Samples(log.name, motion, tau, plan.decimation, notes, log.sha256)
