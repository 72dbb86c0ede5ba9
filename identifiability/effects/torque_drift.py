"""A torque that drifts with time: a sensor or an amplifier that warms up."""

from identifiability.effects.effect import Along
from identifiability.effects.family import actuated_joints, in_motor
from identifiability.effects.registry import declare
from identifiability.effects.torque_offset import TorqueOffset
from identifiability.foundation.names import Array


@declare(
    "a drift of the torque",
    actuated_joints,
    refuse=in_motor,
    against="time",
    late=True,
    told_by="repeat the motion later",
    rank=21,
)
class TorqueDrift(TorqueOffset):
    """``τ = o + d t``: an offset that changes at a steady rate in every log.

    It contains `torque_offset`.
    """

    name = "torque_drift"
    equation = "τ = o + d t"
    source = "a slow change to the first order in time"
    units = (("o", "N·m", "N"), ("d", "N·m/s", "N/s"))
    supersedes = ("torque_offset",)

    def curves(self, at: Along) -> list[Array]:
        """Return a constant and the time of the log."""
        return [at.ones, at.motion.t]
