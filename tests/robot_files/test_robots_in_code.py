"""Robots that are changed or built in code obey Pinocchio and MuJoCo as files of them would."""

import pickle

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot
from identifiability.robot import complete_motion

from ..roads import RIGID, nominal_torque

MASS, CENTRE, INERTIA = 1.7, (0.03, -0.05, 0.11), (0.004, 0.006, 0.005)


@pytest.fixture
def rng():
    return np.random.default_rng(18)


@pytest.mark.parametrize("name", ["six-dof-arm", "two-link", "scara"])
def test_a_payload_is_that_of_pinocchio(name, rng):
    robot = Robot.load(name)
    body = robot.bodies[-1]
    loaded = robot.with_payload(mass=MASS, centre=CENTRE, inertia=INERTIA, body=body)
    theirs = robot.model.copy()
    load = pin.Inertia(MASS, np.array(CENTRE), np.diag(INERTIA))
    theirs.appendBodyToJoint(theirs.njoints - 1, load, pin.SE3.Identity())
    theirs.armature = loaded.model.armature  # a sidecar's rotors are in the file now
    data = theirs.createData()
    for _ in range(3):
        q, v, a = (
            pin.randomConfiguration(theirs, -np.ones(theirs.nq), np.ones(theirs.nq)),
            *rng.uniform(-1, 1, (2, theirs.nv)),
        )
        ours = pin.rnea(loaded.model, loaded.model.createData(), q, v, a)
        assert_allclose(ours, pin.rnea(theirs, data, q, v, a), rtol=1e-10, atol=1e-10)
    assert robot.nominal != loaded.nominal
    assert Robot.load(name).nominal == robot.nominal  # the shipped file is as it was


def test_a_changed_body_weighs_in_mujoco_what_was_asked_for(tmp_path):
    robot = Robot.load("two-link").with_body("link2", mass=3.5, centre=(0.1, 0.02, 0.0))
    made = mujoco.MjModel.from_xml_path(str(robot.save(tmp_path / "arm.xml")))
    at = mujoco.mj_name2id(made, mujoco.mjtObj.mjOBJ_BODY, "link2")
    assert made.body_mass[at] == pytest.approx(3.5, rel=1e-12)
    assert_allclose(made.body_ipos[at], (0.1, 0.02, 0.0), atol=1e-12)
    before = Robot.load("two-link")
    grown = before.with_body("link2", mass=2 * before.nominal["link2.m"])  # the same shape
    for kind in ("mx", "my", "Ixx", "Iyy", "Izz"):
        assert grown.nominal[f"link2.{kind}"] == pytest.approx(2 * before.nominal[f"link2.{kind}"])
    only = before.with_body("link2", inertia=(0.1, 0.2, 0.15))
    for kind in ("m", "mx", "my", "mz"):
        assert only.nominal[f"link2.{kind}"] == pytest.approx(before.nominal[f"link2.{kind}"])


def test_what_is_changed_keeps_all_the_rest_also_of_a_closed_chain():
    robot = Robot.load("3-rps")
    changed = robot.with_values({"slider1.Fv": 55.0})
    differ = {
        n for n, v in robot.nominal.items() if changed.nominal[n] != pytest.approx(v, abs=1e-12)
    }
    assert differ == {"slider1.Fv"}
    assert (changed.name, changed.title, changed.joints) == (robot.name, robot.title, robot.joints)
    assert changed.path.with_name("ladder.toml").is_file()
    assert changed.sha256 != robot.sha256
    assert pickle.loads(pickle.dumps(changed)).sha256 == changed.sha256


def test_changes_add_up_and_survive_each_other(tmp_path):
    robot = Robot.load("six-dof-arm")
    joint = robot.joints[5]
    body = robot.bodies[2]
    made = robot.with_lock({joint: 0.4}).with_body(body, mass=9.0).with_values({"joint_1.Ia": 0.7})
    assert made.locked == {joint: 0.4}
    assert joint not in made.joints
    again = Robot.load(made.save(tmp_path / "mine.urdf"))
    assert (again.locked, again.joints) == (made.locked, made.joints)
    assert again.nominal == pytest.approx(made.nominal, rel=1e-12, abs=1e-12)
    assert again.nominal[f"{body}.m"] == pytest.approx(9.0)
    assert again.nominal["joint_1.Ia"] == 0.7
    plain = Robot.load("six-dof-arm", lock={joint: 0.4})
    assert robot.with_lock([f"{joint}=0.4"]).nominal == plain.nominal


