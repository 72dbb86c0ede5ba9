"""A base that stands otherwise than its file says: found, stated, written, and moved alike."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Model, Noise, Robot, analyze, diagnose, export
from identifiability.effects.base import horizontal_axes, tilt_text
from identifiability.effects.nominal import rigid_torque
from identifiability.regression.structure import Structure, random_motion
from identifiability.robot import complete_motion
from identifiability.robot.kinematics import turn
from identifiability.simulation.mujoco_robot import MujocoRobot
from identifiability.workflows.export.workflow import write_parameters

from ..conftest import shipped_log

ANGLES = (1.0, 30.0, 90.0, 180.0)


def leaning(robot, degrees):
    """Gravity of a base at so many degrees, about an axis that is none of the file's."""
    first, second = horizontal_axes(robot.gravity)
    return turn(robot.gravity, np.radians(degrees) * (0.6 * first + 0.8 * second))


def torque_of(robot, motion):
    """Torque of another robot along the actuated motion."""
    own = motion.actuated_q, motion.actuated_v, motion.actuated_a
    return rigid_torque(robot, complete_motion(robot, motion.t, *own))


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("ending", [".xml", ".urdf"])
@pytest.mark.parametrize("name", ["six-dof-arm", "3-rps"])
def test_a_written_file_has_the_torque_of_the_model_by_both_roads(name, ending, degrees, tmp_path):
    robot = Robot.load(name)
    gravity = leaning(robot, degrees)
    structure = Structure.of(robot, Model.of("rigid_body", tilt_text(gravity)))
    motion = random_motion(robot, default_rng(1), 20)
    W = structure.model.regressor(structure.robot, motion)
    tau = W @ structure.nominal
    assert structure.robot.tilt.degrees == pytest.approx(degrees)
    written = write_parameters(structure.robot, robot.nominal, tmp_path / f"copy{ending}")
    copy = Robot.load(written.robot)
    own = motion.actuated_q, motion.actuated_v, motion.actuated_a
    scale = np.abs(tau).max()
    assert_allclose(torque_of(copy, motion), tau, atol=1e-9 * scale)
    assert_allclose(MujocoRobot(copy).inverse_dynamics(*own).tau, tau, atol=1e-7 * scale)
    assert np.abs(tau - rigid_torque(robot, motion)).max() > 1e-3 * scale


def test_a_small_tilt_among_the_values_is_gravity_in_the_file(tmp_path, two_link):
    values = {"base.tilt1": 0.02, "base.tilt2": -0.01}
    written = write_parameters(two_link, values, tmp_path / "copy.xml")
    assert not written.beside
    g, (first, second) = two_link.gravity, horizontal_axes(two_link.gravity)
    expected = turn(g, 0.02 * first - 0.01 * second)
    assert_allclose(Robot.load(written.robot).gravity, expected, atol=1e-12)
    assert np.linalg.norm(expected) == pytest.approx(np.linalg.norm(g))


@pytest.mark.parametrize("ending", [".xml", ".urdf"])
def test_a_joint_may_have_the_name_of_the_base_or_of_a_body(ending, load_text, tmp_path):
    text = Robot.load("six-dof-arm").path.read_text()
    robot = load_text(text.replace("joint_1", "base").replace("joint_2", "link_3"), "urdf")
    written = write_parameters(robot, {**robot.nominal, "link_3.Fv": 3.0}, tmp_path / f"c{ending}")
    again = Robot.load(written.robot).nominal
    kept = {n: x for n, x in robot.nominal.items() if n[-2:] not in ("Ia", "Fv", "Fc")}
    assert again == pytest.approx(
        again | kept | {"link_3.Fv": 3.0, "base.Fc": robot.nominal["base.Fc"]}
    )


def test_gravity_of_an_mjcf_that_is_not_down_turns_the_base_of_its_urdf(
    load_text, tmp_path, two_link
):
    text = two_link.path.read_text()
    robot = load_text(text.replace("<worldbody", '<option gravity="9.81 0 0"/><worldbody', 1))
    motion = random_motion(robot, default_rng(0), 10)
    copy = Robot.load(write_parameters(robot, {}, tmp_path / "copy.urdf").robot)
    assert_allclose(torque_of(copy, motion), rigid_torque(robot, motion), atol=1e-9)


@pytest.fixture(scope="module")
def on_a_wall():
    """Logs of an arm that hangs on a wall, of which the file says that it stands."""
    robot = Robot.load("six-dof-arm")
    turned = robot.turned(np.array([0.0, 1.0, 0.0]))
    noise = Noise(additive=0.02)
    return robot, [shipped_log(turned, m, 400, noise=noise, seed=k) for k, m in enumerate("ab")]


def test_a_wall_is_found_stated_written_and_drawn(on_a_wall, tmp_path):
    robot, (log, unseen) = on_a_wall
    found = diagnose(robot, log, unseen, quick=True)
    assert not any(e.name == "gravity_tilt" for e in found.effects)
    assert np.linalg.norm(found.robot.tilt.direction - [0, 1, 0]) < 0.02
    assert "Gravity points along (" in found.details
    assert 'fixed joint with rpy="-1.5' in found.details
    assert found.held_after < 0.03
    told = found.to_dict()
    assert told["robot"]["gravity"]["degrees"] == pytest.approx(90.0, abs=1.0)
    assert told["model"] == list(found.structure.model.texts)
    exported = export(robot, found, tmp_path / "wall.urdf")
    assert "wall.urdf holds a tilted base: gravity points along" in exported.statement
    again = analyze(robot, log, unseen, ladder=found, quick=True, replicates=0)
    assert "In this model gravity points along" in again.details
    assert again.chosen.error_ra_validation < 0.03


@pytest.mark.parametrize("share", [0.015, 0.04])  # a missing effect, and another reading
def test_headline_table_and_file_have_one_angle(share):
    robot = Robot.load("six-dof-arm")
    hide, noise = [f"gravity_tilt={share}"], Noise(additive=0.02)
    logs = [shipped_log(robot, m, 400, noise=noise, hide=hide, seed=k) for k, m in enumerate("ab")]
    found = diagnose(robot, *logs, quick=True, forward=False)
    angle = found.to_dict()["physical"]["gravity"]["degrees"]
    assert f"A tilted base, {angle:.2f}° ± 0." in found.statement
    assert not found.warnings
    if found.effects:
        table = found.to_frame()
        assert np.degrees(np.linalg.norm(table["value"])) == pytest.approx(angle, rel=0.02)
    else:
        assert "already has this tilt" in found.statement
        assert f"{angle:.3g}° from the direction" in found.details
