"""Effects along simulated stretches say of measured states what they say along the whole log."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects import find_effect, find_family
from identifiability.robot import Robot, complete_motion
from identifiability.simulation import random_trajectory
from identifiability.workflows.diagnose.forward import OtherEffects

#: What hangs on the time of a log, of its session, on the way, and on nothing but a state.
NAMES = (
    "torque_drift",
    "friction_drift",
    "function_of_time",
    "function_of_session_time",
    "hysteresis",
    "backlash",
    "load_dependent_friction",
)
#: Stretches: log, first row, steps until they diverge.
STRETCHES = ((0, 0, 20), (0, 7, 5), (0, 85, 20), (0, 200, 20), (2, 40, 20), (2, 150, 12))


def session(robot, samples=300):
    """Return logs that begin one after the other; a few samples of each are missing."""
    rng, rows = np.random.default_rng(3), np.r_[0:80, 85:samples]
    for start in (1000.0, 1050.0, 1075.0):
        trajectory = random_trajectory(robot, rng)
        t = trajectory.times(samples)
        motion = complete_motion(robot, t, *trajectory.motion(t))
        yield replace(motion[rows], start=start)


@pytest.mark.parametrize("name", ["two-link", "five-bar"])
@pytest.mark.parametrize("effect", NAMES)
def test_measured_states_have_the_torque_of_their_log(name, effect):
    """At their time, in their place of the session, and after the way that led to them."""
    robot = Robot.load(name)
    logs, found, family = list(session(robot)), find_effect(effect), find_family(effect)
    values = np.random.default_rng(0).uniform(0.5, 1.5, len(found.parameters(robot)))
    torque = []
    for log in logs:
        W = np.zeros((len(log), len(robot.joints), len(values)))
        found.fill(robot, log, W)
        torque.append(W @ values)
    starts = [(logs[log], row) for log, row, _ in STRETCHES]
    extra = OtherEffects(robot, [(found, family, values)], starts)
    for step in range(20):
        alive = np.array([k for k, (_, _, last) in enumerate(STRETCHES) if step < last])
        states = [(STRETCHES[k][0], STRETCHES[k][1] + step) for k in alive]
        q, dq, ddq = (
            np.array([getattr(logs[log], f"actuated_{kind}")[row] for log, row in states])
            for kind in "qva"
        )
        taken, level = extra(alive, logs[0].t[step] - logs[0].t[0], q, dq, ddq)
        expected = np.array([torque[log][row] for log, row in states])
        assert np.any(expected)
        assert not np.any(taken if family.dry else level)
        np.testing.assert_allclose(taken + level * np.sign(dq), expected, rtol=1e-6, atol=1e-9)
