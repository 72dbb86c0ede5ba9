"""Friction that rises with speed to its level, instead of jumping there."""

from identifiability.effects.effect import Along
from identifiability.effects.family import SPEEDS
from identifiability.effects.registry import declare
from identifiability.effects.stribeck_friction import StribeckFriction, stribeck_velocities
from identifiability.foundation.names import Array


@declare(
    "friction that rises with speed to its level",
    shapes=stribeck_velocities,
    needs="viscous_friction",
    dry=True,
    continuous=True,
    told_by=SPEEDS,
    rank=6.1,
)
class RisingFriction(StribeckFriction):
    """``τ = −Fr exp(−|q̇/vr|) sign(q̇)``: what Coulomb friction lacks at low speed.

    It is `stribeck_friction` of the other sign: seals, grease and preloaded gears whose friction
    rises to its level, or more slowly than viscous friction does. Its shape is the speed vr
    [rad/s or m/s] at which all but 37 % is there.
    """

    name = "rising_friction"
    equation = "τ = −Fr exp(−|q̇/vr|) sign(q̇)"
    source = "[Olsson 1998, Eq. 4] with a static level below that of Coulomb"
    units = (("Fr", "N·m", "N"),)

    def curves(self, at: Along) -> list[Array]:
        """Return what is missing at low speed."""
        return [-column for column in super().curves(at)]
