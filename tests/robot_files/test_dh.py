"""Robots from tables of Denavit and Hartenberg: against products of elementary matrices."""

import tomllib

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from typer.testing import CliRunner

from identifiability import Model, Robot, find_base_parameters
from identifiability.cli import app
from identifiability.effects.nominal import has_masses
from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import OutputError, RobotError
from identifiability.physical.cad_prior import state_mass, state_masses
from identifiability.robot import complete_motion
from identifiability.robot.dh import convert_dh

PI = np.pi


def turn(axis, angle):
    T = np.eye(4)
    T[:3, :3] = pin.AngleAxis(angle, np.eye(3)["xyz".index(axis)]).toRotationMatrix()
    return T


def shift(axis, by):
    T = np.eye(4)
    T["xyz".index(axis), 3] = by
    return T


def chain(table, q):
    """Frames (4, 4) of all links by name, from the definition of the two conventions."""
    unit = PI / 180 if table.get("angles") == "deg" else 1.0
    frames, last = {"base": np.eye(4)}, "base"
    for row in table["links"]:
        slides, at = row.get("type") == "prismatic", q.get(row.get("joint"), 0.0)
        theta = unit * row.get("theta", 0.0) + (0.0 if slides else at)
        d, a = row.get("d", 0.0) + (at if slides else 0.0), row.get("a", 0.0)
        alpha = unit * row.get("alpha", 0.0)
        if table["convention"] == "modified":
            step = turn("x", alpha) @ shift("x", a) @ turn("z", theta) @ shift("z", d)
        else:
            step = turn("z", theta) @ shift("z", d) @ shift("x", a) @ turn("x", alpha)
        frames[row["name"]] = frames[row.get("parent", last)] @ step
        last = row["name"]
    return frames


def in_pinocchio(robot, q, body):
    full = robot.configuration(np.array([[q[j] for j in robot.joints]]))[0]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, full)
    return data.oMf[robot.model.getFrameId(body, pin.FrameType.BODY)].homogeneous


def in_mujoco(robot, q, body):
    m = mujoco.MjModel.from_xml_path(str(robot.path))
    d = mujoco.MjData(m)
    for joint, at in q.items():
        d.qpos[m.joint(joint).qposadr[0]] = at
    mujoco.mj_kinematics(m, d)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = d.body(body).xmat.reshape(3, 3), d.body(body).xpos
    return T


def random_tree(convention, angles, rng):
    """Eight links: hinges, slides, a fixed one, two children of one link."""
    scale = 180 / PI if angles == "deg" else 1.0
    links = []
    for k in range(8):
        a, alpha, d, theta = rng.normal(size=4)
        row = {"name": f"l{k}", "a": a, "alpha": alpha * scale, "d": d, "theta": theta * scale}
        row |= {} if k == 3 else {"joint": f"j{k}"}
        row |= {"type": "prismatic"} if k in (1, 5) else {}
        row |= {"parent": "l2"} if k == 6 else {}
        links.append(row)
    return {"convention": convention, "angles": angles, "links": links}


@pytest.mark.parametrize("angles", ["rad", "deg"])
@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_links_are_where_the_product_of_matrices_puts_them(convention, angles, tmp_path):
    rng = np.random.default_rng(0)
    table = random_tree(convention, angles, rng)
    path = tmp_path / "dh.toml"
    path.write_text(toml_text(table))
    robot = Robot.from_dh(path, tmp_path / "robot.xml")
    assert robot.joints == ("j0", "j1", "j2", "j4", "j5", "j6", "j7")
    for _ in range(5):
        q = dict(zip(robot.joints, rng.uniform(-3, 3, 7), strict=True))
        for body, expected in chain(table, q).items():
            np.testing.assert_allclose(in_pinocchio(robot, q, body), expected, atol=1e-12)
            np.testing.assert_allclose(in_mujoco(robot, q, body), expected, atol=1e-12)


def rows(parameters, standard):
    return {
        "convention": "standard" if standard else "modified",
        "links": [
            {"name": f"link{k}", "joint": f"q{k}", "a": a, "alpha": alpha, "d": d}
            for k, (a, alpha, d) in enumerate(parameters, 1)
        ],
    }


