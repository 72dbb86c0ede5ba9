"""Another motion of the actuated joints at the samples of a measured one, with all loops closed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot, complete_motion

#: Share of samples at which the loops may stay open along another motion.
OPEN = 0.02


def complete_along(
    robot: Robot, measured: Motion, other: Sequence[Array], instead: Motion | None = None
) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    Parameters
    ----------
    robot : Robot
    measured : Motion
    other : sequence of (N, n)
        Position, velocity and acceleration of the actuated joints at all N rows of the log.
    instead : Motion, optional
        What stands for it where a loop stays open; by default the measured motion.
    """
    try:
        found = complete_motion(robot, measured.t, *(x[measured.kept] for x in other))
    except ClosureError:
        return None
    if len(found) < (1.0 - OPEN) * len(measured):
        return None
    if len(found) == len(measured):
        return replace(found, kept=measured.kept, start=measured.start)
    return put(measured if instead is None else instead, found.kept, found)


def put(motion: Motion, rows: np.ndarray, other: Motion) -> Motion:
    """Return a motion with another one at some samples."""
    same = ("t", "kept", "smooth_v")
    mixed: dict[str, Any] = {k: x.copy() for k, x in motion.each.items() if k not in same}
    for name, values in mixed.items():
        values[rows] = getattr(other, name)
    return replace(motion, **mixed)
