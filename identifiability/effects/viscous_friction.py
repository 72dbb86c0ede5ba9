"""Viscous friction at every actuated joint and coupled motor."""

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import SPEEDS
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array


@declare("viscous friction", basic=True, native=True, told_by=SPEEDS, rank=1)
class ViscousFriction(AlongAxes):
    """``τ = Fv q̇``."""

    name = "viscous_friction"
    equation = "τ = Fv q̇"
    source = "[Díaz 2010, Eq. 10]"
    units = (("Fv", "N·m·s/rad", "N·s/m"),)
    nonnegative = True
    stated_as = ("damping",)

    def curves(self, at: Along) -> list[Array]:
        """Return the speed."""
        return [at.speed]
