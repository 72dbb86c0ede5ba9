"""Friction in the joints of a closed chain that have no motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, speed_along
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class PassiveJointFriction(AlongAxes):
    """Viscous and Coulomb friction at passive joints, projected on the actuated ones by -Xᵀ."""

    name = "passive_joint_friction"
    equation = "τ = −Xᵀ (Fv q̇ₑ + Fc sign(q̇ₑ))"
    source = "[Díaz 2010, Eq. 10], projected as in [Díaz 2010, Eq. 7]"
    units = (("Fv", "N·m·s/rad", "N·s/m"), ("Fc", "N·m", "N"))

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return every passive joint of one degree of freedom."""
        return robot.passive_axes

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the speed and its sign."""
        speed = speed_along(robot, motion, axis)
        return [speed, np.sign(speed)]


register(
    Family(
        PassiveJointFriction(),
        "friction in passive joints",
        lambda robot: tuple(a.name for a in robot.passive_axes),
        positive=True,
        separate=True,
        held={"mjcf": "damping, frictionloss", "urdf": "damping, friction"},
        native=True,
        rank=7,
    )
)
