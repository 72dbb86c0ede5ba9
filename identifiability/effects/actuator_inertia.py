"""The inertia of rotor and drive."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import in_motor
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


def _unseen(robot: Robot, place: str) -> str:
    """Return why a joint cannot have an inertia of its rotor."""
    if robot.torque.side == "link":
        return "torque was measured behind the gears, where no inertia of rotors is seen"
    return in_motor(robot, place)


@declare("actuator inertia", alike=True, basic=True, refuse=_unseen, native=True, rank=4)
class ActuatorInertia(AlongAxes):
    """``τ = Ia q̈``: rotor and drive inertia referred to the joint.

    A torque sensor behind the gear sees nothing of it. Passive joints have one where the robot
    file states it. Where the robot's sidecar names several parts (rotor and screw), each has a
    column; they are equal, and the grouping says so.
    """

    name = "actuator_inertia"
    equation = "τ = Ia q̈"
    source = "[Díaz 2010, Eq. 12]"
    units = (("Ia", "kg·m²", "kg"),)
    nonnegative = True
    stated_as = ("armature",)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a rotor."""
        first = robot.inertia_parts[0]
        driven = () if robot.torque.side == "link" else robot.axes
        loaded = [a for a in robot.passive_axes if robot.nominal.get(f"{a.name}.{first}")]
        return [*driven, *loaded]

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return the parts of a rotor."""
        del axis
        return robot.inertia_parts

    def curves(self, at: Along) -> list[Array]:
        """Return the acceleration, once for every part."""
        return [at.acceleration] * len(at.robot.inertia_parts)
