"""A constant torque at every actuated joint."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import RESTS, actuated_joints, in_motor
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


@declare(
    "torque offset",
    actuated_joints,
    basic=True,
    refuse=in_motor,
    native=True,
    told_by=RESTS,
    rank=5,
)
class TorqueOffset(AlongAxes):
    """A constant torque: sensor bias or current offset."""

    name = "torque_offset"
    equation = "τ = off"
    units: tuple[tuple[str, str, str], ...] = (("off", "N·m", "N"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return those of joints, without the motors that mix them."""
        return robot.axes[: len(robot.actuated)]

    def curves(self, at: Along) -> list[Array]:
        """Return one everywhere."""
        return [at.ones]
