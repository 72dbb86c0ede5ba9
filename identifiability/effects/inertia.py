"""Inertia: bodies, rotors and drives, and a load that the robot file does not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pinocchio as pin

from identifiability.foundation.names import (
    INERTIAL_KINDS,
    Array,
    Parameter,
    Strings,
    inertial_unit,
)
from identifiability.robot import Axis, Motion, Robot
from identifiability.robot.closure import tree_motion
from identifiability.robot.robot import last_bodies

from .effect import Along, AlongAxes, Effect, Part, Placed, in_motor
from .registry import declare

# Rigid-body dynamics: ten inertial parameters a body, by Pinocchio's joint torque regressor.


def _inner_bodies(robot: Robot) -> Strings:
    """Return the bodies that carry others: a wrong last one is a payload."""
    return tuple(b for b in robot.bodies if b not in last_bodies(robot))


#: Kinds on which the weight of a body depends.
WEIGHT = ("m", "mx", "my", "mz")
#: Kinds that no body can have below zero.
_NONNEGATIVE = ("m", "Ixx", "Iyy", "Izz")


@declare("wrong masses", _inner_bodies, fixed_only=True, native=True)
class RigidBody(Effect):
    """Inertia and gravity: ``τ = K(q, q̇, q̈) π`` projected on the actuated joints.

    For a closed chain the projection is ``W = K_i - Xᵀ K_e``.
    """

    name = "rigid_body"
    equation = "τ = (K_i − Xᵀ K_e) π"
    source = "[Díaz 2010, Eq. 7]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return m, mx, my, mz, Ixx … of every moving body."""
        return tuple(
            Parameter(
                body,
                kind,
                inertial_unit(kind),
                self.name,
                robot.symbols.get(body, body),
                nonnegative=kind in _NONNEGATIVE,
                stated_as=kind,
            )
            for body in robot.bodies
            for kind in INERTIAL_KINDS
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write 10 columns a body."""
        model = robot.model
        data = robot.model.createData()
        regressor = pin.computeJointTorqueRegressor
        direct = motion.X is None and np.array_equal(robot.actuated, np.arange(robot.nv))
        # The tree's rows go to a buffer of their own only where they must be combined.
        K = out if direct else np.empty((len(motion), robot.nv, out.shape[2]))
        bodies = K[:, : model.nv]
        K[:, model.nv :] = 0.0  # tendons carry none
        carriers = np.array(robot.carriers)[:, None] - 1
        columns = (np.arange(10) + 10 * carriers).ravel()
        every = len(robot.carriers) == model.njoints - 1  # a view of them costs nothing
        for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
            own = regressor(model, data, q, v, a)
            bodies[k] = own if every else own[:, columns]
        if direct:
            return
        out[:] = K[:, robot.actuated]
        if motion.X is not None:
            out -= motion.X.transpose(0, 2, 1) @ K[:, robot.dependent]


# The inertia of rotor and drive.


@declare("actuator inertia", alike=True, refuse=in_motor, native=True)
class ActuatorInertia(AlongAxes):
    """``τ = Ia q̈``: rotor and drive inertia referred to the joint.

    A torque sensor behind the gear does not measure it. Passive joints have one where the robot
    file states it. Where the robot's sidecar names several parts (rotor and screw), each has a
    column; they are equal, so one group contains both.
    """

    name = "actuator_inertia"
    equation = "τ = Ia q̈"
    source = "[Díaz 2010, Eq. 12]"
    units = (("Ia", "kg·m²", "kg"),)
    nonnegative = True
    stated_as = ("armature",)
    of_drive = True

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a rotor."""
        first = robot.inertia_parts[0]
        loaded = [a for a in robot.passive_axes if robot.nominal.get(f"{a.name}.{first}")]
        return [*robot.axes, *loaded]

    def kinds(self, robot: Robot, axis: Axis) -> Strings:
        """Return the parts of a rotor."""
        del axis
        return robot.inertia_parts

    def curves(self, at: Along) -> list[Array]:
        """Return the acceleration, once for every part."""
        return [at.acceleration] * len(at.robot.inertia_parts)


# A load at the end of the robot that the robot file does not have.
#
# Where every mass is refitted a payload is part of the last body and not separable from it; it
# matters for the simulation with the file's own values.


@declare(
    "a payload (or wrong masses of the last body)",
    last_bodies,
    against="position",
    fixed_only=True,
    native=True,
)
class Payload(Effect):
    """``τ = K_body [m mx my mz Ixx …]``: a load fixed to a last body of the robot.

    In a refit it is equal to mass and moments of that body; a file adds it to them.

    A drive may remove the weight of the robot alone from the torque. The torque then has the
    weight of the payload only, under the gravity of the shape. Its inertia is part of the body's.

    Parameters
    ----------
    gravity : (3,), optional [m/s²]
        Gravity that acts on the payload alone.
    """

    name = "payload"
    equation = "τ = K_body [m mx my mz Ixx Ixy Iyy Ixz Iyz Izz]ᵀ"
    source = "[Khalil 2007, Eq. 6]"
    shape_size: ClassVar[int] = 3

    def __init__(self, gravity: Sequence[float] | Array | None = None) -> None:
        self.gravity = None if gravity is None else tuple(map(float, gravity))

    @property
    def texts(self) -> Strings:
        """How a ladder file writes the effect."""
        if self.gravity is None:
            return (self.name,)
        return (f"{self.name}@*:{','.join(map(repr, self.gravity))}",)

    def about(self, shape: Sequence[float]) -> Payload:
        """Return the effect whose weight alone acts, under a gravity."""
        return Payload(shape)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters of the payload on every last body: ten, or four of its weight."""
        inertial = _on_last_bodies(robot).parameters(robot)
        if self.gravity is None:
            return tuple(self._rename(p, "payload") for p in inertial)
        weight = [replace(p, stated_as="") for p in inertial if p.kind in WEIGHT]
        return tuple(self._rename(p, "weight") for p in weight)

    def _rename(self, parameter: Parameter, prefix: str) -> Parameter:
        kind = f"{prefix}_{parameter.kind}"
        return replace(parameter, kind=kind, group=self.name, nonnegative=False)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the rigid-body columns of the last bodies."""
        bodies = _on_last_bodies(robot)
        if self.gravity is None:
            bodies.fill(robot, motion, out)
            return
        acts = [p.kind in WEIGHT for p in bodies.parameters(robot)]
        for sign in (1.0, -1.0):
            model = robot.model.copy()
            model.gravity.linear = sign * np.array(self.gravity)
            columns = np.zeros((*out.shape[:2], len(acts)))
            bodies.fill(replace(robot, model=model), motion, columns)
            out += 0.5 * sign * columns[:, :, acts]


def _on_last_bodies(robot: Robot) -> Placed:
    rigid = RigidBody()
    return Placed([Part(rigid, body) for body in last_bodies(robot)])
