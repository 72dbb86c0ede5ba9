"""Torque that the robot file's own values predict: the load that some effects depend on."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from identifiability.names import Array
from identifiability.robot import Motion, Robot


def project(robot: Robot, motion: Motion, tree: Array) -> Array:
    """Return the torque of the actuated joints (N, n) from that of the tree (N, nv)."""
    tau: Array = tree[:, robot.actuated]
    if motion.X is not None:
        tau = tau - np.einsum("nij,ni->nj", motion.X, tree[:, robot.dependent])
    return tau


def rigid_torque(robot: Robot, motion: Motion) -> Array:
    """Return the rigid-body torque of the actuated joints by the file's masses, (N, n)."""
    model, data = robot.model, robot.model.createData()
    tree = [
        pin.rnea(model, data, q, v, a) - model.armature * a  # rotors are no load
        for q, v, a in zip(motion.q, motion.v, motion.a, strict=True)
    ]
    return project(robot, motion, np.array(tree).reshape(len(motion), robot.nv))


def gravity_torque(robot: Robot, motion: Motion, gravity: Array) -> Array:
    """Return the torque that holds the file's masses against a gravity vector, (N, n).

    Parameters
    ----------
    robot : Robot
    motion : Motion
    gravity : (3,) [m/s²]
    """
    model = robot.model.copy()
    model.gravity.linear = gravity
    data = model.createData()
    tree = [pin.computeGeneralizedGravity(model, data, q).copy() for q in motion.q]
    return project(robot, motion, np.array(tree).reshape(len(motion), robot.nv))


def gravity_vector(robot: Robot) -> Array:
    """Return the gravity that the file states [m/s²]."""
    return np.array(robot.model.gravity.linear)


def has_masses(robot: Robot) -> bool:
    """Whether the file states a mass for any body."""
    return any(robot.nominal.get(f"{b}.m", 0.0) > 0 for b in robot.bodies)
