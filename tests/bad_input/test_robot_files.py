"""A robot file that cannot be read is refused with one sentence, by our checks, never by C++."""

import math
import re
import subprocess
import sys

import pytest

from identifiability.foundation.errors import RobotError
from identifiability.robot import Robot
from identifiability.robot.locate import locate_robot

TWO, FIVE, ARM = (locate_robot(n).read_text() for n in ("two-link", "five-bar", "six-dof-arm"))
BOMB = "".join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)

#: What is no robot file at all, and the sentence.
NO_ROBOT = {
    "truncated MJCF": (TWO[:800], r"no element found: line \d+"),
    "other root": ("<html><body/></html>", "root element is <html>, expected <mujoco> or <robot>"),
    "MJCF without joints": (
        '<mujoco><worldbody><body name="a"/></worldbody></mujoco>',
        "has no joint that moves; there is nothing to identify",
    ),
    "entity bomb": (
        f'<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa">{BOMB}]><mujoco model="&i;"/>',
        "declares a document type, <!DOCTYPE",
    ),
}


def equality(inside):
    return "</worldbody>", f"</worldbody><equality>{inside}</equality>"


#: What is replaced in the two-link arm, by what, and the sentence.
MJCF = {
    "a joint that swings freely": (
        ('<motor name="elbow_motor" joint="elbow"/>', ""),
        r"1 joints have no actuator \(elbow\) and .*; name .* What swings freely, "
        "as a pendulum does, is not served",
    ),
    "unknown motor": (('joint="elbow"', 'joint="elbw"'), "'elbw' for .*, did you mean 'elbow'"),
    "number in words": (
        ('mass="4"', 'mass="four"'),
        r"bad format in attribute 'mass' Element 'inertial', line 23\.",
    ),
    "tendon": (
        (
            "</worldbody>",
            '<site name="s1"/><site name="s2" pos="0.1 0 0"/></worldbody><tendon><spatial name="a">'
            '<site site="s1"/><site site="s2"/></spatial></tendon>'
            '<equality><tendon tendon1="a"/></equality>',
        ),
        "closes a loop with <tendon>; only <connect>, <weld> and <joint> equalities",
    ),
    "coupling of driven joints": (
        equality('<joint joint1="elbow" joint2="shoulder"/>'),
        "1 independent equations for 0 passive joints, .*remove an actuator or a closure",
    ),
    "inertia of no rotor": (
        ('armature="0.05"', 'armature="-0.2"'),
        "states shoulder.Ia = -0.2; .* are not negative",
    ),
    "friction of no robot": (
        ('damping="1.2"', 'damping="1e20"'),
        r"shoulder.Fv = 1e\+20 is no number of a robot",
    ),
    "include ring": (("<default>", '<include file="robot.xml"/><default>'), "in a ring; put them"),
}

MIMIC = '<limit lower="-2.97"'
#: The same for the six-axis arm.
URDF = {
    "two parents": (
        ('<child link="link_2"/>', '<child link="link_1"/>'),
        r"Two root links found: \[base_link\] and \[link_2\]",
    ),
    "joint type": (
        ('"joint_2" type="revolute"', '"joint_2" type="rotary"'),
        r"Joint \[joint_2\] has no known type \[rotary\]",
    ),
    "negative moment": (('iyy="0.333"', 'iyy="-99"'), r"states link_\d\.Iyy = -9\d"),
    "friction that drives": (('friction="32"', 'friction="-2"'), "min_dry_friction"),
    "mimics nothing": (
        (MIMIC, f'<mimic joint="joint_9"/>{MIMIC}'),
        "'joint_9', which is none of the others, did you",
    ),
}

MOTOR = '<motor name="right_motor" joint="right_shoulder"/>'
KEY = re.search("(?s)<keyframe>.*</keyframe>", FIVE).group(0)
#: The same for the five-bar.
CLOSED = {
    "too few actuators": (
        (MOTOR, ""),
        r"3 joints have no actuator \(left_elbow, right_shoulder, right_elbow\) and the loops give "
        "only 2 independent equations; name the missing",
    ),
    "too many actuators": (
        (MOTOR, MOTOR + '<motor joint="left_elbow"/>'),
        "2 independent equations for 1 passive joints, so not all 3 actuated joints are free",
    ),
    "home that does not close": (
        (KEY, '<keyframe><key name="home" qpos="3.1 0 0 0"/></keyframe>'),
        r"open by 1\.8 m at the home position .left_shoulder = 3\.1, .* give a position of every",
    ),
    "home at a singularity": (  # everything on one line
        (KEY, f'<keyframe><key name="home" qpos="{math.pi} {-math.pi} 0 {math.pi}"/></keyframe>'),
        "only 1 independent equations; .* a home position away from singularities",
    ),
}


def changed(text, old, new):
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize("case", NO_ROBOT)
def test_what_is_no_robot_file_is_refused(case, write, capfd):
    content, sentence = NO_ROBOT[case]
    with pytest.raises(RobotError, match=sentence):
        Robot.load(write("robot.xml", content))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("case", MJCF)
