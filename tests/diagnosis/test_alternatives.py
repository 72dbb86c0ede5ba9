"""Under a wrong model everything seems to be missing: other ones of the same torque come first."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects.nominal import gravity_torque
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.simulation import Noise, random_trajectory, simulate
from identifiability.workflows.alternatives import find_alternative
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.oddities import MeasuredLogs

MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def record(name, seed=1, masses=1.0, **noise):
    """Return a robot, and a log of one whose masses are so many times the file's."""
    robot, rng = Robot.load(name), np.random.default_rng(seed)
    bodies = {n: masses * x for n, x in robot.nominal.items() if n.split(".")[0] in robot.bodies}
    truth = robot.with_values(bodies)
    noise = Noise(**{"additive": 0.02, "correlation": 0.9, "encoder": 1e-5, **noise})
    return robot, simulate(truth, random_trajectory(truth, rng, samples=600), noise=noise, rng=rng)


def look(robot, log):
    samples = (prepare_samples(robot, log),)
    return find_alternative(MeasuredLogs(Structure.of(robot, MODEL), (log,), samples))


def bare(robot, log):
    """Return a log whose driver took the weight out of its torque."""
    motion = complete_motion(robot, log.t, log.q, 0 * log.q, 0 * log.q)
    return replace(log, tau=log.tau - gravity_torque(robot, motion, robot.gravity))


@pytest.fixture(scope="module")
def arm():
    return record("six-dof-arm")


@pytest.mark.parametrize("joint", [0, 3, 5])
@pytest.mark.parametrize(
    ("factor", "says"), [(-1.0, "seems to have the wrong sign"), (1e-3, "is 0.001 times as large")]
)
def test_a_torque_of_another_sign_or_unit_is_found(arm, joint, factor, says):
    robot, log = arm
    scale = np.where(np.arange(6) == joint, factor, 1.0)
    found = look(robot, replace(log, tau=scale * log.tau))
    assert found.says.startswith(f"The torque of {log.joints[joint]} {says}")
    np.testing.assert_allclose(found.read(replace(log, tau=scale * log.tau)).tau, log.tau)


@pytest.mark.parametrize("first", [0, 4])
def test_exchanged_torque_is_found(arm, first):
    robot, log = arm
    order = np.arange(6)
    order[[first, first + 1]] = first + 1, first
    found = look(robot, replace(log, tau=log.tau[:, order]))
    assert found.order.tolist() == order.tolist()


@pytest.mark.parametrize("name", ["two-link", "six-dof-arm"])
def test_effort_without_weight_is_found_whatever_masses_the_file_has(name):
    for masses in (1.0, 3.0):
        robot, log = record(name, masses=masses)
        light = bare(robot.with_values({n: masses * x for n, x in robot.nominal.items()}), log)
        assert not look(robot, light).gravity


def test_late_torque_is_found():
    robot, log = record("two-link")
    found = look(robot, replace(log, tau=np.roll(log.tau, 10, 0)))
    np.testing.assert_allclose(found.late, 10 * np.median(np.diff(log.t)), rtol=0.2)


@pytest.mark.parametrize("masses", [1.0, 3.0, 1 / 3, 10.0])
@pytest.mark.parametrize("name", ["two-link", "six-dof-arm", "3-rps"])
def test_no_other_model_is_chosen_where_masses_alone_are_the_file_s_no_more(name, masses):
    for seed in range(6 if masses == 1.0 else 2):
        robot, log = record(name, seed=10 + seed, masses=masses, additive=0.05, correlation=0.95)
        assert look(robot, log) is None


def test_it_is_diagnosed_under_the_other_model_and_held_out_logs_do_not_choose():
    robot, log = record("two-link")
    unseen = record("two-link", seed=2)[1]
    turned = [replace(x, tau=x.tau * [1.0, -1.0]) for x in (log, unseen)]
    found = diagnose(robot, *turned, quick=True)
    assert found.hints[0] == found.alternative
    assert "elbow seems to have the wrong sign" in found.alternative
    assert found.held_before < 0.2
    wrong = diagnose(robot, log, turned[1], quick=True)
    assert not wrong.alternative


def test_a_file_of_placeholder_masses_is_diagnosed_as_any_other():
    robot, log = record("six-dof-arm", masses=0.1)
    found = diagnose(robot, log, record("six-dof-arm", seed=2, masses=0.1)[1], quick=True)
    assert not found.nothing
    assert not found.alternative
    assert found.evidence
