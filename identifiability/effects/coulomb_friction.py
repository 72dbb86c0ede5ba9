"""Coulomb friction with the same level for both directions."""

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array


@declare("Coulomb friction", basic=True, native=True, rank=2)
class CoulombFriction(AlongAxes):
    """``τ = Fc sign(q̇)`` at every actuated joint and coupled motor."""

    name = "coulomb_friction"
    equation = "τ = Fc sign(q̇)"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    units = (("Fc", "N·m", "N"),)
    nonnegative = True
    stated_as = ("frictionloss",)

    def curves(self, at: Along) -> list[Array]:
        """Return the direction of motion."""
        return [at.sign]
