"""The simulated robot: the road to torque that knows nothing of the regressor.

What to use when: `simulate` makes a log along a `Trajectory`; `MujocoRobot` gives bare rigid-body
torques.
"""

from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque
from identifiability.simulation.noise import PAPER_NOISE, Noise
from identifiability.simulation.simulator import PrescribedMotion, simulate
from identifiability.simulation.trajectory import (
    Trajectory,
    random_trajectory,
    read_trajectories,
    shipped_trajectory,
)

__all__ = [
    "PAPER_NOISE",
    "MujocoRobot",
    "Noise",
    "PrescribedMotion",
    "RigidTorque",
    "Trajectory",
    "random_trajectory",
    "read_trajectories",
    "shipped_trajectory",
    "simulate",
]
