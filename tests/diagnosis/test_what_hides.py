"""What a motion can never name gains nothing: it looks like parameters that the model has."""

import numpy as np

from identifiability import Model, Robot, diagnose, prepare_log, simulate
from identifiability.regression.structure import Structure
from identifiability.simulation import random_trajectory
from identifiability.workflows.diagnose import Problem, look
from identifiability.workflows.diagnose.problem import know_nothing

HIDDEN = ("coulomb_asymmetry", "torque_offset")


def odds(robot, logs, *model, effects=None):
    samples = tuple(prepare_log(robot, log) for log in logs)
    structure = Structure.of(robot, Model.of(*model))
    found = look(Problem(structure, samples, know_nothing(structure)), effects)
    return {t.group.key: t.odds for t in found.before}


def test_asymmetry_and_offset_hide_behind_gravity_on_the_3_rps(rps, logs_of):
    found = odds(
        rps, logs_of("3-rps")[:4], "rigid_body", "viscous_friction", "coulomb_friction",
        "actuator_inertia", effects=(*HIDDEN, "stribeck_friction"),
    )  # fmt: skip
    for joint in rps.joints:
        assert all(found[family, joint] <= 0 for family in HIDDEN)


def test_the_rotor_of_the_first_joint_is_its_links_inertia(logs_of):
    robot = Robot.load("six-dof-arm")
    model = ("rigid_body", "viscous_friction", "coulomb_friction")
    found = odds(robot, logs_of("six-dof-arm")[:2], *model, effects=["actuator_inertia"])
    assert found["actuator_inertia", "joint_1"] <= 0


def test_what_is_missing_in_logs_without_noise_is_named(named, tmp_path):
    """A simulator's torque is exact: beside all that may be missing rounding alone is left."""
    robot = Robot.load("two-link")
    rng = np.random.default_rng(0)
    stiff = tmp_path / "stiff.xml"
    text = robot.path.read_text()
    stiff.write_text(text.replace('damping="0.6"', 'stiffness="4" damping="0.6"'))
    shapes = [random_trajectory(robot, rng) for _ in range(3)]
    logs = [simulate(str(stiff), shape) for shape in shapes]
    found = diagnose(robot, logs[:2], logs[2:], quick=True)
    assert named(found) == [("joint_stiffness", ("elbow",))]
    assert found.held_after < 1e-6 < 0.01 < found.held_before
