"""Torque that depends on speed and load in a way that has no name here."""

from identifiability.effects.function_of_load import OfLoad, largest_load
from identifiability.effects.nominal import needs_masses
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import WithVelocity


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
class FunctionOfVelocityAndLoad(WithVelocity, OfLoad):
    """``τ = f(q̇, τ_load)``. Its shape is the largest load by the file's masses [N·m or N]."""

    name = "function_of_velocity_and_load"
    equation = "τ = f₀(τ_load) + f₁(τ_load) sign(q̇) + f₂(τ_load) q̇, f = Σ cₖ Bₖ"
    units = (("fvl", "N·m", "N"),)
