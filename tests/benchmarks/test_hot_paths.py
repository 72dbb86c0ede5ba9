"""Compare times of the hot paths with a bare loop in the same run.

Other processors and busy machines moved these ratios by up to 2.4: each limit is `MARGIN` times
the ratio that was measured, so that only another order of cost fails.
"""

import time

import numpy as np
import pinocchio as pin
import pytest
from threadpoolctl import threadpool_limits

from identifiability import Model, Robot
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory

MARGIN = 4.0


def motion_of(name):
    robot = Robot.load(name)
    trajectory = shipped_trajectory(robot, "601" if name == "3-rps" else "a")
    move = PrescribedMotion.of(trajectory, 10_000)
    return robot, move


def bare_loop(model, data, q, v, a, out):
    """What anybody would write: one Pinocchio call a sample, into an array that is there."""
    for k in range(len(q)):
        out[k] = pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])


def in_turns(rounds, *functions):
    """Return processor times (rounds, functions), taken in turn: all see the same machine."""
    times = np.empty((rounds, len(functions)))
    for row in times:
        for k, function in enumerate(functions):
            start = time.process_time()
            function()
            row[k] = time.process_time() - start
    return times


@pytest.fixture
def arm():
    robot, move = motion_of("six-dof-arm")
    return robot, complete_motion(robot, move.t, move.q, move.dq, move.ddq)


def chunked(robot, model, motion):
    """As data are gathered: in pieces, and the widths of the columns once."""
    widths = model.widths(robot)
    for start in range(0, len(motion), 1024):
        model.regressor(robot, motion[start : start + 1024], widths)


def test_open_chain_regressor_costs_about_as_much_as_a_bare_pinocchio_loop(arm):
    """Compare neighbours in time, which share the machine; measured: 1.08, and 1.12 under load."""
    robot, motion = arm
    motion = motion[:4096]
    data = robot.model.createData()
    model = Model.of("rigid_body")
    out = np.ones((len(motion), robot.nv, 10 * robot.nv))
    ours, bare = in_turns(
        60,
        lambda: chunked(robot, model, motion),
        lambda: bare_loop(robot.model, data, motion.q, motion.v, motion.a, out),
    ).T
    ratio = np.median(ours / bare)
    assert ratio <= MARGIN * 1.1, f"{ratio:.2f} × the bare loop"


@pytest.mark.parametrize("name, columns, limit", [("3-rps", False, 2.1), ("delta", True, 6.8)])
def test_closing_loops_costs_no_more_than_some_regressors(arm, name, columns, limit):
    """Compare with the arm's bare loop of 2.5 µs a sample; measured: 5.3, and 17 with columns."""
    robot, motion = arm
    data = robot.model.createData()
    out = np.ones((len(motion), robot.nv, 10 * robot.nv))
    closed, move = motion_of(name)

    def complete():
        whole = complete_motion(closed, move.t, move.q, move.dq, move.ddq)
        if columns:
            chunked(closed, Model.of("rigid_body"), whole)

    with threadpool_limits(1, "blas"):
        times = in_turns(
            4, complete, lambda: bare_loop(robot.model, data, motion.q, motion.v, motion.a, out)
        )
    ours, bare = times.min(axis=0)
    assert ours <= MARGIN * limit * bare, f"{ours / bare:.2f} × the bare loop"
