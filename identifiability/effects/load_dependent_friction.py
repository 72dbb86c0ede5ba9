"""Coulomb friction in proportion to the load of the gear."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identifiability.effects.effect import Along, AlongAxes, put
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import declare
from identifiability.foundation.linalg import without_rounding
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot

#: A row that is shorter than the root of this has no load of its own.
SMALLEST = 1e-30


def carried_load(load: Array, at: Along) -> Array:
    """Return what an axis alone would carry of the torque of the joints (N, n), (N,)."""
    row = at.load
    carried: Array = (load * row).sum(1) / np.maximum((row * row).sum(-1), SMALLEST)
    return without_rounding(carried[:, None], load)[:, 0]


@declare(
    "load-dependent friction",
    needs="coulomb_friction",
    refuse=needs_masses,
    loaded=True,
    dry=True,
    rank=8,
)
class LoadDependentFriction(AlongAxes):
    """``τ = Fl |τ_load| sign(q̇)``.

    The load is the rigid-body torque that the robot file's masses predict, so that a column does
    not contain measured torque. Where the load hardly changes it looks like Coulomb friction.
    """

    name = "load_dependent_friction"
    equation = "τ = Fl |τ_load| sign(q̇)"
    source = "[Hamon 2010, Eq. 4]"
    units = (("Fl", "1", "1"),)
    nonnegative = True

    def __init__(self, reference: Mapping[str, float] | None = None) -> None:
        """Know the load by standard parameters, by default by the robot's own."""
        self.reference = reference

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis; the torque of the whole robot is computed once."""
        if self.reference is not None:
            robot = replace(robot, reference=self.reference)
        load = rigid_torque(robot, motion)
        for k, axis in enumerate(robot.axes):
            at = Along(robot, motion, axis)
            put(out, k, at.load, np.abs(carried_load(load, at)) * at.sign)
