"""Laws of shipped robots: numbers of base parameters, and values that come back.

Two dVRK arms, a SCARA and a differential wrist came from tables; the mechanisms have loops.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

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
from identifiability.effects import default_effects
from identifiability.regression.reduction import ladder_path, read_ladder
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory

from ..marks import everything

ARMS = ("dvrk-mtm", "dvrk-psm")
SHORT = ("scara", "differential-wrist", "delta")
LONG = (*ARMS, "3-rrr", "palletizer", "six-actuators")
BASICS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def model_of(robot):
    """The published model of the dVRK arms, the default one of the others."""
    path = ladder_path(robot)
    effects = (
        default_effects(robot, BASICS) if path is None else read_ladder(path).models[0].effects
    )
    return Model.of(*effects)


@pytest.mark.parametrize("name, bodies, whole", [("dvrk-mtm", 46, 73), ("dvrk-psm", 17, 49)])
def test_the_arms_have_the_published_numbers_of_base_parameters(name, bodies, whole):
    robot = Robot.load(name)
    model = model_of(robot)
    rigid = Model.of(*(text for text in model.texts if text.startswith("rigid_body")))
    for part, expected in ((rigid, bodies), (model, whole)):
        base = find_base_parameters(robot, part)
        assert (base.rank, base.ambiguous) == (expected, False)
        assert base.gap[0] > 1e6 * base.gap[1]
    assert find_base_parameters(robot, Model.of(*default_effects(robot, BASICS))).rank == whole


def test_the_counter_spring_and_the_cable_are_the_published_ones():
    robot = Robot.load("dvrk-mtm")
    q = np.zeros((60, 7))
    q[:, 3], q[:, 4] = np.linspace(-1.9, 1.9, 60), np.linspace(-1.5, 2.2, 60)
    motion = complete_motion(robot, np.arange(60.0), q, 0 * q, 0 * q)
    W = Model.of("joint_stiffness@counter_spring").regressor(robot, motion)
    r_s = 0.0075
    h = 0.1035
    rest = 0.0613
    angle = np.pi + np.radians(23) - q[:, 4]
    length = np.sqrt(r_s**2 + h**2 - 2 * r_s * h * np.cos(angle))
    arm = r_s * h * np.sin(angle) / length
    assert_allclose(W[:, 4, 0], -arm * (length - rest), rtol=0, atol=1e-12)
    assert robot.nominal["counter_spring.K"] == 271
    x = q[:, 3]
    cable = (0.0004877 * x**7 - 0.0037149 * x**6 + 0.0067497 * x**5 + 0.008519 * x**4
             - 0.0201475 * x**3 - 0.025265 * x**2 + 0.048095 * x + 0.00255)  # fmt: skip
    (known,) = robot.known_torque
    assert known.along == "m4"
    assert_allclose(known.force(x), cable, atol=1e-12)
    (m4,) = (a for a in robot.axes if a.name == "m4")
    assert_allclose(m4.row, [0, -0.6697, 0.6697, 1, 0, 0, 0])


def test_the_motors_of_the_other_arm_mix_its_wrist_as_published():
    robot = Robot.load("dvrk-psm")
    M = np.array([[1.0186, 0, 0], [-0.8306, 1.2178, 0], [-0.8306, 0, 1.2178]])
    assert_allclose(robot.transmission.coupling[4:, 4:] @ M, np.eye(3), atol=1e-12)
    assert {n: dict(c) for n, c in robot.combinations.items()} == {
        "jaws": {"jaw2": 1.0, "jaw1": -1.0}
    }
    assert [a.name for a in robot.axes if a.mixed] == ["m6", "m7", "jaws"]


@pytest.mark.parametrize("name", [*SHORT, *(everything(name) for name in LONG)])
def test_the_values_of_the_files_come_back_from_torque_without_noise(name):
    robot = Robot.load(name)
    model = model_of(robot)
    base = find_base_parameters(robot, model)
    move = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    assert (robot.limits[:, 0] < move.q.min(0)).all()
    assert (move.q.max(0) < robot.limits[:, 1]).all()
    samples = prepare_log(robot, simulate(robot, move))
    assert samples.motion.singular == 0
    fit = estimate(gather_information(Regression(robot, model, (samples,), base.kept)), "ols")
    assert fit.determined.all()
    truth = base.G @ [robot.nominal.get(p.name, 0.0) for p in base.parameters]
    W = model.regressor(robot, samples.motion)[:, :, list(base.kept)]
    size = np.abs(W @ truth).max()
    assert_allclose(W * fit.value, W * truth, rtol=1e-5, atol=1e-8 * size)
    assert len([n for n in base.names if n.endswith(".Fc")]) >= len(robot.joints)
