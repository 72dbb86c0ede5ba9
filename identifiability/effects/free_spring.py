"""Springs of either sign, relaxed nobody knows where."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import POSTURES, every_axis
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


@declare(
    "spring with an unknown rest",
    every_axis,
    against="position",
    told_by=POSTURES,
    rank=20,
    late=True,
)
class FreeSpring(AlongAxes):
    """``τ = k (q − q₀) = k q − k q₀``: one spring by two parameters, linear in both.

    Its rest q₀ is the second parameter over the first. An extension spring that passes a dead
    centre pushes on: k may be negative. It is `joint_stiffness` with `torque_offset`, as one.
    """

    name = "free_spring"
    equation = "τ = k q − k q₀"
    source = "[Khalil 2002, Sec. 9.4]"
    units = (("k", "N·m/rad", "N/m"), ("kq0", "N·m", "N"))
    supersedes = ("joint_stiffness", "torque_offset")

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return actuated joints and coupled motors, then passive joints."""
        return [*robot.axes, *robot.passive_axes]

    def curves(self, at: Along) -> list[Array]:
        """Return the position as the robot file counts it, and a constant."""
        return [at.position, -at.ones]
