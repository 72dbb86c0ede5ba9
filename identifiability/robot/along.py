"""Positions of axes along a motion, and torque that is known as a function of them."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.closure import Motion
from identifiability.robot.description import Description
from identifiability.robot.parts import Axis


def known_torque(robot: Description, motion: Motion) -> Array:
    """Return the torque of the actuated joints that is known beforehand, (N, n) [N·m or N].

    Raises
    ------
    RobotError
        If a position lies where it is not known.
    """
    tau = np.zeros(motion.actuated_q.shape)
    axes = {a.name: a for a in (*robot.axes, *robot.passive_axes)}
    for known in robot.known_torque:
        axis = axes[known.along]
        force = known.force(robot.travel(axis, motion.q))
        if axis.row is not None:
            tau += force[:, None] * axis.row
        elif motion.X is not None:
            at = int(np.flatnonzero(robot.dependent == axis.dof)[0])
            tau -= force[:, None] * motion.X[:, at]
    return tau


def rest_along(robot: Description, axis: Axis) -> float:
    """Return where a spring along an axis is relaxed [rad or m]."""
    if axis.name in robot.rest and (axis.row is None or axis.weights is not None):
        return robot.rest[axis.name]
    home = robot.actuated_positions(robot.home[None])[0]
    if axis.row is None:
        return float(robot.travel(axis, robot.home[None])[0])
    rest = [robot.rest.get(j, zero) for j, zero in zip(robot.joints, home, strict=True)]
    return float(np.asarray(rest) @ axis.row)
