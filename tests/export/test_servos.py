"""What leaves of a commanded robot: servos, delay, rollout error; draws of what logs leave open."""

import ast
import json
import re
from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Robot, analyze, export, predict
from identifiability.physical.fitted_model import physical_set
from identifiability.workflows.export import draw_robots, write_parameters

from ..made_servos import draw, load_arm, servos
from ..marks import everything


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A two-link arm with servos, a log of commands and the JSON of its analysis."""
    folder = tmp_path_factory.mktemp("arm")
    robot = load_arm(folder)
    rng = default_rng(3)
    frames = [draw(robot, s, 0.5, servos.Recorder(delay=0.007), rng) for s in (6.0, 3.0)]
    result = analyze(robot, frames[0], frames[1], quick=True)
    return robot, frames, result, result.to_json(folder / "result.json")


def test_a_file_states_its_error_and_which_numbers_of_joints_the_logs_determine(made, succeeds):
    robot, _, result, path = made
    told = json.loads(path.read_text())["rollout"]
    assert told["unseen"]
    assert told["error"] < 0.2 * told["error_file"]
    assert told["statement"] in result.details
    out = path.with_name("stated.xml")
    said = succeeds("export", robot.path, path, "--out", out, "--force").stdout
    assert told["statement"] in said
    joint = re.search(r"shoulder: armature .* \(between 0 and .* frictionloss .* ± .*", said)
    assert joint[0] in out.read_text()


@pytest.mark.parametrize(
    "slide, scale, kv", [(0.0, 0.0, 1), (0.004, 0.0, 1), (0.0, 0.25, 1), (0.0, 0.0, 0)]
)
def test_commands_move_the_written_file_as_they_move_the_result(made, tmp_path, slide, scale, kv):
    robot, frames, result, path = made
    # Joints may have all damping, and dry friction may build up.
    damped = robot.servo.kv
    robot = replace(robot, servo=replace(robot.servo, kv=kv * damped))
    servo = replace(robot.servo, slide=np.full(2, slide))
    told = replace(result.moved, robot=replace(robot, servo=servo)).to_rollout()
    own = tmp_path / "own.json"
    content = json.loads(path.read_text()) | {"rollout": told}
    values = content["physical"]["parameters"]
    values["elbow.scale"] = scale
    for joint, damping in zip(robot.joints, damped - servo.kv, strict=True):
        values[f"{joint}.Fv"] += damping
    own.write_text(json.dumps(content))
    out = tmp_path / "fitted.xml"
    done = export(robot, own, out, validate=frames[1], force=True)
    moved = done.unseen
    assert_allclose(Robot.load(out).servo.slide, slide)
    # A torque that is too large by a scale is that of gains that are.
    assert_allclose(Robot.load(out).servo.kp, [1200, 300 / (1 + scale)])
    assert ("divided by 1 + scale (elbow 1.25)" in str(done.notes)) == (scale > 0)
    isaac = export(robot, own, tmp_path / "servos.py", "isaaclab").robot.read_text()
    assert f"'elbow': {300 / (1 + scale)}}}" in isaac
    told = predict(robot, own, frames[1], forward=True)
    assert_allclose(moved.totals, told.totals, rtol=1e-3)  # the file holds it all
    log = moved.logs[0]
    apart = servos.replay(out, log, moved.runs[-1].delays[0]) - log.q
    alone = np.sqrt(np.mean(apart[len(apart) // 4 :] ** 2))
    assert alone == pytest.approx(moved.totals[-1], rel=0.05)


def test_an_mjcf_gets_the_servos_of_the_sidecar_and_says_delay_and_step(made):
    robot, _, _, path = made
    out = export(robot, path, path.with_name("fitted.xml"), force=True).robot
    text = out.read_text()
    assert re.search(r"Commands act [\d.]+ ms after their rows?", text)
    assert re.search(r"for its own step of 1 ms (.|\n)*let commands act 0.5 ms later", text)
    model = mujoco.MjModel.from_xml_path(str(out))
    assert (model.nu, model.opt.timestep) == (2, 0.001)
    assert_allclose(model.actuator_gainprm[:, 0], [1200, 300])
    damping = robot.servo.damping
    assert_allclose(model.actuator_biasprm[:, 1:3].T, [[-1200, -300], -damping])
    values = json.loads(path.read_text())["physical"]["parameters"]
    kinds = ("off", "Fv", "Fc", "Ia")
    offsets, Fv, Fc, Ia = np.array([[values[f"{j}.{k}"] for j in robot.joints] for k in kinds])
    assert offsets.all()
    assert_allclose(model.actuator_biasprm[:, 0], -offsets)
    assert_allclose(model.actuator_forcerange + offsets[:, None], [[-900, 900]] * 2)
    seen = 0.0005 * (Fv + damping) - robot.servo.lead
    told = model.dof_armature, model.dof_damping, model.dof_frictionloss
    assert_allclose(told, [Ia - seen, Fv, Fc])


def test_servos_of_an_mjcf_go_with_its_urdf(tmp_path):
    robot = Robot.load("hobby-arm")
    saved = Robot.load(robot.save(tmp_path / "arm.xml"))
    assert_array_equal(saved.servo.kv, robot.servo.kv)
    urdf = Robot.load(write_parameters(robot, robot.nominal, tmp_path / "arm.urdf").robot)
    for name in ("kp", "kv", "low", "high"):
        assert_allclose(getattr(urdf.servo, name), getattr(robot.servo, name))
    back = write_parameters(urdf, urdf.nominal, tmp_path / "again.xml").robot
    model = mujoco.MjModel.from_xml_path(str(back))
    assert_allclose(model.actuator_gainprm[:, 0], robot.servo.kp)


def test_a_configuration_for_isaac_lab_holds_what_was_fitted(made, rejected):
    robot, _, _, path = made
    done = export(robot, path, path.with_name("servos.py"), "isaaclab")
    text = done.robot.read_text()
    assert f"# {done.joints[0]}" in text
    lacking = r"cannot hold torque offset \(.*\), up to 0.929 N·m in shoulder"
    assert all(re.search(lacking, said) for said in (text, done.statement))
    (call,) = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call)
               and getattr(n.func, "id", "") == "DelayedPDActuatorCfg"]  # fmt: skip
    told = {k.arg: k.value for k in call.keywords}
    assert ast.literal_eval(told["joint_names_expr"]) == list(robot.joints)
    values = json.loads(path.read_text())["physical"]["parameters"]
    for word, kind in (("armature", "Ia"), ("friction", "Fc"), ("viscous_friction", "Fv")):
        assert ast.literal_eval(told[word]) == pytest.approx(
            {j: values[f"{j}.{kind}"] for j in robot.joints}, rel=1e-5
        )
    assert ast.literal_eval(told["stiffness"]) == {"shoulder": 1200, "elbow": 300}
    limited = replace(
        robot,
        servo=replace(robot.servo, low=np.array([-900, -np.inf]), high=np.array([900, np.inf])),
    )
    again = export(limited, path, path.with_name("limited.py"), "isaaclab")
    # Joints that a table leaves out would have no torque.
    assert "effort_limit={'shoulder': 900.0, 'elbow': 1000000000.0}" in again.robot.read_text()
    with rejected("states no gains of servos"):
        export("two-link", path, path.with_name("none.py"), "isaaclab")


# Draws.


def test_every_draw_is_possible_and_loads_back(made):
    robot, _, _, path = made
    drawn = draw_robots(robot, path, 200)
    assert drawn.values.shape == (200, len(drawn.structure.columns))
    assert physical_set(drawn.structure).contains(drawn.values).all()
    assert_array_equal(drawn.values, draw_robots(robot, path, 200).values)
    assert len(drawn.write(path.with_name("draws.csv"))[0].read_text().splitlines()) == 201
    files = draw_robots(robot, path, 2, seed=1).write(path.with_name("drawn.xml"))
    assert [p.name for p in files] == ["drawn-001.xml", "drawn-002.xml"]
    values = next(draw_robots(robot, path, 2, seed=1).robots)
    loaded = Robot.load(files[0])
    for name in ("shoulder.Fv", "elbow.Ia"):
        assert loaded.nominal[name] == pytest.approx(values[name])


def test_what_logs_determine_hardly_varies_and_what_they_leave_open_does(made):
    robot, _, result, path = made
    narrow, wide = (draw_robots(robot, path, 300, prior=share).to_frame() for share in (0.1, 0.3))
    stated = result.to_frame(details=True).set_index("name")["interval95"]
    for table, name in product((narrow, wide), ("elbow.Fv", "elbow.Fc", "shoulder.Fc")):
        low, high = stated[name]
        ends = table[name].quantile([0.025, 0.975]).to_numpy()
        # Draws lie about the value of rollouts, and intervals about that of the torque.
        assert_allclose(ends, [low, high], rtol=0, atol=0.35 * (high - low))
    rolled = result.recordings.rolled
    late, sd = rolled.delays[0], rolled.delay_errors[0]
    assert wide["delay"].mean() == pytest.approx(late, abs=0.2 * sd)
    assert wide["delay"].std() == pytest.approx(sd, rel=0.3)
    idle = next(n for n in narrow if n.endswith(".m") and robot.nominal[n] > 0)
    for table, share in ((narrow, 0.1), (wide, 0.3)):
        assert table[idle].std() == pytest.approx(share * robot.nominal[idle], rel=0.3)


def joint_share(fit, structure, count, rng):
    """Return how often true base parameters are in the joint 95 % set of draws."""
    region = physical_set(structure)
    nominal = structure.nominal
    root = np.linalg.cholesky(fit.base_covariance)
    bodies = structure.inertial
    inside = 0
    for k in range(count):
        phi = nominal.copy()
        for body in bodies:  # congruent to the file's, within a fifth
            phi[body] *= rng.normal(1, 0.15)
        signed = np.setdiff1d(np.arange(len(phi)), bodies)
        phi[signed] = np.abs(phi[signed]) * rng.uniform(0.5, 2, len(signed)) + 0.1
        assert region.contains(phi[None])[0]
        base = structure.G @ phi + root @ rng.standard_normal(len(root))
        own = replace(fit, values=np.linalg.pinv(fit.submodel.M) @ (base - fit.submodel.fixed))
        drawn = draw_robots(structure.robot, own, 256, seed=k, prior=0.2).values @ structure.G.T
        turn = np.linalg.inv(np.linalg.cholesky(np.cov(drawn.T)))
        far = ((drawn - drawn.mean(0)) @ turn.T) ** 2
        true = (turn @ (structure.G @ phi - drawn.mean(0))) ** 2
        inside += true.sum() <= np.quantile(far.sum(1), 0.95)
    return inside / count


@pytest.mark.parametrize("count", [6, everything(200)])
def test_true_robots_lie_in_the_joint_set_of_the_draws(count, simulated, two_link):
    rng = default_rng(5)
    result = analyze(two_link, simulated("two-link", "a", samples=2000), quick=True)
    own = {"submodel": result.full.submodel, "values": result.full.estimate.value}
    fit = replace(result.fit, **own, alternatives=0.0)
    share = joint_share(fit, result.structure, count, rng)
    assert share >= 0.93 - 1.7 * np.sqrt(0.93 * 0.07 / count)


@pytest.mark.parametrize(
    "words, said",
    [
        (["--draws", "3", "--out", "x.json"], "does not end in .csv, .parquet, .pq, .xml or"),
        (["--prior", "0.3", "--out", "x.xml"], "say how many"),
    ],
)
def test_what_cannot_be_drawn_is_refused(made, words, said, command):
    robot, _, _, path = made
    done = command("export", robot.path, path, *words)
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())
