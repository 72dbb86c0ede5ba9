"""Torque that the sidecar knows as a function of position: simulated, taken off, refused beyond."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    IdentifiabilityError,
    Preparation,
    Robot,
    analyze,
    inspect,
    payload,
    prepare_log,
)
from identifiability.robot.sidecar import KnownTorque

from ..conftest import shipped_log, write_robot

MODELS = Path(__file__).parents[2] / "models"
CABLE = """
[[known_torque]]
along = "elbow"
table = [[2, -1.5], [-4, 0.4], [0.3, 0.9], [4, 2]]
"""


def with_sidecar(tmp_path, name, text, change=lambda xml: xml):
    """Return a shipped robot with more in its sidecar, and another MJCF."""
    own = next(MODELS.glob(f"{name}/robot.*ml"))
    xml = own.with_suffix(".xml")
    toml = own.with_suffix(".toml")
    given = toml.read_text() if toml.exists() else ""
    folder = tmp_path / name  # whose name the robot has
    folder.mkdir(exist_ok=True)
    return write_robot(folder, change(xml.read_text()), sidecar=f"{given}\n{text}")


def log_of(robot, samples=200):
    return shipped_log(robot, "a", samples, like=Robot.load(robot.name))


def test_a_table_is_read_between_its_points_as_it_says():
    x = np.linspace(-1, 2, 40)
    line = KnownTorque(along="j", table=[(1, 3), (0, 1), (3, -1)])
    assert_allclose(line.force(np.array([0.25, 2.0, 3.0])), [1.5, 1.0, -1.0])
    assert_allclose(KnownTorque(along="j", polynomial=[1, 0, 2]).force(x), 1 + 2 * x**2)


def test_a_curve_that_was_used_can_be_sent_to_a_worker():
    known = KnownTorque(along="j", polynomial=[1, 2])
    known.force(np.zeros(2))
    assert_array_equal(pickle.loads(pickle.dumps(known)).force(np.ones(2)), [3, 3])


def test_a_known_torque_is_simulated_and_taken_off_again(tmp_path, two_link):
    """What is left is the torque of the robot without it, and its values come back."""
    robot = with_sidecar(tmp_path, "two-link", CABLE)
    log = log_of(robot)
    bare = log_of(two_link)
    table = KnownTorque(along="elbow", table=[[2, -1.5], [-4, 0.4], [0.3, 0.9], [4, 2]])
    elbow = list(robot.joints).index("elbow")
    added = np.zeros_like(bare.tau)
    added[:, elbow] = table.force(bare.q[:, elbow])
    assert_allclose(log.tau, bare.tau + added, atol=1e-12)
    how = Preparation(keep_rest=True)
    samples = prepare_log(robot, log, how)
    assert_allclose(samples.tau, prepare_log(two_link, bare, how).tau, atol=1e-9)
    assert any(
        "known torque was taken off" in note and "4 points" in note for note in samples.notes
    )


def test_results_say_what_was_taken_off(tmp_path):
    robot = with_sidecar(tmp_path, "two-link", CABLE)
    found = analyze(robot, log_of(robot), replicates=30)
    assert found.to_dict()["robot"]["known_torque"] == [robot.known_torque[0].text]
    assert "elbow" in found.provenance["known torque"]
    assert found.chosen.error_ra < 1e-6
    facts = {fact.name: fact.remark for fact in inspect(robot).joints}
    assert "known torque along elbow by a table of 4 points" in facts["elbow"]
    assert "known" not in facts["shoulder"]


@pytest.mark.parametrize("joint", ["right_elbow", "left_shoulder"])
def test_a_line_is_the_spring_of_the_robot_file(tmp_path, joint):
    """Along passive and actuated joints alike, against MJCF's stiffness and springref."""
    text = f'[[known_torque]]\nalong = "{joint}"\npolynomial = [-1.8, 6.0]\n'
    mark = f'joint name="{joint}"'
    robot = with_sidecar(tmp_path, "five-bar", text)
    (tmp_path / "s").mkdir()
    spring = with_sidecar(
        tmp_path / "s", "five-bar", "",
        lambda xml: xml.replace(mark, f'{mark} stiffness="6" springref="0.3"'),
    )  # fmt: skip
    assert spring.rest[joint] == pytest.approx(0.3)
    log = log_of(robot)
    assert_allclose(log.tau, log_of(spring).tau, atol=1e-10)
    assert np.abs(log.tau - log_of(Robot.load("five-bar")).tau).max() > 0.1
    how = Preparation(keep_rest=True)
    bare = prepare_log(Robot.load("five-bar"), log_of(Robot.load("five-bar")), how)
    assert_allclose(prepare_log(robot, log, how).tau, bare.tau, atol=1e-7)


def test_nothing_is_extrapolated(tmp_path, rejected, two_link):
    """Beyond a table, or the range of a polynomial, log and simulation are refused."""
    text = '[[known_torque]]\nalong = "elbow"\npolynomial = [0, 1]\nrange = [-0.1, 0.1]\n'
    robot = with_sidecar(tmp_path, "two-link", text)
    log = log_of(two_link)
    with rejected(r"'elbow' is at .* from -0\.1 to 0\.1: .* lie outside"):
        prepare_log(robot, log)
    with rejected("nothing is extrapolated"):
        log_of(robot)
    edge = KnownTorque(along="j", table=[(0, 1), (1, 2)])
    assert_allclose(edge.force(np.array([0.0, 1.0])), [1, 2])
    for outside in (-1e-9, 1 + 1e-9):
        with pytest.raises(IdentifiabilityError):
            edge.force(np.array([0.5, outside]))


@pytest.mark.parametrize(
    "text, words",
    [
        ('along = "elbw"\npolynomial = [1]', "elbow"),
        ('along = "elbow"', "either a table or a polynomial"),
        ('along = "elbow"\ntable = [[0, 1]]', "two points"),
        ('along = "elbow"\ntable = [[0, 1], [0, 2]]', "another position"),
        ('along = "elbow"\ntable = [[0, 1], [1, 2]]\nrange = [0, 1]', "leave out the range"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, text, words, rejected):
    with rejected(words):
        with_sidecar(tmp_path, "two-link", f"[[known_torque]]\n{text}\n")


def test_gains_are_not_identified_beside_it(tmp_path, rejected):
    robot = with_sidecar(tmp_path, "two-link", CABLE)
    with rejected("take it out"):
        payload(robot, "empty.csv", "loaded.csv", mass=1, centre=(0, 0, 0))


def test_along_a_locked_joint_it_moves_nothing(tmp_path):
    robot = with_sidecar(tmp_path, "two-link", CABLE)
    assert Robot.load(robot.path, lock=["elbow"]).known_torque == ()
