"""Torque that depends on the speed of another joint in a way that has no name here."""

from identifiability.effects.family import actuated_joints
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import (
    CONTAINED,
    DEGREE,
    PIECES,
    fine_at_rest,
    largest_speed,
    splines,
)
from identifiability.effects.torque_leak import FromJoint, first_origin, is_alone, other_joints
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Motion, Robot


@declare(
    "an unnamed function of another joint's velocity",
    actuated_joints,
    shapes=other_joints,
    origin=first_origin,
    refuse=is_alone,
    unnamed=True,
    flexible=True,
    told_by="move one joint while the others stand still",
    rank=33,
)
class FunctionOfOtherVelocity(FromJoint):
    """``τ = f(q̇_other)``, smooth in the root of the speed up to its limit.

    Its shape is the number of the joint whose speed it is.
    """

    name = "function_of_other_velocity"
    equation = "τ = f(q̇_other), f = Σ cₖ Bₖ(√|q̇_other/v| sign q̇_other)"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    units = (("f", "N·m", "N"),)
    crossed = ("N·m", "N")
    supersedes = CONTAINED
    curves_apart = 0

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline, with the joint that it comes from."""
        (kind,) = super().kinds(robot, axis)
        return tuple(f"{kind}_{k + 1}" for k in range(PIECES + DEGREE))

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the splines of every joint."""
        width = PIECES + DEGREE
        for k, axis in enumerate(self.axes(robot)):
            other = self.origin(robot, axis)
            largest = largest_speed(robot, robot.axes[other])
            columns = splines(fine_at_rest(motion.actuated_v[:, other], largest))
            at = robot.joints.index(axis.name)
            out[:, at, k * width : (k + 1) * width] = columns
