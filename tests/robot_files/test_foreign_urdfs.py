"""URDFs as people have them: what is not needed may be missing, what would be lost is refused."""

import re
from importlib.metadata import PackageNotFoundError, distribution

import numpy as np
import pinocchio as pin
import pytest

from identifiability.foundation.errors import RobotError
from identifiability.regression.regression import Model
from identifiability.regression.structure import find_base_parameters
from identifiability.robot import Robot, complete_motion
from identifiability.robot.floating import base_acceleration

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
def load(tmp_path):
    """A function (old text, new text, sidecar) -> the robot of the changed file."""

    def change(old="", new="", sidecar=""):
        path = tmp_path / "arm.urdf"
        assert old in URDF
        path.write_text(URDF.replace(old, new, 1))
        if sidecar:
            path.with_suffix(".toml").write_text(sidecar)
        return Robot.load(path)

    return change


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (LIMIT, ""),
        (LIMIT, '<limit lower="-inf" upper="inf" effort="inf" velocity="2"/>'),
        ("revolute", "continuous"),
    ],
)
def test_a_joint_without_limits_is_free(load, old, new):
    assert np.isinf(load(old, new).limits).all()


def test_limits_without_effort_and_speed_are_limits(load):
    assert load(' effort="5" velocity="2"', "").limits.tolist() == [[-1.0, 1.0]]


def test_a_robot_without_a_name_is_called_by_its_file(load):
    assert load(' name="r"', "").title == "arm"


@pytest.mark.parametrize(
    ("old", "new", "left"),
    [
        ('lower="-1"', 'lower="${-pi}"', "'${-pi}'"),
        ("</robot>", '<xacro:include filename="b.xacro"/></robot>', "<xacro:include>"),
        ("</robot>", '<xacro:gripper parent="arm"/></robot>', "<xacro:gripper>"),
    ],
)
def test_what_xacro_would_add_is_not_lost_without_a_word(load, old, new, left):
    with pytest.raises(RobotError, match="xacro file that was not expanded") as error:
        load(old, new)
    assert left in str(error.value)
    assert "run 'xacro arm.urdf > robot.urdf'" in str(error.value)


def test_leftovers_that_stand_for_nothing_are_passed_over(load):
    assert load("</robot>", '<xacro:property name="m" value="2"/></robot>').joints == ("elbow",)


def test_a_joint_may_follow_what_the_sidecar_says_where_the_file_names_none(load):
    hand = """<link name="tip"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="wrist" type="revolute"><parent link="arm"/><child link="tip"/><axis xyz="0 1 0"/>
<mimic joint="elbo"/></joint></robot>"""
    with pytest.raises(RobotError, match="'wrist' mimics 'elbo', which is none") as error:
        load("</robot>", hand)
    assert "did you mean 'elbow'?" in str(error.value)
    assert "[[couplings]]" in str(error.value)
    robot = load("</robot>", hand, '[[couplings]]\njoint = "wrist"\nof = "elbow"\n')
    assert robot.joints == ("elbow",)
    assert robot.passive == ("wrist",)
    assert load("</robot>", hand, 'locked = ["wrist"]\n').passive == ()


def test_a_body_that_floats_alone_has_six_joints_and_no_motor(load):
    robot = load("revolute", "floating")
    assert len(robot.joints) == 6
    assert robot.motor_joints == ()