def links():
    return [
        {"name": "upper", "joint": "shoulder", "axis": (0, 1, 0), "position": (0, 0, 0.5),
         "rpy": (0.3, -0.2, 0.7), "mass": 2.0, "centre": (0.2, 0.01, 0.03),
         "inertia": {"xx": 0.02, "yy": 0.03, "zz": 0.04, "xy": 0.001, "xz": -0.002, "yz": 0.003}},
        {"name": "fore", "joint": "elbow", "axis": (0, 0.6, 0.8), "position": (0.4, 0, 0.1),
         "rpy": (-1.0, 0.4, 0.2), "mass": 1.0, "centre": (0.15, 0, 0),
         "inertia": {"xx": 0.01, "yy": 0.02, "zz": 0.02}},
        {"name": "rod", "joint": "slide", "type": "prismatic", "axis": (1, 0, 0), "mass": 0.5,
         "range": (0, 0.3)},
    ]  # fmt: skip


def by_hand():
    """Return the same robot made of Pinocchio's own parts."""
    model = pin.Model()
    joints = [
        pin.JointModelRevoluteUnaligned(0, 1, 0),
        pin.JointModelRevoluteUnaligned(0, 0.6, 0.8),
        pin.JointModelPX(),
    ]
    for k, (row, joint) in enumerate(zip(links(), joints, strict=True)):
        place = pin.SE3(
            pin.rpy.rpyToMatrix(*map(float, row.get("rpy", (0, 0, 0)))),
            np.array(row.get("position", (0, 0, 0)), float),
        )
        at = model.addJoint(k, joint, place, row["joint"])
        i = row.get(
            "inertia",
            {"xx": 0.01 * row["mass"], "yy": 0.01 * row["mass"], "zz": 0.01 * row["mass"]},
        )
        xy, xz, yz = (i.get(key, 0.0) for key in ("xy", "xz", "yz"))
        tensor = np.array([[i["xx"], xy, xz], [xy, i["yy"], yz], [xz, yz, i["zz"]]])
        model.appendBodyToJoint(
            at,
            pin.Inertia(row["mass"], np.array(row.get("centre", (0, 0, 0)), float), tensor),
            pin.SE3.Identity(),
        )
    return model


@pytest.mark.parametrize("ending", ["", ".xml", ".urdf"])
def test_a_robot_of_links_moves_as_pinocchio_and_mujoco_say(ending, rng, tmp_path, agrees):
    robot = Robot.build(links(), name="three", sidecar={"nominal": {"elbow.Fv": 0.3}})
    assert (robot.name, robot.joints) == ("three", ("shoulder", "elbow", "slide"))
    assert robot.nominal["elbow.Fv"] == 0.3
    if ending:
        robot = Robot.load(robot.save(tmp_path / f"three{ending}"))
        assert robot.nominal["elbow.Fv"] == 0.3
    theirs = by_hand()
    q, v, a = rng.uniform(-1, 1, (3, 5, 3))
    ours = nominal_torque(robot, complete_motion(robot, np.arange(5.0), q, v, a), RIGID)
    data = theirs.createData()
    want = np.array([pin.rnea(theirs, data, *row) for row in zip(q, v, a, strict=True)])
    assert_allclose(ours, want, rtol=1e-9, atol=1e-9)
    if ending == ".xml":
        agrees(robot.path.read_text())


def test_a_table_of_denavit_and_hartenberg_needs_no_file():
    table = {"convention": "standard", "links": [{"name": "a", "joint": "j1", "a": 0.3}]}
    assert Robot.from_dh(table).joints == ("j1",)


LINK = {"name": "a", "joint": "j"}


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda r: r.with_body("link9", mass=1), "no moving body 'link9'"),
        (
            lambda r: r.with_body("link2", mass=-1),
            "mass must be a number above 0",
        ),
        (lambda r: r.with_body("link2", inertia=(1, 1, 9)), "No real body"),
        (
            lambda r: r.with_body("link2", centre=(1, 2)),
            "a centre of three numbers",
        ),
        (lambda r: r.with_values({"link2.q": 1.0}), "no parameter 'link2.q'"),
        (lambda r: r.with_lock(["knee"]), "names 'knee', which"),
        (lambda r: r.save("arm.pdf"), "does not end in .xml or .urdf"),
        (lambda _: Robot.build([{**LINK, "d": 1}]), "has 'd', which"),
        (lambda _: Robot.build([{**LINK, "axis": (0, 0, 0)}]), "zero"),
        (lambda _: Robot.build([{"name": "a", "jiont": "j"}]), "jiont"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(change, sentence, rejected, two_link):
    with rejected(sentence):
        change(two_link)


def test_a_load_on_several_ends_must_be_told_where(rejected):
    with rejected(r"left_distal, right_distal .* body="):
        Robot.load("five-bar").with_payload(mass=1.0)
