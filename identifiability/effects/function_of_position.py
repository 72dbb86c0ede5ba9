"""Torque that depends on the position in a way that has no name here."""

from identifiability.effects.effect import Along
from identifiability.effects.family import POSTURES, Span
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import SmoothFunction
from identifiability.foundation.names import Array


def farthest(span: Span) -> tuple[float, ...]:
    """Return the largest distance of the motions from home [rad or m]."""
    return (span.farthest,)


@declare(
    "an unnamed function of position",
    shapes=farthest,
    against="position",
    unnamed=True,
    flexible=True,
    told_by=POSTURES,
    rank=32,
)
class FunctionOfPosition(SmoothFunction):
    """``τ = f(q)``. Its shape is the largest distance from home [rad or m]."""

    name = "function_of_position"
    equation = "τ = f(q), f = Σ cₖ Bₖ(q)"
    units = (("fq", "N·m", "N"),)
    usual = (3.0, 0.5)

    def coordinate(self, at: Along) -> Array:
        """Return the position from home over the largest one."""
        return at.travel / self.shape(at.robot, at.axis)
