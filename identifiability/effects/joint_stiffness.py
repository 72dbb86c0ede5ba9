"""Springs along joints."""

from __future__ import annotations

from collections.abc import Sequence

from identifiability.effects.effect import AlongAxes
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


def stretch(robot: Robot, motion: Motion, axis: Axis) -> Array:
    """Return how far an axis is from where its spring is relaxed, (N,) [rad or m]."""
    if axis.row is None:
        extended: Array = robot.dof_position(motion.q, axis.name) - robot.rest[axis.name]
        return extended
    home = robot.actuated_positions(robot.home[None])[0]
    rest = [robot.rest.get(j, at) for j, at in zip(robot.joints, home, strict=True)]
    position: Array = (motion.actuated_q - rest) @ axis.row
    return position


class JointStiffness(AlongAxes):
    """``τ = K (q − q_rest)``: a spring, a cable or a hose along the joint.

    It is relaxed where the robot file says, else at home; another neutral position adds a torque
    offset. Passive joints have one where the file states it. Over small angles it looks like
    gravity.
    """

    name = "joint_stiffness"
    equation = "τ = K (q − q_rest)"
    source = "[Khalil 2002, Sec. 9.4]"
    units = (("K", "N·m/rad", "N/m"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a spring."""
        return [*robot.axes, *(a for a in robot.passive_axes if a.name in robot.rest)]

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the stretch."""
        return [stretch(robot, motion, axis)]


def _springs(robot: Robot) -> bool:
    return any(name.endswith(".K") and value for name, value in robot.nominal.items())


register(
    Family(
        JointStiffness(),
        "joint stiffness",
        against="position",
        positive=True,
        stated=_springs,
        held={"mjcf": "stiffness"},
        native=True,
        told_by="move through the whole range of each joint with the others in other postures",
        rank=10,
    )
)
