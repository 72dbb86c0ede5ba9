"""The simulated robot: torque that is computed without the regressor.

What to use when: `simulate` makes a log along a `Trajectory`; `Campaign` makes many logs of the
same motions, with one size of every hidden effect in all of them; `MujocoRobot` gives bare
rigid-body torques.
"""

from .motion import (
    PrescribedMotion,
    Trajectory,
    random_trajectory,
    read_trajectories,
    shipped_trajectory,
)
from .mujoco_robot import MujocoRobot
from .simulator import PAPER_NOISE, Campaign, Noise, simulate

__all__ = [
    "PAPER_NOISE",
    "Campaign",
    "MujocoRobot",
    "Noise",
    "PrescribedMotion",
    "Trajectory",
    "random_trajectory",
    "read_trajectories",
    "shipped_trajectory",
    "simulate",
]
