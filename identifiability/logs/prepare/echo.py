"""New noise of a log's own size along its smoothed motion, by the way that the log went.

Where positions alone were measured, and the motion is neither a series nor repeated, its
derivatives share the positions' noise and no second record has noise of its own. What such noise
does can still be tried: the smoothed motion takes the place of the true one, and noise is drawn
anew, filtered, differentiated and carried through the loops as the log's own was.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.base import GYRO
from identifiability.logs.gaps import StaleRule
from identifiability.logs.prepare.instruments import complete_along
from identifiability.logs.prepare.plan import (
    Plan,
    joint_log,
    lowest_cutoff,
    noise_level,
    resolution,
    usual_noise,
)
from identifiability.logs.prepare.preparation import SHORT, Preparation, make_plan
from identifiability.logs.prepare.samples import Samples
from identifiability.logs.rules import RULES
from identifiability.robot import Robot

#: The cut-off of the smoothed motion is found within this factor.
WIDER: Tolerance = 1.1

#: Relative standard error of a level that a median tells, times the root of the samples: simulated.
LEVEL_ERROR: Tolerance = 1.8

#: Outputs of a log at which noise is tried at most, and the windows in which they lie.
ENOUGH, WINDOWS = 2048, 16


def noise_share(robot: Robot, log: Log, cutoff: float | None, seed: int = 0) -> float:
    """Return the largest share that noise has of a joint's acceleration (rms); 0 of short logs.

    Parameters
    ----------
    robot : Robot
    log : Log
    cutoff : float or None [Hz]
        Of the low-pass of computed derivatives; None where they were measured.
    seed : int
    """
    if len(log) < SHORT:
        return 0.0
    log = joint_log(robot, StaleRule.of([log]).mend(log))
    if cutoff is None:
        size = np.zeros(1) if log.ddq is None else log.ddq.std(0)
        level = np.zeros(1) if log.ddq is None else noise_level(log.ddq, log.t)
        return float(np.max(level[size > 0] / size[size > 0], initial=0.0))
    plan = Plan(signals.sampling_step(log.t), cutoff, None, float(log.t[0]), None, 1, ())
    smooth, (noisy, _) = _draw(log, plan, np.random.default_rng(seed))
    exact, moved = plan.derive(smooth)[2], plan.derive(noisy)[2]
    moves = exact.std(0) > 0
    share = (moved - exact).std(0)[moves] / exact.std(0)[moves]
    return float(share.max(initial=0.0))


def add_echoes(robot: Robot, log: Log, samples: Samples, seed: int = 0) -> Samples | None:
    """Return the samples with echoes of their noise; None where that cannot be tried.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Samples
        With computed derivatives.
    seed : int
        Of the new noise.
    """
    if samples.cutoff is None:
        return None
    plan = make_plan(robot, log, Preparation(derivatives="butterworth", cutoff=samples.cutoff))
    log = joint_log(robot, plan.mend(log))
    smooth, drawn = _draw(log, plan, np.random.default_rng(seed))
    some = samples.take(_some_rows(samples))
    first = complete_along(robot, some.motion, plan.derive(smooth))
    if first is None:
        return None
    echoes = []
    for noisy in drawn:
        other = complete_along(robot, some.motion, plan.derive(noisy), first)
        if other is None:
            return None
        echoes.append(replace(some, motion=first, instrument=other, notes=()))
    note = (
        "noise of the motion's own size was drawn anew along the smoothed motion; values are "
        "corrected by what it does to them"
    )
    return replace(samples, echoes=tuple(echoes), notes=(*samples.notes, note))


def _some_rows(samples: Samples) -> slice | np.ndarray:
    """Return all samples, or windows of them, evenly spaced, that make enough outputs."""
    d, count = samples.decimation, len(samples.motion)
    size = ENOUGH // WINDOWS if d is None else d.factor * ENOUGH // WINDOWS + 2 * d.reach
    if WINDOWS * size >= count:
        return slice(None)
    starts = np.linspace(0, count - size, WINDOWS).astype(int)
    return (starts[:, None] + np.arange(size)).ravel()


def _draw(log: Log, plan: Plan, rng: np.random.Generator) -> tuple[Log, tuple[Log, Log]]:
    """Return the smoothed log, and it with new noise twice.

    Noise is that of an encoder whose zero is anywhere, where values are whole steps, and else
    white; the second time it has the other sign, so that what is odd in it cancels.
    """
    smooth: dict[str, Any] = {}
    noisy: tuple[dict[str, Any], dict[str, Any]] = ({}, {})
    for name in ("q", "dq"):
        x = getattr(log, name)
        if x is None:
            continue
        level, step = noise_level(x, log.t), resolution(x)
        assert plan.cutoff is not None
        smooth[name] = _smooth(x, np.maximum(level, step / np.sqrt(12)), plan.step, plan.cutoff)
        white = level * rng.standard_normal(x.shape)
        zero = rng.random(x.shape[1])
        whole = np.maximum(step, 1e-300)
        for sign, moved in zip((1.0, -1.0), noisy, strict=True):
            rounded = whole * (np.rint(smooth[name] / whole + sign * zero) - sign * zero)
            moved[name] = np.where(step > 0, rounded, smooth[name] + sign * white)
    if log.base is not None:  # its sensor has noise, too, and rings where feet hit the ground
        assert plan.cutoff is not None
        record = log.base[:, : GYRO.stop]
        level = usual_noise(record, log.t)
        most = level * (1.0 + 2.0 * LEVEL_ERROR / np.sqrt(len(record)))  # each of six channels
        slow = _smooth(record, most, plan.step, plan.cutoff)
        white = level * rng.standard_normal(record.shape)
        for sign, into in ((0.0, smooth), (1.0, noisy[0]), (-1.0, noisy[1])):
            into["base"] = np.hstack([slow + sign * white, log.base[:, GYRO.stop :]])
    return replace(log, **smooth), (replace(log, **noisy[0]), replace(log, **noisy[1]))


def _smooth(x: Array, noise: Array, dt: float, highest: float) -> Array:
    """Return the motion low-passed as much as noise allows, and no more than its derivatives."""

    def is_noise(cutoff: float) -> bool:
        left = np.sqrt(np.mean((x - signals.lowpass(x, dt, cutoff)) ** 2, axis=0))
        share = np.sqrt(max(1.0 - 2.0 * cutoff * dt, 0.0))
        return bool(np.all(left <= RULES.echo_explained * share * noise + NEARLY * x.std(0)))

    return signals.lowpass(x, dt, lowest_cutoff(is_noise, 1.0 / (dt * len(x)), highest, WIDER))
