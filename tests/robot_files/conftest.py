"""Torque by the file's own values on two roads, one of which is MuJoCo reading the file itself."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import simulate
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion

from ..roads import in_mujoco, nominal_torque, project


@pytest.fixture
def agrees(load_text):
    """A function that checks that both roads give the same torque at random states."""

    def check(text, samples=20, spread=1.0, seed=0, **given):
        robot = load_text(text, **given)
        rng = np.random.default_rng(seed)
        n = len(robot.actuated)
        home = robot.actuated_positions(robot.home[None])
        q = home + spread * rng.uniform(-1, 1, (samples, n))
        q = q[np.argsort(q[:, 0])]  # less of a way to go
        motion = complete_motion(
            robot, np.arange(1.0 * samples), q, *rng.normal(size=(2, *q.shape))
        )
        assert len(motion.dropped) == 0
        expected = project(robot, motion, in_mujoco(robot.path, robot, motion))
        size = np.abs(expected).max()
        assert size > 1e-3
        assert_allclose(nominal_torque(robot, motion), expected, rtol=0, atol=1e-9 * size)
        move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
        assert_allclose(simulate(robot, move).tau, expected, rtol=0, atol=1e-9 * size)
        return robot

    return check
