"""Axes that combine joints: columns, springs and rotors as MuJoCo's fixed tendons have them."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Log, Model, Noise, Robot, analyze, simulate
from identifiability.effects import default_effects
from identifiability.effects.effect import measure_spans
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare.preparation import joint_log
from identifiability.regression.reduction import build_ladder, default_ladder, ladder_model
from identifiability.regression.structure import Structure, random_motion
from identifiability.report.answers.values_table import joint_values
from identifiability.simulation.motion import find_motion

from .made_robots import CABLE, CLOSURES, LOOP_CABLE, arm, parallelogram

SIDECAR = """
[[axes]]
name = "cable"
joints = {shoulder = 1.3, elbow = -0.5}
rest = 0.2

[nominal]
"cable.Fv" = 1.1
"cable.Fc" = 0.7
"cable.Ia" = 0.3
"cable.K" = 9
"""


def test_a_sidecar_says_the_same_axis_as_a_tendon_of_the_file(load_text, tmp_path):
    ours = load_text(arm(), sidecar=SIDECAR)
    (tmp_path / "tendon").mkdir()
    (tmp_path / "tendon/robot.xml").write_text(arm(after=CABLE))
    theirs = Robot.load(tmp_path / "tendon/robot.xml")
    assert {k: v for k, v in ours.nominal.items() if v} == pytest.approx(
        {k: v for k, v in theirs.nominal.items() if v}
    )
    motion = random_motion(ours, default_rng(0), 20)
    model = Model.of("viscous_friction", "coulomb_friction", "joint_stiffness", "actuator_inertia")
    names = [p.name for p in model.parameters(ours)]
    own = [n.removeprefix("cable.") for n in names if n.startswith("cable")]
    assert own == ["Fv", "Fc", "K", "Ia"]
    assert_allclose(model.regressor(ours, motion), model.regressor(theirs, motion), atol=1e-12)


def test_an_axis_through_passive_joints_of_a_loop_is_what_mujoco_makes_of_it(agrees):
    text = parallelogram(CLOSURES["site on the root"]).replace("</mujoco>", LOOP_CABLE)
    robot = agrees(text, spread=0.4)
    (axis,) = (a for a in robot.axes if a.mixed)
    assert axis.row is None
    assert robot.tendons == ("cable",)


def test_locked_joints_of_an_axis_stretch_its_spring_alone(agrees, tmp_path):
    robot = agrees(arm(after=CABLE), lock={"elbow": 0.4})
    assert robot.nominal["shoulder.K"] == pytest.approx(9 * 1.3**2)  # along one joint again
    three = CABLE.replace("</fixed>", '<joint joint="w" coef="0.8"/></fixed>')
    wrist = (
        '<body name="wrist" pos="0.2 0 0"><joint name="w" axis="0 1 0"/><geom size="0.1"/></body>'
    )
    motors = "".join(f'<motor joint="{j}"/>' for j in ("shoulder", "elbow", "w"))
    text = arm(after=three, inside=wrist, actuator=f"<actuator>{motors}</actuator>")
    robot = agrees(text, lock={"w": -0.3})
    assert {n: dict(c) for n, c in robot.combinations.items()} == {
        "cable": {"shoulder": 1.3, "elbow": -0.5}
    }
    assert robot.rest["cable"] == pytest.approx(0.2 + 0.8 * 0.3)
    copy = Robot.load(robot.with_values({"cable.K": 4.0}).save(tmp_path / "copy.xml"))
    assert copy.rest["cable"] == pytest.approx(robot.rest["cable"])
    assert (copy.nominal["cable.K"], copy.nominal["cable.Fv"]) == (4.0, 1.1)


def test_every_effect_along_an_axis_is_that_of_its_coordinate(load_text):
    robot = load_text(arm(), sidecar=SIDECAR)
    motion = random_motion(robot, default_rng(1), 40)
    row = np.array([1.3, -0.5])
    s = motion.actuated_q @ row
    v = motion.actuated_v @ row
    forces = {
        "quadratic_friction@cable": [v * np.abs(v)],
        "stribeck_friction@cable:0.3": [np.exp(-np.abs(v) / 0.3) * np.sign(v)],
        "position_ripple@cable:0.5": [np.sin(4 * np.pi * s), np.cos(4 * np.pi * s)],
        "coulomb_asymmetry@cable": [np.sign(v)],
        "torque_offset@cable": [np.ones(40)],
        "torque_offset@c*e": [np.ones(40)],
    }
    for text, expected in forces.items():
        model = Model.of(text)
        assert {p.owner for p in model.parameters(robot)} == {"cable"}, text
        W = model.regressor(robot, motion)
        wanted = np.stack([f[:, None] * row for f in expected], axis=2)
        assert_allclose(W, wanted, atol=1e-12, err_msg=text)
    span = measure_spans(robot, [motion])["cable"]
    assert span.position_range == pytest.approx(np.ptp(s))
    assert span.rms_speed == pytest.approx(np.sqrt(np.mean(v**2)))


def test_passive_joints_can_have_what_is_placed_there(load_text):
    text = parallelogram(CLOSURES["site on the root"]).replace("</mujoco>", LOOP_CABLE)
    robot = load_text(text)
    motion = random_motion(robot, default_rng(0), 20)
    model = Model.of("joint_stiffness@knee", "viscous_friction@knee", "load_dependent_friction")
    assert [p.name for p in model.parameters(robot)][:2] == ["knee.K", "knee.Fv"]
    W = model.regressor(robot, motion)
    k = robot.passive.index("knee")
    stretch = robot.dof_position(motion.q, "knee") - robot.dof_position(robot.home[None], "knee")
    assert_allclose(W[:, 0, 0], -motion.X[:, k, 0] * stretch)
    assert_allclose(W[:, 0, 1], motion.X[:, k, 0] ** 2 * motion.actuated_v[:, 0])
    assert np.isfinite(W).all()


@pytest.mark.parametrize(
    "placed, texts",
    [('"coulomb_friction@cable+elbow"', ["viscous_friction", "coulomb_asymmetry@cable+elbow"]),(
            '"position_ripple@cable:0.2", "position_ripple@elbow"',
            ["viscous_friction", "coulomb_asymmetry", "position_ripple@cable:0.2",
             "position_ripple@elbow"],
        ),
        ('"free_spring@elb*"', ["viscous_friction", "coulomb_asymmetry", "free_spring@elb*"]),
        ('"torque_drift"', ["viscous_friction", "coulomb_asymmetry", "torque_drift"]),],
)  # fmt: skip
def test_a_sidecar_places_effects_of_default_models(placed, texts, load_text):
    robot = load_text(arm(), sidecar=f"effects = [{placed}]\n" + SIDECAR)
    found = default_effects(robot, ("viscous_friction", "coulomb_asymmetry"))
    assert list(found) == [*texts[:2], "joint_stiffness", *texts[2:]]
    other = default_effects(robot, ("coulomb_friction",))
    assert ("coulomb_friction" in other) != ("coulomb" in placed)
    ladder = default_ladder(robot)
    models = build_ladder(ladder, Structure.of(robot, ladder_model(ladder)))
    offsets = sum(c.endswith("off") for c in models[0].columns)
    superseded = len(robot.joints) if "drift" in placed else "spring" in placed
    assert len(models[0]) - len(models[-1]) == offsets == len(robot.joints) - superseded


def test_more_motors_than_joints_agree_in_the_least_squares_and_add_their_torques(
    load_text, tmp_path, rng
):
    """Three cables over two joints; the positions contradict each other by an error."""
    robot = load_text(arm(), sidecar=(
        '[transmission]\nmotors = ["shoulder", "c2", "c3"]\ncoupling = [[1, 0], [1, 1], [0, 2]]\n'
        "ratio = [2, -3, 1]\noffset = [0.1, -0.2]\n[columns]\nelbow = {offset = 1}\n"
    ))  # fmt: skip
    (q, dq, ddq), tau = rng.normal(size=(3, 50, 2)), rng.normal(size=(50, 3))
    R = np.array([[2, 0], [-3, -3], [0, 2.0]])
    left = np.linalg.svd(R)[0][:, 2]  # what no joint does
    at = (q - [0.1, -0.2]) @ R.T + 0.1 * left
    t = np.arange(50) / 100
    names = robot.transmission.motors
    motors = Log("log", names, t, at, tau, dq @ R.T, ddq @ R.T, sha256="")
    joints = joint_log(robot, motors)
    motors.write(tmp_path / "motors.csv")
    read = Log.read(tmp_path / "motors.csv", Conventions.of(robot))
    assert "[columns] of elbow was not used, as the log has motors" in str(read.notes)
    assert_allclose(find_motion(robot, str(tmp_path / "motors.csv")).q, q, atol=1e-12)
    assert_allclose(joints.q, q, atol=1e-12)
    assert_allclose(joints.dq, dq, atol=1e-12)
    assert_allclose(joints.tau, tau @ R, atol=1e-12)
    frame = motors.to_frame().filter(regex="^t$|tau")
    frame[["shoulder.q", "elbow.q"]] = q - [0, 1]
    both = joint_log(robot, Log.from_frame(frame, "mixed", Conventions.of(robot)))
    assert "computed from those of the joints" in str(both.notes)
    assert_allclose(np.hstack([both.q, both.tau]), np.hstack([q, tau @ R]), atol=1e-12)
    assert [a.name for a in robot.axes] == ["shoulder", "elbow", "c2"]


def test_values_of_a_motor_that_mixes_joints_have_a_row_of_their_own():
    robot, rng = Robot.load("differential-wrist"), default_rng(0)
    motion, other = find_motion(robot, "random", 150, rng), {"left.Fc": 0.2}
    log = simulate(robot, motion, noise=Noise(torque=0.02), parameters=other, rng=rng)
    values = joint_values(analyze(robot, log, "none", quick=True), "all")
    assert [row[0].text for row in values.rows] == ["pitch", "roll", "left", "right"]
    marked = [row[0].text for row in values.rows if any("≠ file" in cell.note for cell in row)]
    assert marked == ["left"]
