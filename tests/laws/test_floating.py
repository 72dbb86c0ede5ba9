"""Laws of bases that nothing drives: another road, contacts that are eliminated, counts."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identifiability import Model, find_base_parameters
from identifiability.robot import complete_motion
from identifiability.robot.floating import BASE_JOINTS, base_acceleration

from ..roads import nominal_torque

RIGID = Model.of("rigid_body")


def limb(name, at, axes, mass=1.0):
    """A chain of bodies, one for each axis, with a foot at its end."""
    text = f'<geom name="{name}_foot" size=".03" pos="0 .01 -.2" mass="0"/>'
    for k, axis in reversed(list(enumerate(axes))):
        place = at if k == 0 else "0 .02 -.2"
        text = (
            f'<body name="{name}{k}" pos="{place}"><joint name="{name}_j{k}" axis="{axis}"/>'
            f'<inertial pos=".01 {0.01 * k} -.1" mass="{mass / (k + 1)}" '
            f'fullinertia=".01 .012 .004 .001 -.001 .0005"/>{text}</body>'
        )
    return text


def machine(limbs, base='<freejoint name="root"/>', objects=""):
    joints = [part.split('"')[0] for part in limbs.split('<joint name="')[1:]]
    drives = "".join(f'<motor joint="{j}"/>' for j in joints)
    return (
        '<mujoco><compiler angle="radian"/><default><joint armature=".02" damping=".1"/></default>'
        f'<worldbody>{objects}<body name="trunk" pos=".1 .2 .5" euler=".1 .2 .3">{base}'
        '<inertial pos=".02 .01 .03" mass="6" fullinertia=".1 .2 .15 .01 -.02 .005"/>'
        f'<site name="imu" pos=".05 0 .1"/>{limbs}</body></worldbody>'
        f"<actuator>{drives}</actuator></mujoco>"
    )


HIP, KNEE, YAW = "1 0 0", "0 1 0", "0 0 1"
QUADRUPED = "".join(
    limb(f"leg{k}", f"{x} {y} 0", (HIP, KNEE, KNEE))
    for k, (x, y) in enumerate([(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)])
)
ARMS = "".join(
    limb(f"arm{k}", f"0 {y} .4", (KNEE, HIP, KNEE), mass=0.8) for k, y in enumerate((0.2, -0.2))
)
HUMANOID = ARMS + "".join(
    limb(f"leg{k}", f"0 {y} -.1", (YAW, HIP, KNEE, KNEE, KNEE, HIP), mass=3.0)
    for k, y in enumerate((0.1, -0.1))
)
ARM = limb("arm", "0 0 .1", (YAW, KNEE, KNEE))
ROBOTS = {"quadruped": QUADRUPED, "humanoid": HUMANOID, "arm on a cart": ARM, "free body": ""}


def states(m, rng, count=25):
    """Random states of a free body and its joints: as MuJoCo has them, and as they are here."""
    n = m.nv - 6
    q = np.hstack([rng.normal(size=(count, 7)), rng.uniform(-1, 1, (count, n))])
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    v, a = rng.normal(size=(2, count, m.nv))
    turn = Rotation.from_quat(q[:, [4, 5, 6, 3]]).inv()
    acc = turn.apply(a[:, :3] - m.opt.gravity)
    none = np.zeros((count, 6))
    ours = (
        np.hstack([none, q[:, 7:]]),
        np.hstack([none[:, :3], v[:, 3:]]),
        np.hstack([base_acceleration(acc, v[:, 3:6], a[:, 3:6]), a[:, 6:]]),
    )
    return (q, v, a), ours, turn


def bare(text):
    m = mujoco.MjModel.from_xml_string(text)
    m.dof_damping[:] = m.dof_armature[:] = 0.0
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return m


@pytest.mark.parametrize("name", ROBOTS)
def test_the_regressor_is_inverse_dynamics_of_mujoco(name, load_text):
    text = machine(ROBOTS[name])
    robot = load_text(text)
    m = bare(text)
    data = mujoco.MjData(m)
    (q, v, a), ours, turn = states(m, default_rng(1))
    found = nominal_torque(robot, complete_motion(robot, np.arange(25.0), *ours), RIGID.names)
    other = np.empty_like(found)
    for k in range(25):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(m, data)
        other[k] = data.qfrc_inverse
    other[:, :3] = turn.apply(other[:, :3])  # along the axes of the base
    size = np.abs(other).max()
    assert_allclose(found, other, atol=1e-12 * size)


def test_of_a_body_that_floats_ten_parameters_are_seen_and_of_trees_the_known_groupings(load_text):
    counts = {"free body": 10, "arm on a cart": 10 + 3 * 7, "quadruped": 94, "humanoid": 136}
    for name, count in counts.items():
        robot = load_text(machine(ROBOTS[name]))
        base = find_base_parameters(robot, RIGID)
        assert len(base) == count == 10 + 7 * len(robot.motor_joints)
        assert {f"trunk.{k}" for k in ("m", "mx", "Ixy")} <= {p.name for p in base.parameters}


CONTACTS = {
    "one foot": ("quadruped", "[[contacts]]\nframe = 'leg0_foot'\n"),
    "trot": ("quadruped", "".join(f"[[contacts]]\nframe = 'leg{k}_foot'\n" for k in (0, 3))),
    "four feet": ("quadruped", "".join(f"[[contacts]]\nframe = 'leg{k}_foot'\n" for k in range(4))),
    "a sole": ("humanoid", "[[contacts]]\nframe = 'leg0_foot'\nkind = 'surface'\n"),
    "a hand of three joints": ("humanoid", "[[contacts]]\nframe = 'arm0_foot'\nkind = 'surface'\n"),
    "a cart": ("arm on a cart", "[[contacts]]\nframe = 'trunk'\nkind = 'surface'\n"),
    "a heel of six joints": ("humanoid", "[[contacts]]\nframe = 'leg1_foot'\n"),
}
#: Rows that are left, as ranks of the projected equations.
LEFT = {"one foot": 15, "trot": 12, "four feet": 6, "a sole": 12 + 6, "a cart": 3,
        "a hand of three joints": 18, "a heel of six joints": 21}  # fmt: skip


@pytest.mark.parametrize("case", CONTACTS)
def test_no_force_at_a_contact_enters_the_projected_rows_and_no_other_row_is_lost(case, load_text):
    name, extra = CONTACTS[case]
    text = machine(ROBOTS[name])
    robot = load_text(text, sidecar=extra)
    m = bare(text)
    data = mujoco.MjData(m)
    rng = default_rng(2)
    (q, v, _), ours, turn = states(m, rng)
    contacts = robot.base.contacts
    touch = np.hstack([turn.apply([0, 0, 1.0]), np.ones((25, len(contacts)))])
    motion = complete_motion(robot, np.arange(25.0), *ours, touch=touch)
    for k in range(25):
        data.qpos[:], data.qvel[:] = q[k], v[k]
        mujoco.mj_forward(m, data)
        pushed = np.zeros(m.nv)
        for c in contacts:
            force, moment = rng.normal(size=(2, 3)) * 100
            body = c.name if c.name == "trunk" else m.body(m.geom(c.name).bodyid[0]).name
            at = data.xpos[m.body(body).id]
            if c.name != "trunk":
                at = data.geom_xpos[m.geom(c.name).id] - [0, 0, c.radius]
            moment = moment * (c.kind == "surface")
            mujoco.mj_applyFT(m, data, force, moment, at, m.body(body).id, pushed)
        pushed[:3] = turn[k].apply(pushed[:3])
        free = motion.free[k]
        assert np.abs(free.T @ pushed).max() < 1e-9 * np.abs(pushed).max()
        assert np.linalg.matrix_rank(free, tol=1e-6) == LEFT[case]
    lost = np.abs(motion.free).sum(1) == 0
    assert (motion.silent | ~lost).all()
    model = Model.of("rigid_body")  # of which columns are projected as its torque is
    W = model.regressor(robot, replace(motion, free=None))
    assert_allclose(model.regressor(robot, motion), motion.freed(W), atol=1e-9)


def test_rows_change_as_little_as_the_motion_does(load_text):
    robot = load_text(machine(HUMANOID), sidecar=CONTACTS["a heel of six joints"][1])
    s = np.linspace(0, 1, 400)[:, None]
    q = np.hstack([np.zeros((400, 6)), np.sin(2 * s + default_rng(3).uniform(0, 6, 18))])
    free = complete_motion(robot, s[:, 0], q, 0 * q, 0 * q).free
    assert np.abs(np.diff(free, axis=0)).max() < 0.05


def test_what_a_sidecar_says_of_contacts_is_checked(load_text, rejected):
    text = machine(QUADRUPED)
    with rejected(r"names 'leg0_fot', .* did you mean 'leg0_foot'"):
        load_text(text, sidecar="[[contacts]]\nframe = 'leg0_fot'")
    with rejected("no free joint, and its sidecar"):
        load_text(machine(QUADRUPED, base=""), sidecar='base = "floating"')
    fixed = load_text(text, sidecar='base = "fixed"\n[[contacts]]\nframe = "leg0_foot"')
    assert len(fixed.joints) == 12
    assert fixed.base is None


def test_what_floats_beside_a_robot_is_left_out_and_two_robots_are_refused(load_text, rejected):
    ball = '<body name="ball"><freejoint/><geom size=".1" mass="1"/></body>'
    robot = load_text(machine(ARM, objects=ball))
    assert robot.outside == ("ball",)
    assert robot.joints == (*BASE_JOINTS, "arm_j0", "arm_j1", "arm_j2")
    other = (
        '<body name="drone"><freejoint/><geom size=".1" mass="1"/><body name="vane">'
        '<joint name="flap"/><geom size=".1" mass="1"/></body></body>'
    )
    text = machine(ARM, objects=other).replace("</actuator>", '<motor joint="flap"/></actuator>')
    with rejected("drone, trunk float"):
        load_text(text)
