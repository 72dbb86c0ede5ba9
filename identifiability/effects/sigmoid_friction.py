"""Dry friction without a jump at standstill."""

import numpy as np

from identifiability.effects.effect import Along
from identifiability.effects.family import SPEEDS, Span
from identifiability.effects.registry import declare
from identifiability.effects.stribeck_friction import StribeckFriction
from identifiability.foundation.names import Array

#: Speeds that are tried, as shares of the joint's rms speed.
SHARES = tuple(float(x) for x in np.geomspace(0.08, 3.2, 12))


def _speeds(span: Span) -> tuple[float, ...]:
    return tuple(s * span.rms_speed for s in SHARES)


@declare(
    "smooth (sigmoid) friction",
    shapes=_speeds,
    needs="viscous_friction",
    dry=True,
    continuous=True,
    told_by=SPEEDS,
    rank=6.2,
)
class SigmoidFriction(StribeckFriction):
    """``τ = Ft tanh(q̇/vt)``: dry friction that turns smoothly from one direction to the other.

    Published models of the Franka Panda and of the UR10 have it. Its shape is the speed vt
    [rad/s or m/s] at which 76 % is there. Beside Coulomb friction it resembles
    `rising_friction`.
    """

    name = "sigmoid_friction"
    equation = "τ = Ft tanh(q̇/vt)"
    source = "[Gaz 2019]"
    units = (("Ft", "N·m", "N"),)

    def curves(self, at: Along) -> list[Array]:
        """Return the sigmoid."""
        return [np.tanh(at.speed / self.shape(at.robot, at.axis))]
