"""URDFs as people have them: what is not needed may be missing, what would be lost is refused."""

from importlib.metadata import PackageNotFoundError, distribution

import numpy as np
import pytest

from identifiability import IdentifiabilityError, Robot

LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="2"/>'

URDF = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<link name="ground"/>
<link name="arm"><inertial><mass value="2"/><origin xyz="0.1 0 0"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="package://somewhere/arm.stl"/></geometry></visual></link>
<joint name="elbow" type="revolute"><parent link="ground"/><child link="arm"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="2"/></joint>
</robot>"""


@pytest.fixture
def load(load_text):
    """A function (old text, new text, sidecar) -> the robot of the changed file."""

    def change(old="", new="", sidecar=None):
        assert old in URDF
        return load_text(URDF.replace(old, new, 1), "urdf", sidecar)

    return change


@pytest.mark.parametrize(
    "old, new",
    [
        (LIMIT, ""),
        (LIMIT, '<limit lower="-inf" upper="inf" effort="inf" velocity="2"/>'),
    ],
)
def test_a_joint_without_limits_is_free(load, old, new):
    assert np.isinf(load(old, new).limits).all()


@pytest.mark.parametrize(
    "old, new, left",
    [
        ('lower="-1"', 'lower="${-pi}"', "'${-pi}'"),
        ("</robot>", '<xacro:include filename="b.xacro"/></robot>', "<xacro:include>"),
    ],
)
def test_what_xacro_would_add_is_not_lost_without_a_word(load, old, new, left, rejected):
    with rejected("xacro file that was not expanded") as error:
        load(old, new)
    assert left in str(error.value)
    assert "run xacro robot.urdf > expanded.urdf and" in str(error.value)


def test_a_joint_may_follow_what_the_sidecar_says_where_the_file_names_none(load, rejected):
    hand = """<link name="tip"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="wrist" type="revolute"><parent link="arm"/><child link="tip"/><axis xyz="0 1 0"/>
<mimic joint="elbo"/></joint></robot>"""
    with rejected("'wrist' mimics 'elbo', but no other joint") as error:
        load("</robot>", hand)
    assert "did you mean 'elbow'?" in str(error.value)
    assert "[[couplings]]" in str(error.value)
    free = hand.replace('<mimic joint="elbo"/>', LIMIT)
    aside = free.replace('"arm"', '"ground"')
    assert load("</robot>", aside.replace("wrist", "aside")).joints == ("elbow", "aside")
    first = '<joint name="elbow"'  # a file may list a chain from its tip
    assert load(first, free.removesuffix("</robot>") + first).joints == ("elbow", "wrist")
    robot = load("</robot>", hand, '[[couplings]]\njoint = "wrist"\nof = "elbow"\n')
    assert robot.joints == ("elbow",)
    assert robot.passive == ("wrist",)
    assert load("</robot>", hand, 'locked = ["wrist"]\n').passive == ()


#: Public files that are refused, and what the sentence says.
REFUSED = {
    "alex_psyonic_hands.urdf": "mimics 'index_q1', but no other joint",
    "quadrotor_base.urdf": "has no joint that moves; there is nothing to identify",
    "ur3.urdf": "has no <link>; it may only define parts",
    "iris_simple.urdf": "has no joint that moves; there is nothing to identify",
    "tiago_dual.urdf": "has 101 degrees of freedom; robots of up to 100 are read: lock joints",
}


@pytest.fixture(scope="module")
def public():
    """The folder of public robot files."""
    try:
        found = distribution("example-robot-data")
    except PackageNotFoundError:
        pytest.skip("needs public robot files: pip install '.[robots]'")
    return found.locate_file("cmeel.prefix/share/example-robot-data/robots")


@pytest.mark.everything
def test_public_robots_load_or_it_is_said_why_not(public):
    said = {}
    loaded = 0
    asked = []
    for path in sorted(public.rglob("*.urdf")):
        try:
            loaded += len(Robot.load(path).joints) > 0
        except IdentifiabilityError as error:
            said[path.name] = str(error)
            if "so it may walk" in str(error):
                asked.append(said.pop(path.name))
                floats, stands = (Robot.load(path, base=base) for base in ("floating", "fixed"))
                assert floats.motor_joints == stands.joints
    assert loaded + len(asked) >= 60
    assert len(asked) >= 25
    assert said.keys() == REFUSED.keys()
    for name, sentence in REFUSED.items():
        assert sentence in said[name]