PUMA = rows(
    [(0, "pi/2", 0), (0.4318, 0, 0), (0.0203, "-pi/2", 0.15005), (0, "pi/2", 0.4318),
     (0, "-pi/2", 0), (0, 0, 0)], standard=True,
)  # fmt: skip
UR5E = rows(
    [(0, "pi/2", 0.1625), (-0.425, 0, 0), (-0.3922, 0, 0), (0, "pi/2", 0.1333),
     (0, "-pi/2", 0.0997), (0, 0, 0.0996)], standard=True,
)  # fmt: skip
PUMA_MODIFIED = rows(
    [(0, 0, 0), (0, "-pi/2", 0), (0.4318, 0, 0.1254), (-0.0203, "-pi/2", 0.4318),
     (0, "pi/2", 0), (0, "-pi/2", 0)], standard=False,
)  # fmt: skip


@pytest.mark.parametrize(
    ("table", "q", "tip"),
    [
        (PUMA, [0] * 6, [0.4521, -0.1500, 0.4318]),  # [Corke 2011, Sec. 7.2: qz, qr, qn]
        (PUMA, [0, PI / 2, -PI / 2, 0, 0, 0], [0.0203, -0.15005, 0.8636]),
        (PUMA, [0, PI / 4, PI, 0, PI / 4, 0], [0.5963, -0.1501, -0.0143]),
        (UR5E, [0] * 6, [-0.8172, -0.2329, 0.0628]),  # the maker's table of parameters
    ],
)
def test_published_arms_reach_where_their_books_say(table, q, tip, tmp_path):
    robot = Robot.from_dh(table, tmp_path / "robot.xml")
    at = in_pinocchio(robot, dict(zip(robot.joints, q, strict=True)), "link6")[:3, 3]
    np.testing.assert_allclose(at, tip, atol=6e-5)


def test_the_puma_of_craig_follows_his_equations_and_has_its_36_parameters(tmp_path):
    robot = Robot.from_dh(PUMA_MODIFIED, tmp_path / "robot.xml")
    q = np.random.default_rng(0).uniform(-3, 3, 6)
    a2, d3, a3, d4 = 0.4318, 0.1254, -0.0203, 0.4318
    c1, s1, c2, s2 = np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1])
    c23, s23 = np.cos(q[1] + q[2]), np.sin(q[1] + q[2])
    reach = a2 * c2 + a3 * c23 - d4 * s23
    tip = [c1 * reach - d3 * s1, s1 * reach + d3 * c1, -a3 * s23 - a2 * s2 - d4 * c23]
    at = in_pinocchio(robot, dict(zip(robot.joints, q, strict=True)), "link6")[:3, 3]
    np.testing.assert_allclose(at, tip, atol=1e-12)  # [Craig 2005, Eq. 3.14]
    standard = Robot.from_dh(PUMA, tmp_path / "standard.xml")
    for arm in (robot, standard):  # [Gautier & Khalil 1990]
        assert len(find_base_parameters(arm, Model.of("rigid_body"))) == 36


BODY = {"mass": 2.0, "centre": [0.1, 0.05, -0.02],
        "inertia": {"xx": 0.01, "yy": 0.03, "zz": 0.035, "xy": 0.002,
                    "xz": -0.001, "yz": 0.003}}  # fmt: skip


def test_masses_are_those_of_the_table_in_the_frame_of_the_link(agrees, tmp_path):
    table = {**PUMA, "links": [{**row, **BODY} for row in PUMA["links"]]}
    table["sidecar"] = {"nominal": {"q2.Fv": 3.0}}
    done = convert_dh(table, tmp_path / "out.xml")
    assert done.notes == ()
    assert Robot.load(done.robot).nominal["q2.Fv"] == 3.0
    robot = agrees(done.robot.read_text())
    # The regressor's frames are at the joints: a standard frame is a away along x.
    assert robot.nominal["link2.mx"] == pytest.approx(2.0 * (0.1 + 0.4318))
    assert robot.nominal["link2.my"] == pytest.approx(2.0 * 0.05)
    x, y, z = 0.1 + 0.4318, 0.05, -0.02
    assert robot.nominal["link2.Ixy"] == pytest.approx(0.002 - 2.0 * x * y)
    assert robot.nominal["link2.Ixz"] == pytest.approx(-0.001 - 2.0 * x * z)
    assert robot.nominal["link2.Iyz"] == pytest.approx(0.003 - 2.0 * y * z)


