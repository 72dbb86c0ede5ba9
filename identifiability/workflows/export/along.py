"""Forces along joints, motors and stated axes, in symbols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from identifiability.effects.position_torque import DEGREE, PositionTorque
from identifiability.effects.registry import FAMILIES
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot
from identifiability.robot.along import rest_along


@dataclass(frozen=True)
class Moving:
    """An axis in motion, and the effect along it.

    Attributes
    ----------
    ca : module
        CasADi.
    position, speed, acceleration : casadi.SX
        The position is as the robot file counts it.
    home, rest : float [rad or m]
        Positions at home, and where a spring is relaxed.
    kind : str
        Of the parameter.
    shape : float
        Of the effect; 1 where it has none.
    first : int
        Where the pieces of a curve begin, in distances from home; `last` where they end.
    """

    ca: Any
    position: Any
    speed: Any
    acceleration: Any
    home: float
    rest: float
    kind: str
    shape: float
    first: int = 0
    last: int = 0


def _dry(m: Moving) -> Any:
    way = m.ca.sign(m.speed)
    ways = {"Fc": way, "Fc+": 0.5 * (way * way + way), "Fc-": 0.5 * (way - way * way)}
    return ways[m.kind]


def _ripple(m: Moving) -> Any:
    phase = (m.position - m.home) * (2 * np.pi / m.shape)
    return m.ca.sin(phase) if m.kind in ("Rs", "Ms") else m.ca.cos(phase)


def _piece(m: Moving) -> Any:
    """Return a cubic B-spline on an even grid, about its middle."""
    ca = m.ca
    x = ca.fmin(ca.fmax((m.position - m.home) / m.shape, m.first), m.last)
    middle = m.first + int(m.kind[1:]) - 1 - DEGREE + 0.5 * (DEGREE + 1)
    away = ca.fabs(x - middle)
    wide, narrow = ca.fmax(2 - away, 0), ca.fmax(1 - away, 0)
    return (wide * wide * wide - 4 * narrow * narrow * narrow) / 6


#: What multiplies a parameter of an effect.
CURVES: dict[str, Callable[[Moving], Any]] = {
    "viscous_friction": lambda m: m.speed,
    "coulomb_friction": _dry,
    "coulomb_asymmetry": _dry,
    "passive_joint_friction": lambda m: m.speed if m.kind == "Fv" else _dry(m),
    "actuator_inertia": lambda m: m.acceleration,
    "joint_stiffness": lambda m: m.position - m.rest,
    "torque_offset": lambda m: 1.0,
    "constant_force": lambda m: 1.0,
    "quadratic_friction": lambda m: m.ca.fabs(m.speed) * m.speed,
    "stribeck_friction": lambda m: m.ca.exp(-m.ca.fabs(m.speed / m.shape)) * m.ca.sign(m.speed),
    "free_spring": lambda m: m.position if m.kind == "k" else -1.0,
    "gravity_spring": lambda m: (m.ca.sin if m.kind == "ks" else m.ca.cos)(m.position),
    "position_ripple": _ripple,
    "position_torque": _piece,
    "rising_friction": lambda m: -m.ca.exp(-m.ca.fabs(m.speed / m.shape)) * m.ca.sign(m.speed),
    "sigmoid_friction": lambda m: m.ca.tanh(m.speed / m.shape),
    "position_friction": lambda m: _piece(m) * m.ca.sign(m.speed),
    "gear_ripple": _ripple,
}


def axis_row(robot: Robot, axis: Axis) -> Array:
    """Return the speed of an axis as a row of those of all joints, (nv,)."""
    row = np.zeros(robot.nv)
    if axis.row is not None:
        row[robot.actuated] = axis.row
    elif axis.weights is None:
        row[axis.dof] = 1.0
    else:
        row[[robot.dof_index(joint) for joint in axis.weights]] = [*axis.weights.values()]
    return row


def force_along(
    ca: Any, robot: Robot, axis: Axis, motion: tuple[Any, Any, Any], what: tuple[str, str, Any]
) -> Any:
    """Return the force along an axis per unit of a parameter.

    Parameters
    ----------
    ca : module
    robot : Robot
    axis : Axis
    motion : (nq,), (nv,), (nv,) of casadi.SX
        Positions, velocities and accelerations of all joints.
    what : (str, str, float or None)
        Effect, kind of its parameter, and its shape if it has one.
    """
    effect, kind, shape = what
    row, (q, v, a) = axis_row(robot, axis), motion
    places = {robot.dof_index(name): joint.iq for name, joint in robot.tree.single.items()}
    position = sum(row[dof] * q[places[dof]] for dof in np.flatnonzero(row).tolist())
    first = last = 0
    family = FAMILIES[effect]
    if family.build is not None and shape is None:
        shape = dict(family.effect.shapes(robot))[f"{axis.name}.{effect}"]
    own = family.at(shape, axis.name)
    if isinstance(own, PositionTorque):
        first, last = own.grid(robot, axis)
    moving = Moving(
        ca=ca,
        position=position,
        speed=ca.dot(ca.SX(row), v),
        acceleration=ca.dot(ca.SX(row), a),
        home=float(robot.travel(axis, robot.home[None])[0]),
        rest=rest_along(robot, axis),
        kind=kind,
        shape=1.0 if shape is None else shape,
        first=first,
        last=last,
    )
    return CURVES[effect](moving)
