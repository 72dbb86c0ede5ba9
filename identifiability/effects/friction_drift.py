"""Friction that changes with time, as grease that warms up."""

from identifiability.effects.effect import Along, AlongAxes
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array


@declare(
    "friction that changes with time",
    needs="viscous_friction",
    against="time",
    separate=True,
    late=True,
    told_by="repeat the motion later",
    rank=22,
)
class FrictionDrift(AlongAxes):
    """``τ = (dv q̇ + dc sign(q̇)) t``: viscous and dry friction that change at a steady rate.

    Grease that warms up turns thinner; t is the time of each log.
    """

    name = "friction_drift"
    equation = "τ = (dv q̇ + dc sign(q̇)) t"
    source = "[Bittencourt 2012; Simoni 2015]"
    units = (("dv", "N·m/rad", "N/m"), ("dc", "N·m/s", "N/s"))

    def curves(self, at: Along) -> list[Array]:
        """Return both frictions, growing with time."""
        return [at.motion.t * at.speed, at.motion.t * at.sign]
