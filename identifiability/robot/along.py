"""Along a motion: positions of axes, and torque that is known or holds the file's weight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.names import Array
from identifiability.robot.closure import Motion
from identifiability.robot.description import Description
from identifiability.robot.parts import Axis


def project(robot: Description, motion: Motion, tree: Array) -> Array:
    """Return the torque of the actuated joints (N, n) from that of the bodies' joints (N, nv)."""
    tendons = np.zeros((len(tree), robot.nv - tree.shape[1]))  # they carry no body
    tree = np.hstack([tree, tendons]) if tendons.shape[1] else tree
    tau: Array = tree[:, robot.actuated]
    if motion.X is not None:
        tau = tau - np.einsum("nij,ni->nj", motion.X, tree[:, robot.dependent])
    return tau


def tree_motion(robot: Description, motion: Motion) -> tuple[Array, Array, Array]:
    """Return the motion of the joints that Pinocchio has, all but tendons."""
    nq, nv = robot.model.nq, robot.model.nv
    return motion.q[:, :nq], motion.v[:, :nv], motion.a[:, :nv]


def hold_weight(robot: Description, motion: Motion, model: Any = None) -> Array:
    """Return the torque that holds the weight of the file's masses, (N, n) [N·m or N].

    Parameters
    ----------
    robot : Description
    motion : Motion
    model : pinocchio.Model, optional
        With other masses or another gravity.
    """
    model = robot.model if model is None else model
    data, tree = model.createData(), np.empty((len(motion), model.nv))
    for k, q in enumerate(tree_motion(robot, motion)[0]):
        tree[k] = pin.computeGeneralizedGravity(model, data, q)
    return project(robot, motion, tree)


def known_torque(robot: Description, motion: Motion) -> Array:
    """Return the torque of the actuated joints that is known beforehand, (N, n) [N·m or N].

    Where measured torque is compensated for gravity, less what holds the file's weight.

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
    compensated = [robot.torque.is_compensated(joint) for joint in robot.joints]
    if any(compensated):
        tau -= np.where(compensated, hold_weight(robot, motion), 0.0)
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
