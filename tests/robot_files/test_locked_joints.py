"""Laws of locked joints: the robot is the one whose joints are welded where they are held."""

from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Robot, analyze, export, simulate
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.simulation import PrescribedMotion, random_trajectory
from identifiability.simulation.forward import ForwardRobot

from .made_robots import CLOSURES, arm, parallelogram

#: Two fingers on a turned hand; the second follows the first, and a tendon drives both.
HAND = """<body name="hand" pos="0.4 0.01 0" euler="0.2 0.1 0.3">
    <inertial mass="0.7" pos="0.01 0 0.03" diaginertia="0.002 0.001 0.0015"/>
    <body name="left" pos="0 0.02 0.06"><joint name="f1" type="slide" axis="0 1 0" range="0 0.04"
      damping="3" stiffness="20" springref="0.03"/>
      <inertial mass="0.2" pos="0 0.01 0.02" diaginertia="0.0002 0.0001 0.00015"/>
      <body name="pad" pos="0 0 0.05"><inertial mass="0.05" pos="0 0.004 0"
        diaginertia="1e-5 2e-5 1e-5"/></body></body>
    <body name="right" pos="0 -0.02 0.06"><joint name="f2" type="slide" axis="0 -1 0" ref="0.01"/>
      <inertial mass="0.2" pos="0 -0.01 0.02" diaginertia="0.0002 0.0001 0.00015"/></body></body>"""
SPLIT = """<tendon><fixed name="split"><joint joint="f1" coef="0.5"/><joint joint="f2" coef="0.5"/>
    </fixed></tendon><equality><joint joint1="f2" joint2="f1"/></equality>"""
MOTORS = """<actuator><motor joint="shoulder"/><motor joint="elbow"/><motor tendon="split"/>
    </actuator>"""


def gripper(**parts):
    return arm(inside=HAND, after=SPLIT, actuator=MOTORS, **parts)


def inertias(robot):
    return {b: [robot.nominal[f"{b}.{k}"] for k in INERTIAL_KINDS] for b in robot.bodies}


def same_inertias(robot, other):
    assert robot.bodies == other.bodies
    for body, theta in inertias(robot).items():
        assert_allclose(theta, inertias(other)[body], rtol=0, atol=1e-12)


@pytest.mark.parametrize("held", ["f1=0.03", "f1"])
def test_a_locked_gripper_is_part_of_the_arm_on_both_roads(held, agrees):
    robot = agrees(gripper(), lock=[held])
    assert robot.joints == ("shoulder", "elbow")
    assert robot.bodies == ("link1", "link2")
    assert not robot.closed
    assert set(robot.locked) == {"f1", "f2"}
    # MuJoCo writes couplings in displacements from the reference positions.
    first = {"f1=0.03": 0.03, "f1": 0.0}[held]
    assert robot.locked == pytest.approx({"f1": first, "f2": first + 0.01})
    assert not [name for name in robot.nominal if name.startswith(("f1.", "f2.", "left.", "hand."))]


@pytest.mark.parametrize("held", ["middle", "first", "last"])
def test_one_of_several_joints_in_a_body_can_be_locked(held, agrees):
    inside = """<body name="wrist" pos="0.3 0 0.1"><joint name="first" axis="1 0 0" ref="0.2"/>
      <joint name="middle" pos="0.1 0 0" axis="0 1 1" ref="-0.3"/>
      <joint name="last" type="slide" axis="1 0 1" pos="0 0.1 0" ref="0.1"/>
      <inertial mass="0.7" pos="0.01 0 0.03" diaginertia="0.02 0.01 0.015"/></body>"""
    left = [n for n in ("first", "middle", "last") if n != held]
    motors = "".join(f'<motor joint="{n}"/>' for n in ("shoulder", "elbow", *left))
    text = arm(inside=inside, actuator=f"<actuator>{motors}</actuator>")
    assert agrees(text, lock=[f"{held}=0.4"]).joints == ("shoulder", "elbow", *left)


def test_a_motor_of_a_closed_chain_can_be_locked_at_its_home(agrees):
    """The five-bar with a braked shoulder is a four-bar."""
    whole = Robot.load("five-bar")
    robot = agrees(whole.path.read_text(), spread=0.2, lock=["right_shoulder"])
    assert robot.joints == ("left_shoulder",)
    assert robot.passive == ("left_elbow", "right_elbow")
    home = whole.actuated_positions(whole.home[None])[0, 1]
    assert robot.locked == {"right_shoulder": pytest.approx(home)}


