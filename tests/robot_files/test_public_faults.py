"""Faults of public robot files: parts without use refuse nothing, wrong numbers are reported."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot, inspect, simulate
from identifiability.foundation.findings import of_key
from identifiability.robot.locate import locate_robot
from identifiability.simulation import PrescribedMotion, random_trajectory

ARM = locate_robot("six-dof-arm").read_text()
LINK = '<link name="link_3">'


@pytest.fixture
def load(load_text):
    """A function (text, sidecar) -> the robot of a URDF."""
    return lambda text, sidecar="": load_text(text, "urdf", sidecar)


def simulated(robot):
    """Torque along a motion, which MuJoCo finds from the same file."""
    path = random_trajectory(robot, np.random.default_rng(0), samples=50)
    return simulate(robot, PrescribedMotion.of(path, 50)).tau


def needs(robot):
    """What `inspect` says that the file of a robot leaves open."""
    return " ".join(need.text for need in inspect(robot).needs)


#: What stands in a link, or before the root, and is of no use to identification.
LOOKS = {
    "capsule": '<collision><geometry><capsule radius="1" length="1"/></geometry></collision>',
    "two shapes": "<visual><geometry><box size='1 1 1'/><sphere radius='1'/></geometry></visual>",
    "no shape": '<visual><material name="x"/></visual>',
    "no number": '<visual><origin xyz="here"/><geometry><box size="1 1 1"/></geometry></visual>',
    "commas": '<collision><origin xyz="0, 0, 0"/><geometry><box size="1"/></geometry></collision>',
    "four angles": '<visual><origin rpy="0 0 0 0"/><geometry><mesh/></geometry></visual>',
    "mesh that is not there": '<visual><geometry><mesh filename="a.stl"/></geometry></visual>',
    "mesh without a name": "<collision><geometry><mesh/></geometry></collision>",
    "material that nobody defines": '<visual><geometry><sphere radius="a"/></geometry>'
    '<material name="?"><color rgba="1 1"/></material></visual>',
}


@pytest.mark.parametrize("what", LOOKS)
def test_looks_of_a_link_never_refuse_a_file(what, load):
    plain = load(ARM)
    torque = simulated(plain)
    robot = load(ARM.replace(LINK, LINK + LOOKS[what]))
    assert dict(robot.nominal) == dict(plain.nominal)
    assert_allclose(simulated(robot), torque)


@pytest.mark.parametrize("color", ["1 1 1 1", "white", ""])
def test_a_material_may_be_defined_twice(color, load):
    material = f'<material name="a"><color rgba="{color}"/></material>'
    assert load(ARM.replace(LINK, 2 * material + LINK)).joints


@pytest.mark.parametrize("before", ["\n", "  \r\n\n", "<!-- a -->\n", "\n<!-- <?xml -->\n<!--b-->"])
@pytest.mark.parametrize("name", ["six-dof-arm", "two-link"])
def test_blanks_and_comments_may_stand_before_the_declaration(before, name, tmp_path):
    source = locate_robot(name)
    text = re.sub(r"\A\s*<\?xml[^>]*\?>", "", source.read_text())
    path = tmp_path / f"robot{source.suffix}"
    path.write_text(f'{before}<?xml version="1.0" encoding="utf-8"?>\n{text}')
    robot = Robot.load(path)
    assert dict(robot.nominal) == dict(Robot.load(name).nominal)
    assert np.isfinite(simulated(robot)).all()
    saved = robot.save(tmp_path / f"again{source.suffix}")
    assert Robot.load(saved).joints == robot.joints
    assert saved.read_text().startswith("<?xml")


def on_world(text):
    """Return a URDF whose root link is fixed to a link called world, off its origin."""
    fixed = '<joint name="bolts" type="fixed"><origin xyz="0 1 2" rpy="0.3 0 0"/>'
    ends = '<parent link="world"/><child link="base_link"/></joint>'
    return text.replace("<link", f'<link name="world"/>{fixed}{ends}<link', 1)


def test_a_root_link_called_world_is_the_world(load):
    robot = load(on_world(ARM))
    assert robot.bodies == Robot.load("six-dof-arm").bodies
    assert robot.base is None
    floats = load(on_world(ARM), 'base = "floating"')
    assert floats.base is not None
    assert floats.bodies[0] == "base_link"


def test_fixed_joints_are_merged_before_bodies_count(load, rejected):
    def frames(count, kind):
        return "".join(
            f'<link name="f{k}"/><joint name="g{k}" type="{kind}"><parent link="link_6"/>'
            f'<child link="f{k}"/><axis xyz="0 0 1"/></joint>'
            for k in range(count)
        )

    assert len(load(ARM.replace("</robot>", frames(400, "fixed") + "</robot>")).bodies) == 6
    with rejected("has 206 bodies that move, with fixed joints merged; "):
        load(ARM.replace("</robot>", frames(200, "continuous") + "</robot>"))


def test_fixed_bodies_of_an_mjcf_are_merged_before_they_count(load_text, two_link):
    text = two_link.path.read_text()
    robot = load_text(text.replace("</worldbody>", "<body/>" * 400 + "</worldbody>"))
    assert robot.bodies == two_link.bodies


def test_an_actuator_with_several_controls_is_read(load_text, two_link):
    text = two_link.path.read_text()
    motor = '<motor name="shoulder_motor" joint="shoulder"/>'
    assert motor in text
    several = '<dcmotor name="d" joint="shoulder" input="pos vel" motorconst="1" resistance="1"/>'
    servo = '<position joint="elbow" kp="7" ctrlrange="-2 2"/>'
    robot = load_text(text.replace(motor, several + servo))
    assert robot.joints == ("shoulder", "elbow")
    assert robot.servo is None  # the shoulder's motor is none


# Bodies that cannot exist, or are implausible.


def with_inertia(text, **moments):
    """Return a URDF whose links have other moments, six numbers by link."""
    for link, numbers in moments.items():
        start = text.index(f'<link name="{link}">')
        words = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), numbers, strict=True)
        inertia = " ".join(f'{word}="{x}"' for word, x in words)
        changed = re.sub(r"<inertia [^>]*>", f"<inertia {inertia}/>", text[start:], count=1)
        text = text[:start] + changed
    return text


NEGATIVE, TRIANGLE = (-0.5, 0.25, 0.125, 0, 0, 0), (0.5, 0.125, 0.125, 0, 0, 0)


def test_all_bodies_that_cannot_exist_are_listed_with_the_numbers_of_the_file(load, rejected):
    text = with_inertia(ARM, link_2=NEGATIVE, link_4=TRIANGLE, link_5=(9, -9, 9, 0, 0, 0))
    with rejected("states 3 bodies that cannot exist: link_2 ") as error:
        load(text)
    said = str(error.value)
    assert "ixx = -0.5, iyy = 0.25, izz = 0.125 kg·m²: a principal moment is negative" in said
    assert "link_4 (" in said
    assert "ixx = 9, iyy = -9, izz = 9" in said


def test_bodies_that_break_the_triangle_inequality_are_all_reported(load):
    text = needs(load(with_inertia(ARM, link_2=TRIANGLE, link_4=TRIANGLE)))
    assert "states 2 bodies that cannot exist: link_2 (" in text
    assert "link_4 (" in text
    assert "ixx = 0.5, iyy = 0.125, izz = 0.125 kg·m²: one principal moment is more than" in text


def test_impossible_bodies_of_an_mjcf_are_all_listed(load_text, two_link, rejected):
    text = two_link.path.read_text()
    with rejected("states 2 bodies that cannot exist: link1 ") as error:
        load_text(re.sub(r'(full|diag)inertia="[^"]*"', 'diaginertia="5 1 1"', text))
    assert str(error.value).count("M11 = 5, M22 = 1, M33 = 1") == 2


@pytest.mark.parametrize("mass", ["1e-15", "1e-13", "5e-324"])
def test_a_mass_that_no_arithmetic_holds_is_refused(mass, load, rejected):
    start = ARM.index(LINK)
    after = re.sub(r'<mass value="[^"]*"', f'<mass value="{mass}"', ARM[start:], count=1)
    with rejected(r"link_3\.m = .* is below 1e-12 kg, the least mass"):
        load(ARM[:start] + after)


def test_inertia_that_is_too_small_or_large_for_the_mass_is_reported(load):
    small = (1e-18, 1e-18, 1e-18, 0, 0, 0)
    large = (900, 900, 900, 0, 0, 0)
    found = of_key((n.text for n in inspect(load(with_inertia(ARM, link_3=small))).needs), "dense")
    assert "link_3 (" in found[0]
    assert "ixx = 1e-18, iyy = 1e-18, izz = 1e-18 kg·m²" in found[0]
    found = of_key((n.text for n in inspect(load(with_inertia(ARM, link_3=large))).needs), "wide")
    assert "ixx = 900" in found[0]


def in_millimetres(text):
    """Return a URDF with lengths in mm and inertias in kg·mm²."""

    def scaled(match):
        times = 1e3 if match[1] == "xyz" else 1e6
        return f'{match[1]}="{" ".join(repr(times * float(x)) for x in match[2].split())}"'

    text = re.sub(r'(xyz)="([^"]*)"', scaled, text)
    return re.sub(r'(i[xyz]{2})="([^"]*)"', scaled, text)


def test_a_file_in_millimetres_is_reported(load):
    result = inspect(load(in_millimetres(ARM)))
    (found,) = of_key((n.text for n in result.needs), "millimetres")
    assert "its lengths seem to be millimetres" in found
    shorts = [a.short for a in result.answers()]
    assert any("check the first before you begin" in short for short in shorts)
    assert not any("none is needed" in short for short in shorts)
    assert not of_key(n.text for n in inspect("six-dof-arm").needs)


@pytest.mark.parametrize(
    "name", ["six-dof-arm", "3-rps", "delta", "dvrk-psm", "quadruped", "six-ups", "scara"]
)
def test_shipped_robots_are_plausible(name):
    assert not of_key(need.text for need in inspect(name).needs)


# Legs.


def legged(waist):
    """Return a URDF with two legs, on the root or below a waist."""
    inertial = (
        '<inertial><mass value="2"/>'
        '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    names = ["torso", "pelvis"] * waist + ["torso"] * (not waist)
    names += ["left_thigh", "left_calf", "right_thigh", "right_calf"]
    above = {"pelvis": "torso", "left_calf": "left_thigh", "right_calf": "right_thigh"}
    links = "".join(f'<link name="{name}">{inertial}</link>' for name in dict.fromkeys(names))
    joints = "".join(
        f'<joint name="to_{name}" type="continuous">'
        f'<parent link="{above.get(name, "pelvis" if waist else "torso")}"/>'
        f'<child link="{name}"/><origin xyz="0 0 -.3"/><axis xyz="0 1 0"/></joint>'
        for name in dict.fromkeys(names)
        if name != "torso"
    )
    return f'<robot name="walker">{links}{joints}</robot>'


def test_legs_below_a_waist_are_reported_until_somebody_says_what_holds_the_base(load, rejected):
    (found,) = of_key((n.text for n in inspect(load(legged(waist=True))).needs), "legs")
    assert "left_thigh, right_thigh seem to be legs" in found
    assert "calf" not in found
    for base in ("fixed", "floating"):
        robot = load(legged(waist=True), f'base = "{base}"')
        assert not of_key((n.text for n in inspect(robot).needs), "legs")
    with rejected("carries the legs left_thigh, right_thigh, so it may"):
        load(legged(waist=False))
