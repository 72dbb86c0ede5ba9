"""Limits of speed that files of a robot state: the sidecar, else the velocities of a URDF."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.description import Description

#: A speed from which on a file means that there is no limit [rad/s or m/s].
ENDLESS = 1e6


def stated_speeds(robot: Description) -> Array:
    """Return limits of speed, (n,) [rad/s or m/s]; infinite where no file states one."""
    speeds = robot.speed_limits.copy()
    of_file = np.asarray(() if robot.mjcf else robot.model.velocityLimit, float)
    for k, name in enumerate(robot.joints):
        joint = robot.tree.single.get(name)
        if joint is None or not np.isinf(speeds[k]) or joint.iv >= len(of_file):
            continue
        if 0 < of_file[joint.iv] < ENDLESS:  # zero where the file is silent
            speeds[k] = of_file[joint.iv]
    return speeds
