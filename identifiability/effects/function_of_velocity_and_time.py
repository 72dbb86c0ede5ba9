"""Torque that depends on the speed in a way that changes with time and has no name here."""

from identifiability.effects.function_of_time import FunctionOfTime, duration
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import WithVelocity


@declare(
    "an unnamed function of velocity and time",
    shapes=duration,
    against="time",
    unnamed=True,
    flexible=True,
    told_by="repeat the motion later",
    rank=37,
)
class FunctionOfVelocityAndTime(WithVelocity, FunctionOfTime):
    """``τ = f(q̇, t)``, t the time of each log. Its shape is the end of the time [s]."""

    name = "function_of_velocity_and_time"
    equation = "τ = f₀(t) + f₁(t) sign(q̇) + f₂(t) q̇, f = Σ cₖ Bₖ"
    units = (("fvt", "N·m", "N"),)
