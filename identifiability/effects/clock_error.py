"""Torque that is stamped before the motion it belongs to."""

from identifiability.effects.effect import Effect
from identifiability.effects.family import actuated_joints
from identifiability.effects.nominal import needs_masses
from identifiability.effects.registry import declare
from identifiability.effects.time_delay import TimeDelay
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot


@declare(
    "an error of clocks (torque stamped before its motion)",
    actuated_joints,
    refuse=needs_masses,
    loaded=True,
    native=True,
    rank=12.1,
)
@frozen
class ClockError(Effect):
    """``τ_measured(t) = τ(t + ε)``: no torque follows a motion before it happens.

    What `time_delay` would need a negative delay for: the motion is stamped late, or filtered.
    """

    name = "clock_error"
    equation = "τ = ε dτ/dt"
    source = "[Ljung 1999, Sec. 4.2]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the lead of every actuated joint."""
        return tuple(
            Parameter(a.name, "lead", "s", self.name, a.symbol, nonnegative=True)
            for a in robot.axes[: len(robot.actuated)]
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column a joint, that of a delay with the other sign."""
        TimeDelay().fill(robot, motion, out)
        out *= -1.0
