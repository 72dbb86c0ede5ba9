"""Torque that depends on position and speed in a way that has no name here."""

from identifiability.effects.family import SPEEDS
from identifiability.effects.function_of_position import FunctionOfPosition, farthest
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import WithVelocity


@declare(
    "an unnamed function of position and velocity",
    shapes=farthest,
    against="position",
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
    rank=35,
)
class FunctionOfPositionAndVelocity(WithVelocity, FunctionOfPosition):
    """``τ = f(q, q̇)``. Its shape is the largest distance from home [rad or m]."""

    name = "function_of_position_and_velocity"
    equation = "τ = f₀(q) + f₁(q) sign(q̇) + f₂(q) q̇, f = Σ cₖ Bₖ"
    units = (("fqv", "N·m", "N"),)
