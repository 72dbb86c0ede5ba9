"""Robots from tables of Denavit and Hartenberg: against products of elementary matrices."""

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from identifiability import Model, Robot, find_base_parameters
from identifiability.foundation.documents import toml_text
from identifiability.robot.table import write_table

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
    frames = {"base": np.eye(4)}
    last = "base"
    for row in table["links"]:
        slides = row.get("type") == "prismatic"
        at = q.get(row.get("joint"), 0.0)
        theta = unit * row.get("theta", 0.0) + (0.0 if slides else at)
        d = row.get("d", 0.0) + (at if slides else 0.0)
        a = row.get("a", 0.0)
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


def tip(table, body):
    """Return the frame of a row: of a standard one it lies behind the joint."""
    standard = table["convention"] == "standard"
    jointed = any(row["name"] == body and "joint" in row for row in table["links"])
    return f"{body}_end" if standard and jointed else body


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
def test_links_are_where_the_product_of_matrices_puts_them(convention, angles, tmp_path, rng):
    table = random_tree(convention, angles, rng)
    path = tmp_path / "dh.toml"
    path.write_text(toml_text(table))
    robot = Robot.from_dh(path, tmp_path / "robot.urdf")
    assert sorted(robot.joints) == ["j0", "j1", "j2", "j4", "j5", "j6", "j7"]
    for _ in range(5):
        q = dict(zip(robot.joints, rng.uniform(-3, 3, 7), strict=True))
        for body, expected in chain(table, q).items():
            at = in_pinocchio(robot, q, tip(table, body))
            assert_allclose(at, expected, atol=1e-12)


def rows(parameters, standard):
    return {
        "convention": "standard" if standard else "modified",
        "links": [
            {"name": f"link{k}", "joint": f"q{k}", "a": a, "alpha": alpha, "d": d}
            for k, (a, alpha, d) in enumerate(parameters, 1)
        ],
    }


PUMA = rows(
    [(0, PI / 2, 0), (0.4318, 0, 0), (0.0203, -PI / 2, 0.15005), (0, PI / 2, 0.4318),
     (0, -PI / 2, 0), (0, 0, 0)], standard=True,
)  # fmt: skip


def test_the_puma_reaches_where_its_book_says_and_has_its_36_parameters(tmp_path):
    robot = Robot.from_dh(PUMA, tmp_path / "robot.urdf")
    at = dict(zip(robot.joints, [0, PI / 4, PI, 0, PI / 4, 0], strict=True))
    reached = in_pinocchio(robot, at, "link6_end")[:3, 3]
    assert_allclose(reached, [0.5963, -0.1501, -0.0143], atol=6e-5)  # [Corke 2011]
    base = find_base_parameters(robot, Model.of("rigid_body"))
    assert len(base) == 36  # [Gautier & Khalil 1990]


BODY = {"mass": 2.0, "centre": [0.1, 0.05, -0.02],
        "inertia": {"xx": 0.01, "yy": 0.03, "zz": 0.035, "xy": 0.002,
                    "xz": -0.001, "yz": 0.003}}  # fmt: skip


def test_masses_are_those_of_the_table_in_the_frame_of_the_link(tmp_path):
    table = {**PUMA, "links": [{**row, **BODY} for row in PUMA["links"]]}
    table["sidecar"] = {"nominal": {"q2.Fv": 3.0}}
    assert write_table(table, tmp_path / "out.urdf") == ()
    robot = Robot.load(tmp_path / "out.urdf")
    assert robot.nominal["q2.Fv"] == 3.0
    # The regressor's frames are at the joints: a standard frame is a away along x.
    assert robot.nominal["link2.mx"] == pytest.approx(2.0 * (0.1 + 0.4318))
    assert robot.nominal["link2.my"] == pytest.approx(2.0 * 0.05)
    x = 0.1 + 0.4318
    y = 0.05
    z = -0.02
    assert robot.nominal["link2.Ixy"] == pytest.approx(0.002 - 2.0 * x * y)
    assert robot.nominal["link2.Ixz"] == pytest.approx(-0.001 - 2.0 * x * z)
    assert robot.nominal["link2.Iyz"] == pytest.approx(0.003 - 2.0 * y * z)


def arm(**row):
    return {"convention": "modified",
            "links": [{"name": "a", "joint": "j"}, {"name": "b", "joint": "k", **row}]}  # fmt: skip


@pytest.mark.parametrize(
    "table, sentence",
    [
        ({"links": [{"name": "a"}]}, "The table: 'convention': field required"),
        (arm(alpha="pi/0"), "'links.1.alpha"),
        (arm(parent="aa"), "the link 'b' hangs on 'aa', which is no link above it, did you mean"),
        (arm(name="a"), "two of its links or joints are called 'a'"),
        (arm(joint="j"), "two of its links or joints are called 'j'"),
        (arm(joint=None, range=[0, 1]), "the link 'b' has 'range' but no joint"),
        (arm(equals="j"), "'links.1.equals' is not a key that is known here"),
        ({**arm(), "closures": []}, "The table: 'closures' is not a key that is known here"),
        (arm(a=1e300), "'links.1.a': input should be less than or equal to 1000000"),
        (arm(centre=[0, 0, 1]), "the link 'b' has a centre or an inertia but no mass"),
        ({**arm(), "sidecar": {"limit": {}}}, "'sidecar.limit' is not a key that is known here"),
    ],
)
def test_tables_that_cannot_be_are_refused_in_a_sentence(table, sentence, tmp_path, rejected):
    with rejected(sentence):
        write_table(table, tmp_path / "robot.urdf")
    assert list(tmp_path.iterdir()) == []


def test_a_new_study_holds_the_robot_of_a_table(succeeds, tmp_path):
    table = tmp_path / "table.toml"
    table.write_text(toml_text(arm(mass=1.0, d=0.2)))
    done = succeeds("new", tmp_path / "mine", "--robot", table)
    assert "is taken for a ball of 1 kg" in done.output
    robot = Robot.load(tmp_path / "mine/robot.urdf")
    assert (robot.joints, robot.guessed) == (("j", "k"), ("a",))
    assert (tmp_path / "mine/template.csv").is_file()


def test_angles_in_parts_of_pi_are_in_rad_whatever_the_unit_of_numbers(tmp_path):
    number, text = (tmp_path / f"{name}.urdf" for name in ("number", "text"))
    write_table(arm(alpha=-90.0) | {"angles": "deg"}, number)
    write_table(arm(alpha="-pi/2") | {"angles": "deg"}, text)
    assert number.read_text() == text.read_text()