def four_bar(**changes):
    """A parallelogram on a turntable, home away from zero, and a lever that follows two joints."""
    links = [
        {"name": "turntable", "joint": "yaw"},
        {"name": "arm", "joint": "shoulder", "alpha": "pi/2"},
        {"name": "coupler", "joint": "elbow", "a": 0.4, "passive": True},
        {"name": "crank", "parent": "turntable", "joint": "heel", "alpha": "pi/2", "a": 0.1,
         "passive": True},
        {"name": "lever", "joint": "lever", "parent": "turntable", "d": 0.3, "alpha": 0.4,
         "equals": "0.5 * yaw - 2*heel + 0.1"},
    ]  # fmt: skip
    table = {
        "name": "four-bar",
        "convention": "modified",
        "links": [{**row, **BODY} for row in links],
        "closures": [{"name": "loop", "link1": "coupler", "point1": [0.1, 0, 0],
                      "link2": "crank", "point2": [0.4, 0, 0]}],
        "home": {"shoulder": 1.0, "elbow": -0.995, "heel": 1.004},
    }  # fmt: skip
    return table | changes


def test_loops_and_joints_that_follow_two_others_are_what_mujoco_makes_of_them(agrees, tmp_path):
    done = convert_dh(four_bar(), tmp_path / "out.xml")
    robot = agrees(done.robot.read_text(), sidecar=done.sidecar.read_text(), spread=0.4)
    assert robot.joints == ("yaw", "shoulder")
    q = np.random.default_rng(1).uniform(-0.5, 1.0, (10, 2))
    motion = complete_motion(robot, np.arange(10.0), q, 0 * q, 0 * q)
    elbow, heel, lever = (robot.dof_position(motion.q, j) for j in ("elbow", "heel", "lever"))
    np.testing.assert_allclose(elbow, -q[:, 1], atol=1e-12)  # the parallelogram's own equation
    np.testing.assert_allclose(lever, 0.5 * q[:, 0] - 2 * heel + 0.1, atol=1e-12)
    home = dict(zip(robot.dofs, robot.home, strict=False))
    assert home["heel"] == pytest.approx(1.0, abs=1e-12)  # was closed when it was written


def test_a_spring_between_two_links_is_one_of_its_length(tmp_path):
    table = {**PUMA_MODIFIED, "springs": [
        {"name": "spring", "link1": "link1", "point1": [0, 0, 0.3], "link2": "link2",
         "point2": [0.2, 0, 0.1], "stiffness": 300, "rest": 0.2}]}  # fmt: skip
    robot = Robot.from_dh(table, tmp_path / "robot.xml")
    assert robot.nominal["spring.K"] == 300
    q = np.random.default_rng(0).uniform(-1, 1, (4, 6))

    def energy(angle):  # link2 turns about y of link1: its x points down, its z along y
        point = np.array([0.2 * np.cos(angle), 0.1 + 0 * angle, -0.2 * np.sin(angle)])
        length = np.linalg.norm(point - [[0], [0], [0.3]], axis=0)
        return 150 * (length - 0.2) ** 2

    torque = (energy(q[:, 1] + 1e-6) - energy(q[:, 1] - 1e-6)) / 2e-6
    W = Model.of("joint_stiffness@spring").regressor(
        robot, complete_motion(robot, np.arange(4.0), q, 0 * q, 0 * q)
    )
    np.testing.assert_allclose(300 * W[:, 1, 0], torque, rtol=1e-7)
    np.testing.assert_allclose(np.delete(W[:, :, 0], 1, axis=1), 0, atol=1e-12)


