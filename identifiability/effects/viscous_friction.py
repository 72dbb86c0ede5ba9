"""Viscous friction at every actuated joint and coupled motor."""

from __future__ import annotations

from collections.abc import Sequence

from identifiability.effects.effect import AlongAxes, speed_along
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class ViscousFriction(AlongAxes):
    """``τ = Fv q̇``."""

    name = "viscous_friction"
    equation = "τ = Fv q̇"
    source = "[Díaz 2010, Eq. 10]"
    units = (("Fv", "N·m·s/rad", "N·s/m"),)

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the speed."""
        return [speed_along(robot, motion, axis)]


register(
    Family(
        ViscousFriction(),
        "viscous friction",
        positive=True,
        basic=True,
        held={"mjcf": "damping", "urdf": "damping"},
        native=True,
        told_by="run slow and fast passes through the same positions",
        rank=1,
    )
)
