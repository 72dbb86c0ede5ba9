"""Loops close, derivatives are derivatives, and nothing depends on order or spelling."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Robot
from identifiability.robot import complete_motion
from identifiability.robot.closure import newton
from identifiability.simulation import random_trajectory, shipped_trajectory

CLOSED = ("3-rps", "six-ups", "five-bar")


@pytest.fixture(params=CLOSED)
def closed(request):
    return Robot.load(request.param)


def motion_of(robot, t):
    return complete_motion(robot, t, *random_trajectory(robot, default_rng(2)).motion(t))


def test_every_loop_closes_along_a_motion(closed):
    motion = motion_of(closed, np.linspace(0, 7.5, 300))
    assert len(motion.dropped) == 0
    assert newton(closed, motion.q, most=0).error.max() < 1e-10


def test_velocities_and_accelerations_are_time_derivatives(closed):
    h = 1e-4
    t = 2.0 + np.array([-h, 0, h])
    motion = motion_of(closed, t)
    scale = np.abs(motion.a[1]).max()
    assert_allclose((motion.q[2] - motion.q[0]) / (2 * h), motion.v[1], atol=1e-6 * scale)
    assert_allclose((motion.v[2] - motion.v[0]) / (2 * h), motion.a[1], atol=1e-6 * scale)


def test_the_motion_does_not_depend_on_the_order_or_number_of_samples(closed):
    t = np.linspace(0, 7.5, 400)
    q, dq, ddq = random_trajectory(closed, default_rng(2)).motion(t)
    whole = complete_motion(closed, t, q, dq, ddq)
    order = default_rng(0).permutation(len(t))
    shuffled = complete_motion(closed, t[order], q[order], dq[order], ddq[order])
    part = complete_motion(closed, t[100:130], q[100:130], dq[100:130], ddq[100:130])
    assert_allclose(shuffled.q, whole.q[order], atol=1e-10)
    assert_allclose(shuffled.a, whole.a[order], atol=1e-8)
    assert_allclose(part.q, whole.q[100:130], atol=1e-10)


def test_the_home_keyframe_selects_the_assembly(rps):
    trajectory = shipped_trajectory(rps, "601")
    motion = complete_motion(rps, trajectory.times(), *trajectory.motion(trajectory.times()))
    hinges = [rps.dofs.index(f"hinge{k}") for k in (1, 2, 3)]
    # All legs lean inwards in the paper's assembly; others tip the platform over.
    assert (motion.q[:, hinges] > 0).all()
    assert (motion.q[:, hinges] < 0.6).all()


def test_positions_out_of_reach_are_dropped_and_named(rps, rejected):
    trajectory = shipped_trajectory(rps, "601")
    t = trajectory.times(100)
    q, dq, ddq = trajectory.motion(t)
    q[[7, 30], 0] = 5.0
    motion = complete_motion(rps, t, q, dq, ddq)
    assert motion.dropped.tolist() == [7, 30]
    assert len(motion) == 98
    with rejected(r"close at none of the 100 samples.*slider1 = 0\.7"):
        complete_motion(rps, t, 1000 * q, dq, ddq)