def test_a_bad_mjcf_is_refused(case, write):
    change, sentence = MJCF[case]
    with pytest.raises(RobotError, match=sentence):
        Robot.load(write("robot.xml", changed(TWO, *change)))


@pytest.mark.parametrize("case", URDF)
def test_a_bad_urdf_is_refused_and_the_parser_prints_nothing(case, write, capfd):
    change, sentence = URDF[case]
    with pytest.raises(RobotError, match=sentence):
        Robot.load(write("robot.urdf", changed(ARM, *change)))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("case", CLOSED)
def test_a_bad_closed_chain_is_refused(case, write):
    change, sentence = CLOSED[case]
    side = locate_robot("five-bar").with_suffix(".toml")
    with pytest.raises(RobotError, match=sentence):
        Robot.load(write("robot.xml", changed(FIVE, *change)), side)


def test_bodies_and_joints_without_names_are_given_some(write):
    text = TWO.replace(' name="link1"', "").replace(' name="link2"', "")
    robot = Robot.load(write("robot.xml", text))
    assert robot.bodies == ("body2", "body3")
    without = re.sub(r"<actuator>.*</actuator>", "", text, flags=re.DOTALL)
    robot = Robot.load(write("robot.xml", without.replace(' name="elbow"', "")))
    assert robot.joints == ("shoulder", "body3_1")


def test_a_missing_robot_file_is_refused_with_the_near_match(refused, write, arm):
    log = write("log.csv", arm)
    sentence = refused("analyze", "to-link", log)
    assert "no robot file 'to-link', did you mean 'two-link'?" in sentence
    assert "Give an MJCF or URDF file" in sentence
    assert "is a folder; give the robot file" in refused("analyze", log.parent, log)
    assert "cannot be a robot file: File name too long" in refused("analyze", "a" * 5000, log)


def test_a_real_process_ends_with_the_sentence_and_no_traceback(write, arm):
    """Once through the operating system: exit code, streams and what C++ parsers print."""
    robot = write("robot.urdf", ARM.replace('value="20"', 'value="many"'))
    words = [sys.executable, "-m", "identifiability", "simulate", robot, "random", "--out", "x.csv"]
    out = subprocess.run(words, check=False, capture_output=True, text=True, cwd=robot.parent)
    assert out.returncode == 2
    assert out.stdout == ""
    assert out.stderr.count("\n") == 1
    assert out.stderr.endswith("cannot be read as URDF: Inertial: mass [many] is not a float.\n")
    assert not (robot.parent / "x.csv").exists()


def test_includes_and_inactive_equalities_are_what_mujoco_makes_of_them(write):
    inner = re.search(r'(?s)<body name="link2".*?</body>', TWO).group(0)
    write("inner.xml", f"<mujocoinclude>{inner}</mujocoinclude>")
    off = '<weld body1="link2" active="false"/>'
    text = TWO.replace(*equality(off)).replace(inner, '<include file="inner.xml"/>')
    robot, whole = Robot.load(write("robot.xml", text)), Robot.load("two-link")
    assert robot.bodies == whole.bodies
    assert not robot.closed
    assert robot.nominal == whole.nominal


@pytest.mark.parametrize("second", ["", ' body2="world"'])
def test_a_closure_that_leaves_a_passive_joint_free_is_refused(second, write):
    """The elbow's axis is pinned to the world: the shoulder is held and the elbow turns."""
    pin = f'<connect body1="link2"{second} anchor="0 0 0"/>'
    text = changed(TWO, *equality(pin)).replace('<motor name="elbow_motor" joint="elbow"/>', "")
    with pytest.raises(
        RobotError, match="do not determine elbow at its home position shoulder = 0"
    ):
        Robot.load(write("robot.xml", text))


def test_the_hash_of_a_robot_knows_what_its_file_includes(write):
    inner = TWO[TWO.index("<actuator>") : TWO.index("</actuator>") + len("</actuator>")]
    write("inner.xml", '<mujocoinclude><include file="deep.xml"/></mujocoinclude>')
    write("deep.xml", f"<mujocoinclude>{inner}</mujocoinclude>")
    path = write("robot.xml", TWO.replace(inner, '<include file="inner.xml"/>'))
    hashes = [Robot.load(path).sha256, Robot.load(path).sha256]
    write("deep.xml", f"<mujocoinclude> {inner}</mujocoinclude>")
    hashes.append(Robot.load(path).sha256)
    write("robot.toml", "")
    hashes.append(Robot.load(path).sha256)
    write("robot.toml", 'name = "other"')
    hashes.append(Robot.load(path).sha256)
    first, again, deep, empty, sidecar = hashes
    assert first == again
    assert deep == empty  # a sidecar that says nothing changes nothing
    assert len({first, deep, sidecar}) == 3
