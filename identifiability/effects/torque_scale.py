"""A joint whose torque is measured in wrong units: a gain that is off."""

from identifiability.effects.effect import Effect
from identifiability.effects.family import POSTURES, actuated_joints
from identifiability.effects.nominal import needs_masses
from identifiability.effects.registry import declare
from identifiability.effects.time_delay import nominal_torque
from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot


@declare(
    "a wrong scale of the torque",
    actuated_joints,
    refuse=needs_masses,
    against="load",
    loaded=True,
    told_by=POSTURES,
    rank=12.4,
)
class TorqueScale(Effect):
    """``τ = s τ``: the torque of one joint is s too large, as by a wrong constant of its motor.

    The torque is that of the robot file's values. One scale of all joints is a scale of all
    masses; what is told is how the joints differ.
    """

    name = "torque_scale"
    equation = "τ_measured = (1 + s) τ"
    source = "[Gautier & Briot 2014]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return one share for every actuated joint."""
        axes = robot.axes[: len(robot.actuated)]
        return tuple(Parameter(a.name, "scale", "1", self.name, a.symbol) for a in axes)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the torque of each joint."""
        if not out.shape[2]:
            return
        tau = nominal_torque(robot, motion)
        for k in range(out.shape[1]):
            out[:, k, k] = tau[:, k]
