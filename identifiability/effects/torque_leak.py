"""Torque of another joint that leaks into what is measured at this one."""

from dataclasses import replace
from typing import ClassVar

from identifiability.effects.effect import Effect, Shaped
from identifiability.effects.family import Span, actuated_joints
from identifiability.effects.nominal import needs_masses
from identifiability.effects.registry import declare
from identifiability.effects.time_delay import nominal_torque
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Axis, Motion, Robot


def other_joints(span: Span) -> tuple[float, ...]:
    """Return the numbers of all joints but this one, from one on."""
    joints = span.robot.joints if span.robot is not None else ()
    return tuple(float(k) for k, name in enumerate(joints, 1) if name != span.joint)


def is_alone(robot: Robot, _place: str) -> str:
    """Return that there is no other joint, if so."""
    return "" if len(robot.joints) > 1 else "there is no other joint"


def _refuse(robot: Robot, place: str) -> str:
    return is_alone(robot, place) or needs_masses(robot, place)


class FromJoint(Shaped):
    """What comes from another joint, whose number is the shape, counted from one."""

    #: Units at an axis that turns from one that slides, and the other way round.
    crossed: ClassVar[tuple[str, str]] = ("m", "1/m")

    def axes(self, robot: Robot) -> list[Axis]:
        """Return those of joints, without the motors that mix them."""
        joints = robot.axes[: len(robot.actuated)] if len(robot.joints) > 1 else ()
        asked = {a.name for a in super().axes(robot)}
        return [a for a in joints if a.name in asked]

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one kind, which says where it comes from."""
        return (f"{self.units[0][0]}_{robot.joints[self.origin(robot, axis)]}",)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return one for every joint, in the unit between the two."""
        crossed = {}
        for axis in self.axes(robot):
            other = robot.axes[self.origin(robot, axis)]
            if axis.prismatic != other.prismatic:
                crossed[axis.name] = self.crossed[axis.prismatic]
        every = super().parameters(robot)
        return tuple(replace(p, unit=crossed.get(p.owner, p.unit)) for p in every)

    def origin(self, robot: Robot, axis: Axis) -> int:
        """Return the index of the joint that it comes from.

        Raises
        ------
        ModelError
            If there is none of that number, or it is this one.
        """
        number = self.shape(robot, axis)
        names = robot.joints
        if number not in range(1, len(names) + 1) or names[int(number) - 1] == axis.name:
            raise ModelError(
                f"{self.name} at '{axis.name}' comes from joint {number:g}; give the number of "
                f"another joint, from 1 to {len(names)}."
            )
        return int(number) - 1

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the number of the joint before, of the second one at the first."""
        return float(robot.joints.index(axis.name) or 2)

    def fill_from(self, robot: Robot, source: Array, out: Array) -> None:
        """Write what a source (N, n) has at the other joint."""
        for k, axis in enumerate(self.axes(robot)):
            out[:, robot.joints.index(axis.name), k] = source[:, self.origin(robot, axis)]


def first_origin(effect: Effect, robot: Robot) -> int:
    """Return the index of the joint that an effect at one joint comes from."""
    assert isinstance(effect, FromJoint)
    return effect.origin(robot, effect.axes(robot)[0])


@declare(
    "torque leaking from another joint",
    actuated_joints,
    shapes=other_joints,
    origin=first_origin,
    refuse=_refuse,
    against="load",
    needs="coulomb_friction",
    loaded=True,
    told_by="move one joint while the others stand still",
    rank=12.2,
)
class TorqueLeak(FromJoint):
    """``τ = c τ_other``: cross-talk of sensors and currents, cables that run through a joint.

    The torque that leaks is that of the robot file's values, since a measured one would bring its
    noise into the column. Its shape is the number of the joint that it comes from.
    """

    name = "torque_leak"
    equation = "τ = c τ_other"
    source = "drive gains [Gautier & Briot 2014] off the diagonal"
    units = (("from", "1", "1"),)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column a joint."""
        if out.shape[2]:
            self.fill_from(robot, nominal_torque(robot, motion), out)
