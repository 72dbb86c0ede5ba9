"""Torque that is stamped before the motion it belongs to."""

from identifiability.effects.family import actuated_joints
from identifiability.effects.nominal import needs_masses
from identifiability.effects.registry import declare
from identifiability.effects.time_delay import TimeDelay
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot


@declare(
    "an error of clocks (torque stamped before its motion)",
    actuated_joints,
    refuse=needs_masses,
    loaded=True,
    native=True,
    rank=12.1,
)
class ClockError(TimeDelay):
    """``τ_measured(t) = τ(t + ε)``: no torque follows a motion before it happens.

    What `time_delay` would need a negative delay for: the motion is stamped late, or filtered.
    """

    name = "clock_error"
    equation = "τ = ε dτ/dt"
    kind = "lead"

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column a joint, that of a delay with the other sign."""
        super().fill(robot, motion, out)
        out *= -1.0
