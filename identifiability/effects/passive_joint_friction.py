"""Friction in the joints of a closed chain that have no motor."""

from collections.abc import Sequence

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


def _cables(robot: Robot) -> bool:
    """Whether the file states the friction of a tendon, which is there for its force alone."""
    names = [t.name for t in robot.cables if t.name in robot.passive]
    return any(robot.nominal.get(f"{name}.{kind}") for name in names for kind in ("Fv", "Fc"))


@declare(
    "friction in passive joints",
    lambda robot: tuple(a.name for a in robot.passive_axes),
    stated=_cables,
    separate=True,
    native=True,
    rank=7,
)
class PassiveJointFriction(AlongAxes):
    """Viscous and Coulomb friction at passive joints, projected on the actuated ones by -Xᵀ."""

    name = "passive_joint_friction"
    equation = "τ = −Xᵀ (Fv q̇ₑ + Fc sign(q̇ₑ))"
    source = "[Díaz 2010, Eq. 10], projected as in [Díaz 2010, Eq. 7]"
    units = (("Fv", "N·m·s/rad", "N·s/m"), ("Fc", "N·m", "N"))
    nonnegative = True
    stated_as = ("damping", "frictionloss")

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return every passive joint of one degree of freedom."""
        return robot.passive_axes

    def curves(self, at: Along) -> list[Array]:
        """Return the speed and its sign."""
        return [at.speed, at.sign]
