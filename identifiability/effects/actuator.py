"""What the actuators add: the inertia of rotor and drive, and a constant torque offset."""

from __future__ import annotations

from identifiability.effects.effect import Effect, axis_motion, put
from identifiability.effects.friction import joint_parameter
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class ActuatorInertia(Effect):
    """``τ = Ia q̈``: rotor and drive inertia referred to the joint [Díaz 2010, Eq. 12].

    Passive joints have one where the robot file states it.

    Where the robot's sidecar names several parts (rotor and screw), each has a column; they are
    equal, and the grouping says so.
    """

    name = "actuator_inertia"
    equation = "τ = Ia q̈"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the inertia parts of every axis."""
        return tuple(
            joint_parameter(axis, kind, self.name)
            for axis in _turned_axes(robot)
            for kind in robot.inertia_parts
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the same column for every part of an axis."""
        parts = len(robot.inertia_parts)
        for k, axis in enumerate(_turned_axes(robot)):
            _, acceleration, row = axis_motion(robot, motion, axis)
            for part in range(parts):
                put(out, parts * k + part, row, acceleration)


def _turned_axes(robot: Robot) -> list[Axis]:
    """Return actuated joints and coupled motors, and the passive joints with a rotor."""
    first = robot.inertia_parts[0]
    loaded = [a for a in robot.passive_axes if robot.nominal.get(f"{a.name}.{first}")]
    return [*robot.axes, *loaded]


class TorqueOffset(Effect):
    """A constant torque at every axis: sensor bias or current offset."""

    name = "torque_offset"
    equation = "τ = off"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return one offset an axis of an actuated joint."""
        joints = robot.axes[: len(robot.actuated)]
        return tuple(joint_parameter(a, "off", self.name) for a in joints)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one constant column a joint."""
        for k in range(len(robot.actuated)):
            out[:, k, k] = 1.0
