"""Torque that depends on speed and load in a way that has no name here."""

from identifiability.effects.effect import Along
from identifiability.effects.function_of_load import TYPICAL, largest_load
from identifiability.effects.load_dependent_friction import carried_load
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import WithVelocity
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
class FunctionOfVelocityAndLoad(WithVelocity):
    """``τ = f(q̇, τ_load)``. Its shape is the largest load by the file's masses [N·m or N]."""

    name = "function_of_velocity_and_load"
    equation = "τ = f₀(τ_load) + f₁(τ_load) sign(q̇) + f₂(τ_load) q̇, f = Σ cₖ Bₖ"
    units = (("fvl", "N·m", "N"),)

    def coordinate(self, at: Along) -> Array:
        """Return the load over the largest one."""
        load = carried_load(rigid_torque(at.robot, at.motion), at)
        return load / self.shape(at.robot, at.axis)

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a load of some size [N·m or N]."""
        del robot
        return TYPICAL[axis.prismatic]
