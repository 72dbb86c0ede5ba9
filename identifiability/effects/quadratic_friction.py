"""Drag that grows with the square of speed."""

import numpy as np

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.family import SPEEDS
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array


@declare("quadratic friction", needs="viscous_friction", told_by=SPEEDS, rank=9)
class QuadraticFriction(AlongAxes):
    """``τ = Fq |q̇| q̇``: fans, oil, air.

    Over a narrow range of speeds it looks like viscous friction, or like a wide Stribeck curve.
    """

    name = "quadratic_friction"
    equation = "τ = Fq |q̇| q̇"
    source = "[Armstrong-Hélouvry 1994, Sec. 2]"
    units = (("Fq", "N·m·s²/rad²", "N·s²/m²"),)
    nonnegative = True

    def curves(self, at: Along) -> list[Array]:
        """Return the square of speed against the motion."""
        return [np.abs(at.speed) * at.speed]
