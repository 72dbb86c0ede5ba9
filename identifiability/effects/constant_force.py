"""Constant-force springs."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import RESTS, every_axis
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


def _same_as_offset(robot: Robot, place: str) -> str:
    return "there it is a torque offset" if place in robot.joints else ""


@declare("constant force", every_axis, refuse=_same_as_offset, told_by=RESTS, rank=22, late=True)
class ConstantForce(AlongAxes):
    """``τ = F₀`` along a joint or a tendon: a constant-force spring, a weight on a rope.

    Along an actuated joint it is a torque offset; along a motor that mixes joints (a tendon) and
    along a passive joint it is a force of its own, which the mechanism turns into torques that
    change with its pose.
    """

    name = "constant_force"
    equation = "τ = F₀"
    source = "[Herder 2001, Sec. 2.3]"
    units = (("F0", "N·m", "N"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, then passive joints."""
        return [*robot.axes, *robot.passive_axes]

    def curves(self, at: Along) -> list[Array]:
        """Return one everywhere."""
        return [at.ones]