#: Public files that are refused, and what the sentence says.
REFUSED = {
    "alex_psyonic_hands.urdf": "mimics 'index_q1', which is none",
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
    said, loaded, asked = {}, 0, []
    for path in sorted(public.rglob("*.urdf")):
        try:
            loaded += len(Robot.load(path).joints) > 0
        except RobotError as error:
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


@pytest.mark.everything
@pytest.mark.parametrize(
    ("name", "joints"),
    [("talos_reduced.urdf", 32), ("g1_29dof_rev_1_0.urdf", 29), ("icub_reduced.urdf", 29),
     ("simple_humanoid.urdf", 29), ("solo12.urdf", 12)],
)  # fmt: skip
def test_public_humanoids_float_as_pinocchio_has_them(public, name, joints):
    (path,) = public.rglob(name)
    robot = Robot.load(path, base="floating")
    assert len(robot.motor_joints) == joints
    flying = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    data, rng, rigid = flying.createData(), np.random.default_rng(1), Model.of("rigid_body")
    order = [flying.joints[flying.getJointId(j)].idx_v for j in robot.motor_joints]
    q, v, a = rng.uniform(-0.5, 0.5, (3, 20, robot.nv))
    q[:, :6] = v[:, :3] = 0.0
    motion = complete_motion(robot, np.arange(20.0), q, v, a)
    known = np.array([robot.nominal[p.name] for p in rigid.parameters(robot)])
    found = rigid.regressor(robot, motion) @ known
    turning = a[:, 3:6] - base_acceleration(0 * a[:, :3], v[:, 3:6], 0 * a[:, :3])[:, 3:]
    for k in range(20):  # proper acceleration: gravity is part of it
        pose, speed, faster = pin.neutral(flying), np.zeros(flying.nv), np.zeros(flying.nv)
        speed[order], faster[order] = v[k, 6:], a[k, 6:]
        speed[3:6], faster[:3], faster[3:6] = (
            v[k, 3:6],
            a[k, :3] + flying.gravity.linear,
            turning[k],
        )
        pose[[flying.joints[flying.getJointId(j)].idx_q for j in robot.motor_joints]] = q[k, 6:]
        tau = pin.rnea(flying, data, pose, speed, faster)
        np.testing.assert_allclose(
            found[k], tau[[*range(6), *order]], atol=1e-9 * np.abs(tau).max()
        )
    assert len(find_base_parameters(robot, rigid)) == 10 + 7 * joints


def legged(root="trunk", words=("hip", "knee"), sides=("l", "r"), weight=True):
    """A robot of which a leg hangs on each side of its root link."""
    body = (
        '<inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" '
        'iyz="0"/></inertial>'
    )
    parts = [f'<link name="{root}">{body * weight}</link>']
    for side in sides:
        above = root
        for word in words:
            parts.append(
                f'<link name="{side}_{word}_link">{body}</link><joint name="{side}_{word}" '
                f'type="revolute"><parent link="{above}"/><child link="{side}_{word}_link"/>'
                f'<axis xyz="0 1 0"/>{LIMIT}</joint>'
            )
            above = f"{side}_{word}_link"
    return f'<robot name="r">{"".join(parts)}</robot>'


def test_a_robot_on_legs_whose_root_hangs_on_nothing_is_asked_about(tmp_path):
    path = tmp_path / "dog.urdf"
    for words in (("hip", "knee"), ("HAA", "HFE", "KFE"), ("thigh_pitch", "calf")):
        path.write_text(legged(words=words))
        with pytest.raises(
            RobotError, match=r'its root link \'trunk\'.* write base = "fixed" into'
        ):
            Robot.load(path)
    # Either end of a joint may stand first, and twice.
    turned = re.sub(r"(<parent[^>]*>)(<child[^>]*>)", r"\2\1", legged())
    for text in (turned, re.sub(r"(<parent[^>]*>)", r"\1\1", legged())):
        path.write_text(text)
        with pytest.raises(RobotError, match=r"its root link 'trunk'"):
            Robot.load(path)
    path.write_text(legged(words=("thigh_pitch", "calf")))
    path.with_suffix(".toml").write_text('base = "fixed"')
    assert Robot.load(path).joints[0] == "l_thigh_pitch"


@pytest.mark.parametrize(
    "how",
    [
        {"root": "world"},
        {"weight": False},
        {"sides": ("l",)},
        {"words": ("shoulder", "elbow")},
        {"words": ("finger_a", "tip"), "sides": "1234"},
        {"words": ("chip", "allegro")},
    ],
)
def test_what_stands_on_the_ground_or_has_no_legs_is_not(how, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(legged(**how))
    assert Robot.load(path).passive == ()
