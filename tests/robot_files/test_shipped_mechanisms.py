"""Laws of the shipped mechanisms: MuJoCo's torque, counts by energy, values that come back.

They stand beside `ROBOTS` of the other tests, which run every law on every robot.
"""

import numpy as np
import pytest

from identifiability import Robot
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory

MECHANISMS = ("delta", "3-rrr", "palletizer", "six-actuators")


def within_limits(robot):
    """Random states within the limits of the sidecar."""
    rng = np.random.default_rng(1)
    q = rng.uniform(*robot.limits.T, (500, len(robot.joints)))
    return q[np.argsort(q[:, 0])], *rng.normal(size=(2, *q.shape))


@pytest.mark.parametrize("name", MECHANISMS[:3])
def test_a_mechanism_is_what_mujoco_makes_of_it(name, agrees):
    robot = Robot.load(name)
    middle = robot.limits.mean(1)
    half = 0.5 * np.ptp(robot.limits, axis=1)
    from_home = half - np.abs(middle - robot.actuated_positions(robot.home[None])[0])
    assert (from_home > 0.6 * half).all()
    agrees(robot.path.read_text(), spread=from_home)


@pytest.mark.parametrize("name", MECHANISMS)
def test_no_pose_within_the_limits_is_near_singular_or_out_of_reach(name):
    robot = Robot.load(name)
    q, v, a = within_limits(robot)
    motion = complete_motion(robot, np.arange(500) * 1.0, q, v, a)
    assert len(motion) == 500
    assert motion.condition < 50
    for trajectory in "abc":
        move = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 150)
        assert (move.q > robot.limits[:, 0]).all()
        assert (move.q < robot.limits[:, 1]).all()
