"""Torque that depends on speed and load in a way that has no name here."""

from identifiability.effects.effect import Along
from identifiability.effects.function_of_load import TYPICAL, largest_load
from identifiability.effects.load_dependent_friction import carried_load
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import OfTwo, fine_at_rest, largest_speed
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


@declare(
    "an unnamed function of velocity and load",
    shapes=largest_load,
    refuse=needs_masses,
    loaded=True,
    unnamed=True,
    flexible=True,
    told_by="move with and without a load",
    rank=36,
)
class FunctionOfVelocityAndLoad(OfTwo):
    """``τ = f(q̇, τ_load)``. Its shape is the largest load by the file's masses [N·m or N]."""

    name = "function_of_velocity_and_load"
    equation = "τ = f(q̇, τ_load), f = Σ cₖₗ Bₖ(√|q̇/v| sign q̇) Bₗ(τ_load)"
    units = (("fvl", "N·m", "N"),)

    def coordinates(self, at: Along) -> tuple[Array, ...]:
        """Return the root of the speed over its limit, and the load."""
        load = carried_load(rigid_torque(at.robot, at.motion), at)
        speed = fine_at_rest(at.speed, largest_speed(at.robot, at.axis))
        return speed, load / self.shape(at.robot, at.axis)

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a load of some size [N·m or N]."""
        del robot
        return TYPICAL[axis.prismatic]
