"""Each effect's columns are what its equation says, on actuated, coupled and passive axes."""

import numpy as np
import pytest

from identifiability import IdentifiabilityError, Log, Model, Robot, prepare_log, simulate
from identifiability.effects import find_effect
from identifiability.regression.structure import random_motion
from identifiability.simulation import (
    Campaign,
    MujocoRobot,
    PrescribedMotion,
    random_trajectory,
    shipped_trajectory,
)


@pytest.fixture
def motion(robot):
    return random_motion(robot, np.random.default_rng(0), 30)


def columns(robot, motion, name):
    effect = find_effect(name)
    W = Model((effect,)).regressor(robot, motion)
    return W, [p.name for p in effect.parameters(robot)]


def test_friction_dissipates(robot, motion):
    for name in (
        "viscous_friction",
        "coulomb_friction",
        "coulomb_asymmetry",
        "passive_joint_friction",
    ):
        if not find_effect(name).parameters(robot):
            continue
        W, _ = columns(robot, motion, name)
        power = np.einsum("nik,ni->nk", W, motion.actuated_v)
        assert (power >= -1e-12).all(), name


def test_an_unknown_effect_is_named_with_its_near_match():
    with pytest.raises(
        IdentifiabilityError, match="'viscous_frition', did you mean 'viscous_friction'"
    ):
        Model.of("viscous_frition")


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


def test_motor_logs_are_converted_to_the_joint_side(coupled):
    trajectory = shipped_trajectory(coupled, "a")
    joint = simulate(coupled, trajectory)
    R = np.array([[50.0, 0.0], [-30.0, -30.0]])
    offset = np.array([0.1, -0.2])
    motor = Log(
        "motor", ("motor1", "motor2"), joint.t, (joint.q - offset) @ R.T,
        np.linalg.solve(R.T, joint.tau.T).T, joint.dq @ R.T, joint.ddq @ R.T, "",
    )  # fmt: skip
    a, b = prepare_log(coupled, joint), prepare_log(coupled, motor)
    for kind in ("actuated_q", "actuated_v", "actuated_a"):
        np.testing.assert_allclose(getattr(b.motion, kind), getattr(a.motion, kind), atol=1e-12)
    np.testing.assert_allclose(b.tau, a.tau, atol=1e-12)
    # Power is the same on either side of the gears.
    np.testing.assert_allclose(
        (motor.tau * motor.dq).sum(1), (joint.tau * joint.dq).sum(1), atol=1e-10
    )


def test_a_joint_coupling_is_a_closure():
    """A gear pair: the second joint follows the first, and its inertia is felt at the first."""
    text = """
    <mujoco><worldbody><body name="base">
      <body name="a"><joint name="j1" axis="0 1 0"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
      <body name="b" pos="0.5 0 0"><joint name="j2" axis="0 1 0"/>
        <inertial pos="0.2 0 0" mass="2" diaginertia="0.02 0.02 0.02"/></body>
    </body></worldbody>
    <equality><joint joint1="j2" joint2="j1" polycoef="0.3 -2 0.1 0 0"/></equality>
    <actuator><motor joint="j1"/></actuator></mujoco>"""
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gear.xml"
        path.write_text(text)
        robot = Robot.load(path)
        t = np.linspace(0, 1, 7)
        move = PrescribedMotion(t, np.sin(t)[:, None], np.cos(t)[:, None], -np.sin(t)[:, None])
        from identifiability.robot import complete_motion

        motion = complete_motion(robot, t, move.q, move.dq, move.ddq)
        q1 = np.sin(t)
        np.testing.assert_allclose(motion.q[:, 1], 0.3 - 2 * q1 + 0.1 * q1**2, atol=1e-12)
        W = Model.of("rigid_body").regressor(robot, motion)
        phi = [robot.nominal[p.name] for p in Model.of("rigid_body").parameters(robot)]
        tau = MujocoRobot(robot).inverse_dynamics(move.q, move.dq, move.ddq).tau
        np.testing.assert_allclose(W @ np.array(phi), tau, atol=1e-10)


def test_a_joint_without_masses_has_no_load_and_not_that_of_rounding():
    """Roll, wrist and jaws of this file have none: noise would be a billion times 1e-14 N·m.

    What the load moves in the next joint is still there.
    """
    robot = Robot.load("dvrk-psm")
    along = random_motion(robot, np.random.default_rng(0), 30)
    W, names = columns(robot, along, "load_dependent_friction")
    loaded = {name for k, name in enumerate(names) if W[:, :, k].any()}
    assert loaded == {f"{j}.Fl" for j in ("yaw", "pitch", "insertion")}
    # Nor where the loops of the arm round what the others carry into it.
    moved = [random_trajectory(robot, np.random.default_rng(k)) for k in range(2)]
    hidden = Campaign.of(robot, moved).hidden(["backlash@roll=1", "backlash@jaw2=1"])
    assert not hidden.any()
