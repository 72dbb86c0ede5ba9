"""Drag that grows with the square of speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, speed_along
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class QuadraticFriction(AlongAxes):
    """``τ = Fq |q̇| q̇``: fans, oil, air.

    Over a narrow range of speeds it looks like viscous friction, or like a wide Stribeck curve.
    """

    name = "quadratic_friction"
    equation = "τ = Fq |q̇| q̇"
    source = "[Armstrong-Hélouvry 1994, Sec. 2]"
    units = (("Fq", "N·m·s²/rad²", "N·s²/m²"),)

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the square of speed against the motion."""
        speed = speed_along(robot, motion, axis)
        return [np.abs(speed) * speed]


register(
    Family(
        QuadraticFriction(),
        "quadratic friction",
        positive=True,
        needs="viscous_friction",
        told_by="run slow and fast passes through the same positions",
        rank=9,
    )
)
