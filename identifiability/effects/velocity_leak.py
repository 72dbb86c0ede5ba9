"""Torque in proportion to the speed of another joint."""

from identifiability.effects.family import actuated_joints
from identifiability.effects.registry import declare
from identifiability.effects.torque_leak import FromJoint, first_origin, is_alone, other_joints
from identifiability.foundation.names import Array
from identifiability.robot import Motion, Robot


@declare(
    "drag by the speed of another joint",
    actuated_joints,
    shapes=other_joints,
    origin=first_origin,
    refuse=is_alone,
    needs="viscous_friction",
    told_by="move one joint while the others stand still",
    rank=12.3,
)
class VelocityLeak(FromJoint):
    """``τ = c q̇_other``: coupled drives, hoses, induced voltage.

    Its shape is the number of the joint whose speed it is.
    """

    name = "velocity_leak"
    equation = "τ = c q̇_other"
    source = "viscous friction [Khalil 2002, Sec. 9.3.4] between joints"
    units = (("by", "N·m·s/rad", "N·s/m"),)
    crossed = ("N·s", "N·s/rad")

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column a joint."""
        if out.shape[2]:
            self.fill_from(robot, motion.actuated_v, out)
