"""Torque that depends on the time in a way that has no name here."""

from identifiability.effects.effect import Along
from identifiability.effects.family import Span
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import SmoothFunction
from identifiability.foundation.names import Array

#: Duration where none is given [s].
TYPICAL = 30.0


def duration(span: Span) -> tuple[float, ...]:
    """Return the end of the time of the longest log [s]."""
    return (max((float(m.t.max(initial=0.0)) for m in span.motions), default=0.0) or TYPICAL,)


@declare(
    "an unnamed function of time",
    shapes=duration,
    against="time",
    unnamed=True,
    flexible=True,
    told_by="repeat the motion later",
    rank=34,
)
class FunctionOfTime(SmoothFunction):
    """``τ = f(t)`` of the time of each log. Its shape is the end of the time [s]."""

    name = "function_of_time"
    equation = "τ = f(t), f = Σ cₖ Bₖ(t)"
    units = (("ft", "N·m", "N"),)
    usual = (TYPICAL, TYPICAL)

    def coordinate(self, at: Along) -> Array:
        """Return the time, from −1 to 1."""
        return 2.0 * at.motion.t / self.shape(at.robot, at.axis) - 1.0
