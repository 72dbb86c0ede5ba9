"""Each effect's columns are what its equation says, on actuated, coupled and passive axes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Log, Model, Robot, analyze, diagnose, predict, prepare_log
from identifiability.regression.structure import random_motion
from identifiability.simulation import Campaign, Noise, random_trajectory

from .conftest import shipped_log

COUPLED = """
[transmission]
motors = ["motor1", "motor2"]
coupling = [[1, 0], [1, 1]]
ratio = [50, -30]
offset = [0.1, -0.2]
"""


@pytest.fixture
def coupled(tmp_path):
    path = tmp_path / "coupled.toml"
    path.write_text(COUPLED)
    return Robot.load("two-link", path)


def test_motor_logs_are_converted_to_the_joint_side(coupled, tmp_path, rejected):
    assert [coupled.torque_column(joint) for joint in coupled.joints] == ["", "motor2"]
    joint = shipped_log(coupled, "a")
    R = np.array([[50.0, 0.0], [-30.0, -30.0]])
    offset = np.array([0.1, -0.2])
    motor = Log(
        "motor", ("motor1", "motor2"), joint.t, (joint.q - offset) @ R.T,
        np.linalg.solve(R.T, joint.tau.T).T, joint.dq @ R.T, joint.ddq @ R.T, "",
    )  # fmt: skip
    a = prepare_log(coupled, joint)
    b = prepare_log(coupled, motor)
    for kind in ("actuated_q", "actuated_v", "actuated_a"):
        assert_allclose(getattr(b.motion, kind), getattr(a.motion, kind), atol=1e-12)
    assert_allclose(b.tau, a.tau, atol=1e-12)
    result = analyze(coupled, joint, "none", quick=True).to_json(tmp_path / "result.json")
    with rejected(r"made with the sidecar coupled\.toml"):
        predict("two-link", result, joint)
    # Power is the same on either side of the gears.
    assert_allclose((motor.tau * motor.dq).sum(1), (joint.tau * joint.dq).sum(1), atol=1e-10)


def test_a_wrong_constant_of_a_coupled_motor_is_no_leak(tmp_path):
    gains = tmp_path / "gains.toml"
    gains.write_text(COUPLED + "[torque]\ngain = {motor1 = 1, motor2 = 1}\n")
    robot = Robot.load("two-link", gains)
    log = shipped_log(robot, "a", noise=Noise(additive=0.02))
    C = robot.transmission.coupling
    off = replace(log, tau=log.tau @ np.linalg.inv(C) * [1, 1.1] @ C)
    ((p,),) = [
        e.placements for e in diagnose(robot, off, effects=["torque_scale", "torque_leak"]).effects
    ]
    assert {p.place, *(r.place for r in p.rivals)} == {"shoulder", "motor2"}  # masses are free


def test_a_joint_without_masses_has_no_load_and_not_that_of_rounding():
    """Roll, wrist and jaws of this file have none: noise would be a billion times 1e-14 N·m.

    What the load moves in the next joint is still there.
    """
    robot = Robot.load("dvrk-psm")
    along = random_motion(robot, default_rng(0), 30)
    model = Model.of("load_dependent_friction")
    acts = model.regressor(robot, along).any((0, 1))
    loaded = {p.name for p, own in zip(model.parameters(robot), acts, strict=True) if own}
    assert loaded == {f"{j}.Fl" for j in ("yaw", "pitch", "insertion")}
    # Nor where the loops of the arm round what the others carry into it.
    moved = [random_trajectory(robot, default_rng(k)) for k in range(2)]
    hidden = Campaign.of(robot, moved).hidden(["backlash@roll=1", "backlash@jaw2=1"])
    assert not hidden.any()
