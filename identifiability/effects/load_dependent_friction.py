"""Coulomb friction in proportion to the load of the gear."""

from __future__ import annotations

import numpy as np

from identifiability.effects.effect import Effect, put, speed_along
from identifiability.effects.family import Family
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import register
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot


class LoadDependentFriction(Effect):
    """``τ = Fl |τ_load| sign(q̇)``.

    The load is the rigid-body torque that the robot file's masses predict, so that a column does
    not contain measured torque. Where the load hardly changes it looks like Coulomb friction.
    """

    name = "load_dependent_friction"
    equation = "τ = Fl |τ_load| sign(q̇)"
    source = "[Hamon 2010, Eq. 4]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the dimensionless Fl of every axis."""
        return tuple(Parameter(a.name, "Fl", "1", self.name, a.symbol) for a in robot.axes)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        load = rigid_torque(robot, motion)
        for k, axis in enumerate(robot.axes):
            speed = speed_along(robot, motion, axis)
            assert axis.row is not None
            carried = np.abs(load @ axis.row) / float(axis.row @ axis.row)
            put(out, k, axis.row, carried * np.sign(speed))


register(
    Family(
        LoadDependentFriction(),
        "load-dependent friction",
        positive=True,
        needs="coulomb_friction",
        refuse=needs_masses,
        loaded=True,
        dry=True,
        rank=8,
    )
)
