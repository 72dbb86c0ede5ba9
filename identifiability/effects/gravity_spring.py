"""Springs and counterweights whose torque goes with the sine of an angle."""

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import POSTURES, every_axis
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


def _hinges(robot: Robot) -> tuple[str, ...]:
    slides = {a.name for a in (*robot.axes, *robot.passive_axes) if a.prismatic}
    return tuple(name for name in every_axis(robot) if name not in slides)


@declare(
    "gravity spring or counterweight",
    _hinges,
    against="position",
    told_by=POSTURES,
    rank=21,
    late=True,
)
class GravitySpring(AlongAxes):
    """``τ = k sin(q − q₀) = ks sin q + kc cos q``: a spring that balances gravity about a joint.

    Of a zero-free-length spring between a lever and the frame k is its stiffness times both arms;
    of a counterweight it is m g r. ``k² = ks² + kc²`` and ``tan q₀ = −kc / ks``. Where the gravity
    of what the joint carries depends on its angle alone, it looks exactly like that.

    A counterweight that is fixed to a link needs no effect: it is part of that body's mass and
    first moments. One behind a gear, a belt or a rod that turns with a joint is this, and its
    inertia m r² is in the joint's `actuator_inertia`; a weight on a rope is a `constant_force`
    along the tendon or axis that the rope is.
    """

    name = "gravity_spring"
    equation = "τ = k sin(q − q₀) = ks sin q + kc cos q"
    source = "[Herder 2001, Sec. 3.2]"
    units = (("ks", "N·m", "N"), ("kc", "N·m", "N"))

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes that turn: of actuated joints and coupled motors, then passive joints."""
        return [a for a in (*robot.axes, *robot.passive_axes) if not a.prismatic]

    def curves(self, at: Along) -> list[Array]:
        """Return sine and cosine of the angle as the robot file counts it."""
        return [np.sin(at.position), np.cos(at.position)]