def test_degrees_of_the_table_are_those_of_joints_that_turn(tmp_path):
    links = [
        {"name": "a", "joint": "turn", "range": [-90, 45]},
        {"name": "b", "joint": "slide", "type": "prismatic", "range": [-0.1, 0.2]},
        {"name": "c", "joint": "screw", "equals": "0.01 * turn + 0.1", "type": "prismatic"},
        {"name": "e", "joint": "twice", "equals": "2 * half"},
        {"name": "d", "joint": "half", "equals": "= 0.5*turn - 5"},
    ]
    table = {"convention": "modified", "angles": "deg", "links": links,
             "home": {"turn": 20, "slide": 0.05}}  # fmt: skip
    robot = Robot.from_dh(table, tmp_path / "robot.xml")
    np.testing.assert_allclose(robot.limits, [[-PI / 2, PI / 4], [-0.1, 0.2]])
    found = dict(zip(robot.dofs, robot.home, strict=True))
    assert found["turn"] == pytest.approx(PI / 9)
    assert found["screw"] == pytest.approx(0.3)  # 0.01 m a degree
    assert found["slide"] == 0.05
    assert found["half"] == pytest.approx(np.radians(5))
    assert found["twice"] == pytest.approx(np.radians(10))
    q = np.array([[0.3, 0.0]])
    motion = complete_motion(robot, np.zeros(1), q, 0 * q, 0 * q)
    assert robot.dof_position(motion.q, "screw")[0] == pytest.approx(0.1 + 0.01 * 0.3 * 180 / PI)


def test_what_weighs_nothing_is_no_part_of_the_model(tmp_path):
    links = [{**BODY, "name": "arm", "joint": "a"}, {"name": "flange", "mass": 0},
             {"name": "tip", "joint": "b", "alpha": "pi/2", "mass": 0}]  # fmt: skip
    robot = Robot.from_dh({"convention": "modified", "links": links}, tmp_path / "robot.xml")
    assert robot.placed == ("rigid_body@arm",)
    links.append({**BODY, "name": "load"})  # fixed to the tip, which then weighs something
    robot = Robot.from_dh({"convention": "modified", "links": links}, tmp_path / "robot.xml")
    assert robot.placed == ()
    assert robot.nominal["tip.m"] == pytest.approx(2.0)


def test_what_the_table_leaves_open_is_said(tmp_path):
    links = [{"name": "arm", "joint": "a"}, {"name": "hand", "joint": "b", "alpha": 1.5708,
             "mass": 1.5}]  # fmt: skip
    done = convert_dh({"convention": "modified", "links": links}, tmp_path / "robot.xml")
    rounded, weightless, thin = done.notes
    assert "alpha = 1.5708 of 'hand': nearly a multiple of 45°" in rounded
    assert "no mass of arm: each is a ball of 1 kg" in weightless
    assert "no inertia of hand: each has 0.01 kg·m² a kilogram" in thin
    robot = Robot.load(done.robot)
    assert robot.nominal["hand.Izz"] == pytest.approx(0.015)
    assert robot.guessed == ("arm",)
    assert not has_masses(robot)  # no torque is compared with what a guess asks for
    masses = {"arm.m": 40.0, "hand.m": 9.0}
    assert state_mass(robot, masses) == ""
    assert state_masses(robot, masses).endswith("of the robot file 2.5 kg, where arm are guesses.")
    assert rounded in done.robot.read_text()
    exact = [{**row, "alpha": "pi/2"} for row in links]
    done = convert_dh({"convention": "modified", "links": exact}, tmp_path / "robot.xml")
    assert len(done.notes) == 2


