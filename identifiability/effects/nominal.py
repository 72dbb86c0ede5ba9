"""Torque by the robot file's values, or a fit's: the load that some effects depend on."""

from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from identifiability.foundation.linalg import without_rounding
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName
from identifiability.robot import Motion, Robot
from identifiability.robot.closure import hold_weight, project, tree_motion

#: Torque of a robot along a motion, (N, n) [N·m or N].
Torque = Callable[[Robot, Motion], Array]


def once(torque: Torque) -> Torque:
    """Return a torque that is computed once for a robot's motion and cached with the motion.

    A dictionary asks dozens of effects about one motion, and many of them for the same load.
    """
    found: WeakKeyDictionary[Motion, tuple[Robot, Array]] = WeakKeyDictionary()

    @wraps(torque)
    def known(robot: Robot, motion: Motion) -> Array:
        of, tau = found.get(motion, (None, None))
        if of is not robot or tau is None:
            tau = torque(robot, motion)
            tau.flags.writeable = False
            found[motion] = robot, tau
        return tau

    return known


def reference_values(robot: Robot) -> NumberByName:
    """Return the standard parameters that give the loads of the robot."""
    if robot.reference:
        return robot.reference
    values = dict(robot.nominal)
    for k, body in zip(robot.carriers, robot.bodies, strict=True):  # a sidecar's are no loads
        inertia = robot.model.inertias[k]
        theta = inertia.toDynamicParameters().tolist()
        values |= zip((f"{body}.{kind}" for kind in INERTIAL_KINDS), theta, strict=True)
    return values


def load_model(robot: Robot) -> Any:
    """Return the Pinocchio model with the bodies that give the loads."""
    if not robot.reference:
        return robot.model
    model = robot.model.copy()
    for k, body in zip(robot.carriers, robot.bodies, strict=True):
        theta = np.array([robot.reference.get(f"{body}.{kind}", 0.0) for kind in INERTIAL_KINDS])
        model.inertias[k] = pin.Inertia.FromDynamicParameters(theta)
    return model


@once
def rigid_torque(robot: Robot, motion: Motion) -> Array:
    """Return the rigid-body torque of the actuated joints by the known masses, (N, n)."""
    model = load_model(robot)
    data = model.createData()
    tree = np.empty((len(motion), model.nv))
    for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
        tree[k] = pin.rnea(model, data, q, v, a)
    tau = project(robot, motion, tree)
    return without_rounding(tau, tau)


def position_slopes(robot: Robot, motion: Motion) -> Iterator[Array]:
    """Yield the derivative of `rigid_torque` (N, n) with respect to the position of each joint."""
    model = load_model(robot)
    data = model.createData()
    slopes = np.empty((len(motion), model.nv, model.nv))
    for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
        slopes[k] = pin.computeRNEADerivatives(model, data, q, v, a)[0]
    for column in slopes.transpose(2, 0, 1):
        yield project(robot, motion, column)


def gravity_torque(robot: Robot, motion: Motion, gravity: Array) -> Array:
    """Return the torque that holds the file's masses against a gravity vector, (N, n).

    Parameters
    ----------
    robot : Robot
    motion : Motion
    gravity : (3,) [m/s²]
    """
    model = load_model(robot).copy()
    model.gravity.linear = gravity
    return hold_weight(robot, motion, model)


def has_masses(robot: Robot) -> bool:
    """Whether the file states a mass for any body, and none is a guess."""
    masses = [robot.nominal.get(f"{b}.m", 0.0) for b in robot.bodies]
    return not robot.guessed and any(mass > 0 for mass in masses)


def needs_masses(robot: Robot, _place: str) -> str:
    """Return why an effect that depends on the load makes no sense; empty if it does."""
    if not has_masses(robot):
        return f"{robot.path.name} states no masses, so the load is not known"
    if robot.base is not None and robot.base.pressed:
        return "forces that press on its limbs are part of the load, and no model of them is known"
    return ""
