"""Laws of the shipped mechanisms: MuJoCo's torque, counts by energy, values that come back.

They stand beside `ROBOTS` of the other tests, which run every law on every robot.
"""

import numpy as np
import pytest

from identifiability import (
    Model,
    Regression,
    Robot,
    estimate,
    find_base_parameters,
    gather_information,
    prepare_log,
    simulate,
)
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory

LONG = pytest.mark.everything
MECHANISMS = ("delta", "3-rrr", "palletizer", "six-actuators")
EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def within_limits(robot, count=20, seed=0):
    """Random states within the limits of the sidecar."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(*robot.limits.T, (count, len(robot.joints)))
    return q[np.argsort(q[:, 0])], *rng.normal(size=(2, *q.shape))


@pytest.mark.parametrize("name", MECHANISMS[:3])
def test_a_mechanism_is_what_mujoco_makes_of_it(name, agrees):
    robot = Robot.load(name)
    middle, half = robot.limits.mean(1), 0.5 * np.ptp(robot.limits, axis=1)
    from_home = half - np.abs(middle - robot.actuated_positions(robot.home[None])[0])
    assert (from_home > 0.6 * half).all()
    agrees(robot.path.read_text(), spread=from_home)


@pytest.mark.parametrize("name", MECHANISMS)
def test_no_pose_within_the_limits_is_near_singular_or_out_of_reach(name):
    robot = Robot.load(name)
    q, v, a = within_limits(robot, 500, seed=1)
    motion = complete_motion(robot, np.arange(500) * 1.0, q, v, a)
    assert len(motion) == 500
    assert motion.condition < 50
    for trajectory in "abc":
        move = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 150)
        assert (move.q > robot.limits[:, 0]).all()
        assert (move.q < robot.limits[:, 1]).all()


@pytest.mark.parametrize(
    "name", [MECHANISMS[0], *(pytest.param(m, marks=LONG) for m in MECHANISMS[1:])]
)
def test_the_files_values_come_back_from_torque_without_noise(name):
    robot, model = Robot.load(name), Model.of(*EFFECTS)
    kept = find_base_parameters(robot, model).kept
    move = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    samples = prepare_log(robot, simulate(robot, move))
    regression = Regression(robot, model, (samples,), kept)
    fit = estimate(gather_information(regression), "ols")
    assert fit.determined.all()
    truth = np.array([robot.nominal.get(p.name, 0.0) for p in model.parameters(robot)])
    torque = model.regressor(robot, samples.motion)
    expected = torque @ truth
    np.testing.assert_allclose(
        torque[:, :, list(kept)] @ fit.value, expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )
    found = dict(zip([model.parameters(robot)[k].name for k in kept], fit.value, strict=True))
    friction = {n: x for n, x in found.items() if n.endswith((".Fv", ".Fc"))}
    assert len(friction) == 2 * len(robot.joints)
    for key, value in friction.items():
        assert value == pytest.approx(robot.nominal[key], rel=1e-7), key
