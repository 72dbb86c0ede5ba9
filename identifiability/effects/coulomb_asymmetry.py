"""Coulomb friction with a level for each direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, speed_along
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class CoulombAsymmetry(AlongAxes):
    """``τ = Fc⁺`` for q̇ > 0 and ``−Fc⁻`` for q̇ < 0; both are positive numbers.

    A motor that mixes joints has one level: what its two directions differ by is a constant torque
    on its joints, which their own levels hold already.
    """

    name = "coulomb_asymmetry"
    equation = "τ = Fc⁺ for q̇ > 0, −Fc⁻ for q̇ < 0"
    source = "[Díaz 2010, Eq. 10], with the condition on the velocity (printed on the position)"
    supersedes = ("coulomb_friction",)
    units = (("Fc", "N·m", "N"), ("Fc+", "N·m", "N"), ("Fc-", "N·m", "N"))

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return both levels of a joint, one of a motor that mixes joints."""
        del robot
        return ("Fc",) if axis.mixed else ("Fc+", "Fc-")

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the parts of either direction."""
        speed = speed_along(robot, motion, axis)
        if axis.mixed:
            return [np.sign(speed)]
        return [(speed > 0).astype(float), -(speed < 0).astype(float)]


register(
    Family(
        CoulombAsymmetry(),
        "asymmetric Coulomb friction",
        lambda robot: robot.joints,
        needs="coulomb_friction",
        native=True,
        told_by="rest the joints, or move one joint while another stands still,",
        rank=3,
    )
)
