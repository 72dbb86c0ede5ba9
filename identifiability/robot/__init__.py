"""Robots: standard files in, the motion of every joint out.

What to use when: `Robot.load` reads a file; `complete_motion` turns the motion of the actuated
joints into that of all joints, closing loops where there are any.
"""

from identifiability.robot.closure import Motion, complete_motion
from identifiability.robot.parts import Axis
from identifiability.robot.robot import KnownRobot, Robot, RobotLike

__all__ = ["Axis", "KnownRobot", "Motion", "Robot", "RobotLike", "complete_motion"]
