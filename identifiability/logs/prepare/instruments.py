"""A second record of a log's motion, with independent errors.

Instruments are the columns along a second record of the motion. For commanded robots, the rollout
is that record. Else it is a series through the motion, if instruments are requested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.values import Fields
from identifiability.logs import Log, signals
from identifiability.logs.base import UP
from identifiability.logs.rules import RULES
from identifiability.logs.series import find_series, measured_noise
from identifiability.robot import Motion, Robot, complete_motion

from .dataset import Dataset
from .preparation import joint_log

#: Position, velocity and acceleration of the actuated joints at all N rows of a log, each (N, n),
#: and which record it is.
SecondRecord: TypeAlias = "tuple[Sequence[Array] | Array, str]"


def add_instrument(
    robot: Robot,
    log: Log,
    samples: Dataset,
    *,
    always: bool = False,
) -> Dataset | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        Log of the samples.
    samples : Dataset
    always : bool
        Also of logs whose torque was measured.
    """
    found = _find_record(joint_log(robot, log), samples, always=always)
    if found is None:
        return None
    record, note = found
    motion = complete_along(robot, samples.motion, record)
    if motion is None:
        return None
    # Both have one sign: the error of an expected sign depends on neither.
    motion = replace(motion, smooth_v=samples.motion.smooth_v)
    return replace(
        samples,
        instrument=motion,
        notes=(*samples.notes, note),
    )


def _find_record(log: Log, samples: Dataset, *, always: bool) -> SecondRecord | None:
    """Return a second record of the motion of a log at the joints; None if there is none."""
    if log.rollout is not None:
        motion = _derive(log.rollout, log, samples.cutoff)
        return motion, "the instruments' motion is that of the robot rolled out from commands"
    if not always:
        return None
    found = find_series(log)
    if not found:
        return None
    series = min(found.values(), key=lambda x: x.score)
    return series.motion, f"the instruments' motion: {series.note}"


def complete_along(robot: Robot, measured: Motion, other: Sequence[Array] | Array) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    If a loop stays open at a sample, the measured motion is kept there.

    Parameters
    ----------
    robot : Robot
    measured : Motion
    other : sequence of (N, n)
        Position, velocity and acceleration of the actuated joints at all N rows of the log.
    """
    try:
        q, dq, ddq = (x[measured.kept] for x in other)
        found = complete_motion(robot, measured.t, q, dq, ddq, measured.touch)
    except ClosureError:
        return None
    if len(found) < (1.0 - RULES.small) * len(measured):
        return None
    same = ("t", "kept", "smooth_v")
    mixed: Fields = {k: x.copy() for k, x in measured.each.items() if k not in same}
    for name, values in mixed.items():
        values[found.kept] = getattr(found, name)
    return replace(measured, **mixed)


def _derive(q: Array, log: Log, cutoff: float | None) -> tuple[Array, Array, Array]:
    """Return positions, low-passed and differentiated as those of a log."""
    dt = signals.sampling_step(log.t)
    q = q if cutoff is None else signals.lowpass(q, dt, cutoff)
    dq = signals.differentiate(q, dt)
    return q, dq, signals.differentiate(dq, dt)


# The noise of a motion once more.


def noise_again(log: Log, rng: np.random.Generator) -> Log:
    """Return a log with additional noise, as much as its measured motion has."""

    def more(x: Array) -> Array:
        return x + measured_noise(x, log.t) * rng.standard_normal(x.shape)

    dq, ddq = (None if x is None else more(x) for x in (log.dq, log.ddq))
    base = log.base
    if base is not None:
        filtered = base[:, : UP.start]
        unfiltered = base[:, UP.start :]
        base = np.column_stack([more(filtered), unfiltered])
    return replace(log, q=more(log.q), dq=dq, ddq=ddq, base=base)
