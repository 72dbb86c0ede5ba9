"""A constant torque at every actuated joint."""

from __future__ import annotations

from identifiability.effects.actuator_inertia import in_motor
from identifiability.effects.effect import Effect
from identifiability.effects.family import Family
from identifiability.effects.registry import register
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot


class TorqueOffset(Effect):
    """A constant torque: sensor bias or current offset."""

    name = "torque_offset"
    equation = "τ = off"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return one offset an axis of an actuated joint."""
        joints = robot.axes[: len(robot.actuated)]
        unit = ("N·m", "N")
        return tuple(
            Parameter(a.name, "off", unit[a.prismatic], self.name, a.symbol) for a in joints
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one constant column a joint."""
        for k in range(len(robot.actuated)):
            out[:, k, k] = 1.0


register(
    Family(
        TorqueOffset(),
        "torque offset",
        lambda robot: robot.joints,
        basic=True,
        refuse=in_motor,
        native=True,
        told_by="rest the joints, or move one joint while another stands still,",
        rank=5,
    )
)