def test_a_locked_gripper_on_a_closed_chain_is_part_of_its_body(agrees, rejected):
    closure = CLOSURES["site on the root"]
    text = parallelogram(closure).replace(
        '<site name="toe"', '<body name="claw" pos="-0.3 0 0.1" euler="0 0.3 0.1"><joint name="jaw"'
        ' axis="0 1 0"/><inertial mass="0.4" pos="0.1 0 0" diaginertia="0.01 0.02 0.02"/></body>'
        '<site name="toe"').replace('0.7"/></keyframe>', '0.7 0.1"/></keyframe>')  # fmt: skip
    with rejected("jaw"):
        agrees(text, spread=0.3)
    robot = agrees(text, spread=0.3, lock=["jaw"])
    assert robot.locked == {"jaw": pytest.approx(0.1)}  # where home has it
    assert "claw" not in robot.bodies


def test_a_gripper_with_loops_of_its_own_is_locked_by_patterns_and_its_loops_with_it(
    load_text, rejected
):
    """A scene's gripper closes its own loops: locked whole, they say nothing."""
    loop = """<body name="claw{k}" pos="0.3 0 {z}"><joint name="grip_{k}" axis="0 1 0"/>
      <inertial mass="0.2" pos="0.05 0 0" diaginertia="0.001 0.001 0.001"/>
      <body name="pad{k}" pos="0.1 0 0"><joint name="pad_{k}" axis="0 1 0"/>
      <inertial mass="0.1" pos="0.02 0 0" diaginertia="1e-4 1e-4 1e-4"/></body></body>"""
    inside = "".join(loop.format(k=k, z=0.1 * k) for k in (0, 1))
    tie = '<equality><connect body1="pad0" body2="pad1" anchor="0 0 0.05"/></equality>'
    motors = '<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>'
    text = arm(inside=inside, actuator=f"{tie}{motors}")
    with rejected(r"such as a gripper: .*lock=\['grip_0', .*'pad_1'\]"):
        load_text(text)
    robot = load_text(text, lock=["grip_*", "pad_?"])
    assert robot.joints == ("shoulder", "elbow")
    assert not robot.loops
    assert {*robot.lock_option} == {"grip_0", "grip_1", "pad_0", "pad_1"}


FINGERS = """<robot name="r"><link name="ground"/><link name="arm"><inertial><mass value="2"/>
  <origin xyz="0.1 0.2 0.3"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>{links}
  <joint name="j1" type="revolute"><parent link="ground"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/><dynamics damping="0.3" friction="0.1"/>
  </joint>
  <joint name="f1" type="{kind}"><parent link="arm"/><child link="left"/>
    <origin xyz="{at}" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>{limit}</joint>
  <joint name="tip" type="fixed"><parent link="left"/><child link="pad"/><origin xyz="0 0 0.1"/>
  </joint>
  <joint name="f2" type="prismatic"><parent link="arm"/><child link="right"/>
    <origin xyz="0 0 0.4"/><axis xyz="0 0 1"/><mimic joint="f1" multiplier="-2" offset="0.01"/>
    <limit lower="-1" upper="1" effort="9" velocity="9"/></joint></robot>"""
LINK = """<link name="{0}"><inertial><origin xyz="0.01 0.02 0.05" rpy="0.1 0.2 0.3"/>
  <mass value="0.3"/><inertia ixx="0.001" iyy="0.0012" izz="0.0015" ixy="1e-5" ixz="-2e-5"
  iyz="5e-5"/></inertial></link>"""
LINKS = "".join(LINK.format(name) for name in ("left", "pad", "right"))


def fingers(kind="prismatic", links=LINKS):
    limit = '<limit lower="0" upper="1" effort="9" velocity="9"/>' if kind != "fixed" else ""
    return FINGERS.format(links=links, kind=kind, at="0 0.1 0.4", limit=limit)


def test_what_mimics_a_fixed_joint_stands_still(load_text):
    robot = load_text(fingers("fixed"), "urdf")
    assert robot.locked == {"f2": 0.01}
    assert not robot.closed
    assert load_text(fingers("fixed"), "urdf", lock=["f1"]).locked == robot.locked


def test_the_lock_of_a_sidecar_may_be_a_list_or_a_table_and_the_option_goes_first(load_text):
    rest = '\n[limits]\nf1 = {v = 1}\n[nominal]\n"f1.Fv" = 2.0'
    listed = load_text(fingers(), "urdf", 'locked = ["f1"]' + rest)
    assert listed.locked == {"f1": 0.0, "f2": 0.01}
    assert "f1.Fv" not in listed.nominal
    table = "[locked]\nf1 = 0.05"
    assert load_text(fingers(), "urdf", table).locked["f1"] == 0.05
    assert load_text(fingers(), "urdf", table, lock=["f1=0.02"]).locked["f1"] == 0.02
    assert load_text(fingers(), "urdf", "[home]\nf1 = 0.03", lock=["f1"]).locked["f1"] == 0.03


