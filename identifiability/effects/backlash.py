"""Load that a motor does not feel while it crosses the play of its gear."""

import numpy as np

from identifiability.effects.effect import Along, Shaped, put
from identifiability.effects.family import Span
from identifiability.effects.load_dependent_friction import carried_load
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.path_memory import stretch_of_springs
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot

#: Widths that are tried, as shares of the joint's range.
SHARES = (0.003, 0.01, 0.03)
#: Teeth touch again within one part in so many of the play: encoders tremble where they do.
EDGE = 10.0


def _widths(span: Span) -> tuple[float, ...]:
    return tuple(s * span.position_range for s in SHARES)


@declare(
    "backlash of a gear",
    shapes=_widths,
    refuse=needs_masses,
    loaded=True,
    remembers=True,
    late=True,
    told_by="reverse under load and without,",
    rank=6.4,
)
class Backlash(Shaped):
    """``τ = −Bl τ_load min(1, 10 (1 − |z|))``: an indicator of play, not a model of it.

    After each reversal the motor crosses the play of its gear, where teeth do not touch and none
    of the load is felt; z goes from −1 to 1 meanwhile, over twice the shape w [rad or m]. The load
    is by the masses of the robot file. A log of the motor alone does not say more.
    """

    name = "backlash"
    equation = "τ = −Bl τ_load min(1, 10 (1 − |z(q)|)), z ← clip(z + Δq/w, ±1)"
    source = "[Nordin & Gutman 2002]"
    units = (("Bl", "1", "1"),)
    usual = (0.005, 0.0005)
    nonnegative = True

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis; the torque of the whole robot is computed once."""
        load = rigid_torque(robot, motion)
        for k, axis in enumerate(self.axes(robot)):
            at = Along(robot, motion, axis)
            width = self.shape(robot, axis)
            z = stretch_of_springs(motion, at.travel, at.speed, width)
            apart = np.minimum(EDGE * (1.0 - np.abs(z)), 1.0)
            put(out, k, at.load, -apart * carried_load(load, at))
