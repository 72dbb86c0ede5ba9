"""The inertia of rotor and drive."""

from __future__ import annotations

from collections.abc import Sequence

from identifiability.effects.effect import AlongAxes, axis_motion
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class ActuatorInertia(AlongAxes):
    """``τ = Ia q̈``: rotor and drive inertia referred to the joint.

    Passive joints have one where the robot file states it. Where the robot's sidecar names several
    parts (rotor and screw), each has a column; they are equal, and the grouping says so.
    """

    name = "actuator_inertia"
    equation = "τ = Ia q̈"
    source = "[Díaz 2010, Eq. 12]"
    units = (("Ia", "kg·m²", "kg"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a rotor."""
        first = robot.inertia_parts[0]
        loaded = [a for a in robot.passive_axes if robot.nominal.get(f"{a.name}.{first}")]
        return [*robot.axes, *loaded]

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return the parts of a rotor."""
        del axis
        return robot.inertia_parts

    def unit(self, kind: str, axis: Axis) -> str:
        """Return the unit, whatever the part is called."""
        del kind
        return super().unit("Ia", axis)

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the acceleration, once for every part."""
        return [axis_motion(robot, motion, axis)[1]] * len(robot.inertia_parts)


def in_motor(robot: Robot, place: str) -> str:
    """Return why a passive joint cannot have what motors have."""
    return "a passive joint has no motor" if place in robot.passive else ""


register(
    Family(
        ActuatorInertia(),
        "actuator inertia",
        positive=True,
        alike=True,
        basic=True,
        refuse=in_motor,
        held={"mjcf": "armature"},
        native=True,
        rank=4,
    )
)