def test_couplings_of_a_sidecar_add_to_those_of_the_file(load_text):
    far = """<joint name="j2" type="revolute"><parent link="ground"/><child link="far"/>
      <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint></robot>"""
    text = fingers(links=LINKS + LINK.format("far")).replace("</robot>", far)
    coupling = 'actuated = ["j1", "f1"]\n[[couplings]]\njoint = "{0}"\nof = "{1}"\n'
    robot = load_text(text, "urdf", coupling.format("j2", "j1"))
    assert {c.joint: [*c.terms] for c in robot.couplings} == {"f2": ["f1"], "j2": ["j1"]}
    both = coupling.format("j2", "j1") + '[[couplings]]\njoint = "f2"\nof = "j1"\n'
    robot = load_text(text, "urdf", both)  # of one joint the sidecar's goes first
    assert {c.joint: [*c.terms] for c in robot.couplings} == {"f2": ["j1"], "j2": ["j1"]}


@pytest.mark.parametrize(
    "sidecar, lock, sentence",
    [
        ("", ["f9"], "names 'f9', which .* Known: j1, f1, f2"),
        ("", ["f1=high"], "'f1' cannot be locked at 'high'"),
        ("", ["f1=0.1", "f2=0.2"], "'f2' is locked at 0.2, .* puts it at -0.19; lock one of them"),
        ("", ["f2"], "'f2' cannot be locked, as it follows f1; lock that"),
        ("", ["j1", "f1"], "no joint that moves"),
        ('[nominal]\n"left.m" = 1.0', ["f1"], "names 'left', .* behind a locked joint"),
        ('locked = ["f1", "f1"]', None, "each one once"),
    ],
)
def test_what_cannot_be_locked_is_refused_with_the_remedy(
    sidecar, lock, sentence, load_text, rejected
):
    with rejected(sentence):
        load_text(fingers(), "urdf", sidecar, lock)


@pytest.mark.parametrize("form", ["mjcf", "urdf"])
@pytest.mark.parametrize("mass", [1.0, 0.2])
def test_a_locked_robot_is_written_and_read_back_with_its_locks(form, mass, load_text, tmp_path):
    """Bodies behind locked joints keep their numbers where those fit in; grippers still move."""
    text = gripper() if form == "mjcf" else fingers()
    robot = load_text(text, "xml" if form == "mjcf" else "urdf", lock=["f1=0.03"])
    host = robot.bodies[-1]
    theta = {f"{host}.{k}": mass * robot.nominal[f"{host}.{k}"] for k in INERTIAL_KINDS}
    out = tmp_path / f"copy{robot.path.suffix}"
    back = Robot.load(robot.with_values(theta).save(out))
    assert back.sidecar == out.with_suffix(".toml")
    assert back.locked == pytest.approx(robot.locked)
    for name, value in theta.items():
        assert back.nominal[name] == pytest.approx(value, abs=1e-9)
    share = {b: back.welded[b][0] / robot.welded[b][0] for b in robot.welded}
    assert all(part == pytest.approx(1.0) for part in share.values()) == (mass == 1.0)
    assert Path(out).read_text().count('"f1"') >= 2  # the joint, and what follows it


def test_a_robot_with_a_locked_gripper_moves_as_the_welded_one(load_text):
    joints = HAND.replace("<joint", "<!--").replace('springref="0.03"/>', "-->").replace(
        'ref="0.01"/>', "-->")  # fmt: skip
    rng = default_rng(2)
    q, dq = 0.3 * rng.normal(size=(2, 3, 2))
    tau = rng.normal(size=(3, 30, 2))
    other = load_text(arm(inside=joints))
    two = ForwardRobot(other, {}).run(q, dq, tau, 0.01)
    locked = load_text(gripper(), lock=["f1"])
    same_inertias(locked, other)
    one = ForwardRobot(locked, {}).run(q, dq, tau, 0.01)
    assert np.abs(one - q[:, None]).max() > 0.05
    assert_allclose(one, two, rtol=0, atol=1e-7)


def test_a_result_is_exported_under_the_locks_it_was_made_with(load_text, tmp_path, rejected):
    robot = load_text(fingers(), "urdf", lock=["f1=0.02"])
    path = random_trajectory(robot, default_rng(0))
    log = simulate(robot, PrescribedMotion.of(path, 600))
    result = analyze(robot, log, replicates=0)
    out = tmp_path / "fitted.urdf"
    with rejected(r"made with f1 = 0\.02, f2 = .*lock="):
        export(Robot.load(robot.path), result, out)
    export(robot, result, out)
    assert Robot.load(out).locked == pytest.approx(robot.locked)
