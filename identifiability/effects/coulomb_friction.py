"""Coulomb friction with the same level for both directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, speed_along
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class CoulombFriction(AlongAxes):
    """``τ = Fc sign(q̇)`` at every actuated joint and coupled motor."""

    name = "coulomb_friction"
    equation = "τ = Fc sign(q̇)"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    units = (("Fc", "N·m", "N"),)

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the direction of motion."""
        return [np.sign(speed_along(robot, motion, axis))]


register(
    Family(
        CoulombFriction(),
        "Coulomb friction",
        positive=True,
        basic=True,
        held={"mjcf": "frictionloss", "urdf": "friction"},
        native=True,
        rank=2,
    )
)