def arm(**row):
    return {"convention": "modified",
            "links": [{"name": "a", "joint": "j"}, {"name": "b", "joint": "k", **row}]}  # fmt: skip


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"links": [{"name": "a"}]}, "The table: 'convention': field required"),
        (arm(alpha="pi/x"), r"'links.1.alpha': 'pi/x' is no part of pi; write it as -pi/2"),
        (arm(alpha=True), "'links.1.alpha': give a number, or a text"),
        (arm(parent="aa"), "the link 'b' hangs on 'aa', which is no link above it, did you mean"),
        (arm(name="a"), "two of its links are called 'a'"),
        (arm(joint="j"), "two of its joints are called 'j'"),
        (arm(joint=None, range=[0, 1]), "the link 'b' has 'range' but no joint"),
        (arm(passive=True, equals="j"), "the joint 'k' is passive and equals 'j'"),
        (arm(passive=True), r"^robot.xml: 1 joints have no actuator \(k\)"),
        (arm(equals="2 * jj"), "there is no joint 'jj', did you mean 'j'"),
        (arm(equals="j - k"), "the joint 'k' equals 'j - k', itself; name other joints"),
        (arm(a=1e300), "'links.1.a': input should be less than or equal to 1000000"),
        (arm() | {"springs": [{"name": "s", "link1": "a", "link2": "b", "stiffness": 1,
                               "rest": 1}]},
         "robot.xml: two neighbouring points of the tendon 's' coincide at the home position"),
        ({"convention": "standard", "links": [{"name": "a", "joint": "j", "mass": 0}]},
         "every link that moves has mass = 0"),
        (arm(equals="sin(j)"), r"equals 'sin\(j\)', which is no sum of joints"),
        (arm(centre=[0, 0, 1]), "the link 'b' has 'centre' but no mass"),
        (arm(mass=1, inertia={"xx": 1, "yy": 1, "zz": 3}), "robot.xml cannot be read as MJCF"),
        ({**arm(), "home": {"l": 1}}, r"\[home\] names the joint 'l', which is not there"),
        ({**arm(equals="j"), "home": {"k": 1}}, r"\[home\] states 'k', which equals j"),
        ({**arm(), "closures": [{"name": "c", "link1": "a", "link2": "e"}]},
         "'c' ends at the link 'e', which is not there"),
        (four_bar(home={"shoulder": 1.0, "elbow": -0.5, "heel": 0.7}),
         "the loops are open by .* such as elbow"),
        ({**arm(), "sidecar": {"limits": {"l": {"v": 1}}}}, r"\[limits\] names 'l'"),
        ({**arm(), "sidecar": {"limit": {}}}, "'sidecar.limit' is not a key that is known here"),
    ],
)  # fmt: skip
def test_tables_that_cannot_be_are_refused_in_a_sentence(table, sentence, tmp_path):
    with pytest.raises(RobotError, match=sentence):
        convert_dh(table, tmp_path / "robot.xml")
    assert list(tmp_path.iterdir()) == []


def test_a_closure_that_says_nothing_changes_nothing(tmp_path):
    idle = arm() | {"closures": [{"name": "pin", "link1": "a", "link2": "b"}]}
    robot = Robot.from_dh(idle, tmp_path / "robot.xml")
    assert (robot.joints, robot.closed) == (("j", "k"), False)
    q = np.zeros((1, 2))
    assert complete_motion(robot, np.zeros(1), q, q, q).X is None


def test_the_command_writes_both_files_and_never_over_a_sidecar_of_the_users(tmp_path):
    table, out = tmp_path / "dh.toml", tmp_path / "robot.xml"
    table.write_text(toml_text(arm(mass=0) | {"sidecar": {"symbols": {"j": "1"}}}))
    for _ in range(2):  # again over its own
        done = CliRunner().invoke(app, ["convert", str(table), "--out", str(out)])
        assert done.exit_code == 0, done.output
        assert "no mass of a" in done.stderr
        assert done.stdout.split() == [str(out), str(out.with_suffix(".toml"))]
    assert tomllib.loads(out.with_suffix(".toml").read_text())["symbols"] == {"j": "1"}
    out.with_suffix(".toml").write_text("name = 'mine'\n")
    with pytest.raises(OutputError, match="is not of a conversion's making"):
        convert_dh(table, out)
    for wrong in ("dh.xml", "robot.urdf"):
        done = CliRunner().invoke(app, ["convert", str(table), "--out", str(tmp_path / wrong)])
        assert done.exit_code == 2
        assert "Error: " in done.stderr
    assert out.with_suffix(".toml").read_text() == "name = 'mine'\n"


def test_a_robot_of_the_tables_own_name_is_refused_and_the_reason_is_said(tmp_path):
    table = tmp_path / "dh.toml"
    table.write_text('convention = "modified"\n[[links]]\nname = "a"\njoint = "j"\n')
    before = table.read_bytes()
    with pytest.raises(OutputError, match=r"dh.toml', which is the table.*as in 'dh_robot.xml'"):
        convert_dh(table, tmp_path / "dh.xml")
    assert table.read_bytes() == before
    assert not (tmp_path / "dh.xml").exists()
