"""Springs along joints."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import POSTURES
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot
from identifiability.robot.along import rest_along


def _springs(robot: Robot) -> bool:
    return any(name.endswith(".K") and value for name, value in robot.nominal.items())


@declare(
    "joint stiffness", against="position", stated=_springs, native=True, told_by=POSTURES, rank=10
)
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
    nonnegative = True
    stated_as = ("stiffness",)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, and the passive joints with a spring."""
        return [*robot.axes, *(a for a in robot.passive_axes if a.name in robot.rest)]

    def curves(self, at: Along) -> list[Array]:
        """Return how far the axis is from where its spring is relaxed."""
        return [at.position - rest_along(at.robot, at.axis)]
