"""A robot file that cannot be read is refused with one sentence, by our checks, never by C++."""

import math
import re
import sys
import xml.etree.ElementTree as ET

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from identifiability import IdentifiabilityError, Robot
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

KEY = re.search("(?s)<keyframe>.*</keyframe>", FIVE).group(0)


def equality(inside):
    return "</worldbody>", f"</worldbody><equality>{inside}</equality>"


#: What is replaced in a shipped robot, by what, and the sentence.
MEANT = {
    "a joint that swings freely": (
        "two-link",
        ('<motor name="elbow_motor" joint="elbow"/>', ""),
        r"1 joints have no actuator \(elbow\) and .*; name .* A joint without a "
        "motor must be locked or follow others",
    ),
    "coupling of driven joints": (
        "two-link",
        equality('<joint joint1="elbow" joint2="shoulder"/>'),
        "1 independent equations for 0 passive joints, .*remove an actuator or a closure",
    ),
    "include ring": (
        "two-link",
        ("<default>", '<include file="robot.xml"/><default>'),
        "in a ring; put them",
    ),
    "two parents": (
        "six-dof-arm",
        ('<child link="link_2"/>', '<child link="link_1"/>'),
        r"Two root links found: \[base_link\] and \[link_2\]",
    ),
    "home that does not close": (
        "five-bar",
        (KEY, '<keyframe><key name="home" qpos="3.1 0 0 0"/></keyframe>'),
        r"open by 1\.8 m at the home position .left_shoulder = 3\.1, .* give a position of every",
    ),
    "keyframe that is no number": (
        "five-bar",
        (KEY, '<keyframe><key name="home" qpos="nan 0 0 0"/></keyframe>'),
        "or a home position is infinite or implausibly large",
    ),
    "site that is no number": (
        "five-bar",
        ('pos="0.45 0 0"', 'pos="nan 0 0"'),
        "cannot be read by MuJoCo|gravity, the place of a joint or site, .* is infinite",
    ),
    "home at a singularity": (
        "five-bar",
        (KEY, f'<keyframe><key name="home" qpos="{math.pi} {-math.pi} 0 {math.pi}"/></keyframe>'),
        "only 1 independent equations; .* a home position away from singularities",
    ),
}

#: Attributes of which no value may be negative, and those that name a part of the file.
POSITIVE = {"inertial@mass", "joint@armature", "joint@damping", "joint@frictionloss", "mass@value"}
POSITIVE |= {"dynamics@damping", "dynamics@friction", "limit@effort", "limit@velocity"}
NAMING = {"connect@site1", "connect@site2", "motor@joint", "parent@link", "child@link"}


def attributes(*, names):
    """Every (robot, place, attribute) of the three files whose value is a name, or a number."""
    for robot in ("two-link", "five-bar", "six-dof-arm"):
        tree = ET.parse(locate_robot(robot))
        looks = {
            part for tag in ("visual", "collision") for x in tree.iter(tag) for part in x.iter()
        }
        for at, element in enumerate(tree.iter()):
            for key, value in element.items() if element not in looks else ():
                kind = f"{element.tag}@{key}"
                number = kind in POSITIVE or element.tag in (
                    "inertia",
                    "inertial",
                    "axis",
                    "origin",
                )
                if kind in NAMING if names else number:
                    yield robot, at, key, value


def spoilt(robot, at, key, value, folder):
    """The sentence with which a shipped robot is refused, one of its attributes being another."""
    path = locate_robot(robot)
    tree = ET.parse(path)
    list(tree.iter())[at].set(key, value)
    tree.write(folder / f"robot{path.suffix}")
    with pytest.raises(IdentifiabilityError) as refused:
        Robot.load(
            folder / f"robot{path.suffix}",
            side if (side := path.with_suffix(".toml")).exists() else None,
        )
    return str(refused.value)


ANYWHERE = settings(max_examples=12, deadline=None, derandomize=True, database=None,
                    suppress_health_check=[HealthCheck.function_scoped_fixture])  # fmt: skip


@ANYWHERE
@given(st.sampled_from([*attributes(names=False)]), st.sampled_from(["four", "1e999", "-1"]))
def test_a_value_that_is_no_number_of_a_robot_is_refused_wherever_it_stands(tmp_path, place, value):
    robot, at, key, old = place
    tag = list(ET.parse(locate_robot(robot)).iter())[at].tag
    assume(value != "-1" or (f"{tag}@{key}" in POSITIVE and float(old) > 0))
    assert len(spoilt(robot, at, key, value, tmp_path)) < 900


@ANYWHERE
@given(st.sampled_from([*attributes(names=True)]), st.integers(1, 3))
def test_a_name_that_stands_nowhere_is_refused_and_named_wherever_it_stands(tmp_path, place, lost):
    robot, at, key, name = place
    said = spoilt(robot, at, key, name[:-lost], tmp_path)
    assert name[:-lost] in said
    assert f"did you mean '{name}'" in said or robot == "six-dof-arm"


def changed(text, old, new):
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize("case", NO_ROBOT)
def test_what_is_no_robot_file_is_refused(case, write, capfd, rejected):
    content, sentence = NO_ROBOT[case]
    with rejected(sentence):
        Robot.load(write("robot.xml", content))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("case", MEANT)
def test_what_cannot_be_meant_is_refused_with_the_remedy(case, write, capfd, rejected):
    robot, change, sentence = MEANT[case]
    path = locate_robot(robot)
    side = path.with_suffix(".toml")
    written = write(f"robot{path.suffix}", changed(path.read_text(), *change))
    with rejected(sentence):
        Robot.load(written, side if side.exists() else None)
    assert capfd.readouterr() == ("", "")


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


def test_a_real_process_ends_with_the_sentence_and_no_traceback(write, process):
    """Once through the operating system: exit code, streams and what C++ parsers print."""
    robot = write("robot.urdf", ARM.replace('value="20"', 'value="many"'))
    words = [sys.executable, "-m", "identifiability", "simulate", robot, "random", "--out", "x.csv"]
    out = process(words, cwd=robot.parent)
    assert out.returncode == 2
    assert out.stdout == ""
    assert out.stderr.count("\n") == 1
    assert out.stderr.endswith("cannot be read as URDF: Inertial: mass [many] is not a float.\n")
    assert not (robot.parent / "x.csv").exists()


@pytest.mark.parametrize("second", ["", ' body2="world"'])
def test_a_closure_that_leaves_a_passive_joint_free_is_refused(second, write, rejected):
    """The elbow's axis is pinned to the world: the shoulder is held and the elbow turns."""
    pin = f'<connect body1="link2"{second} anchor="0 0 0"/>'
    text = changed(TWO, *equality(pin)).replace('<motor name="elbow_motor" joint="elbow"/>', "")
    with rejected("do not determine elbow at its home position shoulder = 0"):
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
