"""Torque that depends on the load in a way that has no name here."""

import numpy as np

from identifiability.effects.effect import Along
from identifiability.effects.family import Span
from identifiability.effects.load_dependent_friction import carried_load
from identifiability.effects.nominal import needs_masses, rigid_torque
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import SmoothFunction
from identifiability.foundation.names import Array


def largest_load(span: Span) -> tuple[float, ...]:
    """Return the largest load of the motions at an axis, by the file's masses [N·m or N]."""
    if span.robot is None:
        return ()
    axis = next(a for a in span.robot.axes if a.name == span.joint)
    loads = [
        carried_load(rigid_torque(span.robot, m), Along(span.robot, m, axis)) for m in span.motions
    ]
    return (max(float(np.abs(x).max(initial=0.0)) for x in loads) or 1.0,)


class OfLoad(SmoothFunction):
    """A function of the load; its shape is the largest one [N·m or N]."""

    usual = (10.0, 100.0)

    def coordinate(self, at: Along) -> Array:
        """Return the load over the largest one."""
        load = carried_load(rigid_torque(at.robot, at.motion), at)
        return load / self.shape(at.robot, at.axis)


@declare(
    "an unnamed function of the load",
    shapes=largest_load,
    refuse=needs_masses,
    against="load",
    loaded=True,
    unnamed=True,
    flexible=True,
    told_by="move with and without a load",
    rank=31,
)
class FunctionOfLoad(OfLoad):
    """``τ = f(τ_load)`` of the load by the file's masses. Its shape is the largest load."""

    name = "function_of_load"
    equation = "τ = f(τ_load), f = Σ cₖ Bₖ(τ_load)"
    units = (("fl", "N·m", "N"),)
