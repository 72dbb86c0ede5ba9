"""Torque of effects that are in the data and not in the robot file.

Written as laws of the motion, apart from the columns in `effects`; size is a share of the joint's
torque, so that one word describes a hidden effect on any robot.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.simulation import forces
from identifiability.simulation.forces import Hidden
from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque
from identifiability.simulation.prescribed import PrescribedMotion

#: Angle, mass and time constants of effects of the whole robot before they are scaled.
SMALL_ANGLE = 1e-3
SMALL_MASS = 0.1


def hidden_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the torque of a hidden effect, scaled to a share of the torque, (N, n).

    Raises
    ------
    IdentifiabilityError
        If the effect or the joint is not in this robot.
    """
    if hidden.name == forces.HIDDEN_PASSIVE:
        return _passive(robot, rigid, tau, hidden)
    if hidden.name in ("gravity_tilt", "payload"):
        return _whole(robot, move, rigid, tau, hidden)
    out = np.zeros_like(tau)
    home = robot.actuated_positions(robot.home[None])[0]
    for k in _chosen(robot.joints, hidden, robot):
        law = hidden.law or forces.HIDDEN.get(hidden.name)
        if law is not None:
            force = law(move.dq[:, k], move.q[:, k] - home[k], rigid.tau[:, k])
        else:
            force = _record(move, tau, k, hidden.name)
        out[:, k] = forces.scaled(force, tau[:, k], hidden.share)
    return out


def _chosen(names: Sequence[str], hidden: Hidden, robot: Robot) -> list[int]:
    for joint in hidden.joints:
        if joint not in names:
            raise IdentifiabilityError(
                f"{hidden.name} cannot be hidden in '{joint}' of {robot.name}"
                f"{near_match(joint, names)} It can be in {listing(names)}."
            )
    return [k for k, name in enumerate(names) if not hidden.joints or name in hidden.joints]


def _record(move: PrescribedMotion, tau: Array, k: int, name: str) -> Array:
    """Return what a late, leaking or drifting torque sensor adds to joint k, (N,)."""
    if name == "time_delay":
        step = np.median(np.diff(move.t))
        seams = np.flatnonzero(np.diff(move.t) > 3 * step) + 1
        parts = [np.gradient(part) for part in np.split(tau[:, k], seams)]
        return -np.concatenate(parts)
    if name == "torque_leak":
        return tau[:, (k + 1) % tau.shape[1]]
    # Warming up after a calibration in the middle: a drift about zero, or it were an offset.
    drift = 1.0 - np.exp(-(move.t - move.t[0]) / (0.5 * np.ptp(move.t) or 1.0))
    centred: Array = drift - drift.mean()
    return centred


def _passive(robot: Robot, rigid: RigidTorque, tau: Array, hidden: Hidden) -> Array:
    axes = robot.passive_axes
    if not axes:
        raise IdentifiabilityError(
            f"{robot.name} has no passive joints, so {hidden.name} cannot be hidden in it."
        )
    out = np.zeros_like(tau)
    for at in _chosen([a.name for a in axes], hidden, robot):
        k = int(np.flatnonzero(robot.dependent == axes[at].dof)[0])
        speed = rigid.passive_v[:, k]
        typical = float(np.sqrt(np.mean(speed**2))) or 1.0
        out -= (np.sign(speed) + speed / typical)[:, None] * rigid.X[:, k]
    return _sized(out, tau, hidden.share)


def _whole(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, hidden: Hidden
) -> Array:
    """Return the difference that a tilted base or a load at the tip makes to MuJoCo's torque."""
    other = MujocoRobot(robot)
    if hidden.name == "gravity_tilt":
        g = np.array(other.model.opt.gravity)
        other.model.opt.gravity[:] = g + SMALL_ANGLE * np.cross([0.6, 0.8, 0.0], g)
    else:
        tip = np.flatnonzero(other.model.body_weldid)[-1]  # the last body that moves
        other.model.body_mass[tip] += SMALL_MASS
    changed = other.inverse_dynamics(move.q, move.dq, move.ddq)
    return _sized(changed.tau - rigid.tau, tau, hidden.share)


def _sized(out: Array, tau: Array, share: float) -> Array:
    size = float(np.sqrt(np.mean(out**2)))
    scaled: Array = out * (share * np.sqrt(np.mean(tau**2)) / size) if size > 0 else out
    return scaled
