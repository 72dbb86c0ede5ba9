"""Torque that depends on position and speed in a way that has no name here."""

from identifiability.effects.effect import Along
from identifiability.effects.family import SPEEDS, Span
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import WithVelocity
from identifiability.foundation.names import Array


def _farthest(span: Span) -> tuple[float, ...]:
    return (span.farthest,)


@declare(
    "an unnamed function of position and velocity",
    shapes=_farthest,
    against="position",
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
    rank=35,
)
class FunctionOfPositionAndVelocity(WithVelocity):
    """``τ = f(q, q̇)``. Its shape is the largest distance from home [rad or m]."""

    name = "function_of_position_and_velocity"
    equation = "τ = f₀(q) + f₁(q) sign(q̇) + f₂(q) q̇, f = Σ cₖ Bₖ"
    units = (("fqv", "N·m", "N"),)
    usual = (3.0, 0.5)

    def coordinate(self, at: Along) -> Array:
        """Return the position from home over the largest one."""
        return at.travel / self.shape(at.robot, at.axis)
