"""Robots that move on a page are where their kinematics put them, and light."""

import json

import numpy as np
import pytest

from identifiability import Robot
from identifiability.report.blocks import Answers
from identifiability.report.results import Page, render_page
from identifiability.report.skeleton import MOST_FRAMES, move_skeletons, move_with_torque
from identifiability.robot import complete_motion


@pytest.fixture(scope="module")
def moving():
    robot = Robot.load("hobby-arm")
    t = np.arange(0, 40, 0.02)
    home = robot.actuated_positions(robot.home[None])[0]
    q = home + 0.3 * np.sin(t)[:, None] * np.ones(6)
    other = q + 0.01
    other[1500:] = np.nan  # it diverged
    poses = {"recording": ("grey", robot.configuration(q))}
    poses["fitted.xml"] = ("blue", robot.configuration(other))
    return move_skeletons(robot, t, poses, lambda rows: [[f"row {k}" for k in rows]], "They move.")


def test_places_are_in_the_picture_and_few(moving):
    assert len(moving.t) == MOST_FRAMES
    first, second = moving.points
    on_paper = first[..., :2]
    assert np.all((on_paper >= 0) & (on_paper <= np.array(moving.size)))
    assert 0.1 < np.nanmax(np.abs(on_paper - second[..., :2])) < 10
    assert np.isnan(second[-1]).all()
    told = json.loads(moving.data)
    assert told["robots"][1][-1] is None
    assert told["told"] == [[f"row {k}" for k in np.searchsorted(np.arange(0, 40, 0.02), moving.t)]]
    assert len(moving.data) < 200_000


def test_a_closed_chain_is_drawn_with_plates_cylinders_and_closed_loops():
    robot = Robot.load("3-rps")
    t = np.arange(0, 4, 0.1)
    q = robot.actuated_positions(robot.home[None]) + 0.02 * np.sin(t)[:, None] * np.arange(3)
    still = np.zeros_like(q)
    poses = complete_motion(robot, t, q, still, still).q
    drawn = move_skeletons(robot, t, {"run": ("grey", poses)}, lambda rows: [], "")
    kinds = [shape.kind for shape in drawn.shapes]
    assert kinds.count("cylinder") == kinds.count("rod") == kinds.count("joint") / 2 == 3
    plates = {shape.kind: shape for shape in drawn.shapes if shape.points[0] == shape.points[-1]}
    assert set(plates) == {"body", "base"}
    rods = [shape.points[-1] for shape in drawn.shapes if shape.kind == "rod"]
    (points,) = drawn.points
    apart = points[:, plates["body"].points[:-1], None] - points[:, None, rods]
    assert np.linalg.norm(apart, axis=-1).min(axis=1).max() < 0.1


def test_a_slide_on_the_ground_is_a_rail_on_two_posts(load_text):
    robot = load_text(
        """<robot name="gantry"><link name="a"/><link name="b"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="x" type="prismatic"><axis xyz="1 0 0"/><origin xyz="0 0 1"/>
        <parent link="a"/><child link="b"/><limit effort="9" velocity="1"/></joint></robot>""",
        "urdf",
    )
    poses = {"run": ("grey", np.linspace(0.1, 0.5, 40)[:, None])}
    drawn = move_skeletons(robot, np.arange(40.0), poses, lambda rows: [], "")
    assert sorted(x.kind for x in drawn.shapes) == ["base", "base", "body", "rod", "rod"]


def test_a_floating_robot_stands_with_its_lowest_point_on_the_ground():
    robot = Robot.load("quadruped", base="floating")
    t = np.arange(0, 4, 0.1)
    poses = np.repeat(robot.home[None], len(t), axis=0)
    poses[:, -1] += 0.2 * np.sin(t)
    drawn = move_skeletons(robot, t, {"run": ("grey", poses)}, lambda rows: [], "")
    assert {shape.kind for shape in drawn.shapes} == {"body", "joint"}
    deepest = np.array([end[1] for line in drawn.ground for end in line]).max()
    assert drawn.points[0][..., 1].max() < deepest


@pytest.mark.parametrize("name", ["two-link", "3-rps"])
def test_a_joint_is_marked_when_and_where_torque_is_missed(name):
    robot = Robot.load(name)
    t = np.arange(0, 4, 0.01)
    home = robot.actuated_positions(robot.home[None])[0]
    q = home + 0.05 * np.sin(t)[:, None]
    motion = complete_motion(robot, t, q, np.gradient(q, t, axis=0), np.zeros_like(q))
    torque = np.sin(3 * t)[:, None] * np.ones_like(home)
    residual = np.zeros_like(torque)
    residual[200:, 1] = 0.5
    torque[250:260] = np.nan
    lines = {"measured": torque, "residual": residual}
    drawn = move_with_torque(robot, motion, t, torque, lines, "run", residual)
    assert drawn.torque.name == robot.joints[1]
    assert not drawn.misses[drawn.t < 1.9].any()
    assert (np.count_nonzero(drawn.misses[drawn.t > 2.1], axis=1) == 1).all()
    above, below = drawn.strips
    ((_, _, path),) = above.plot
    assert below.plot[0][1] == "vermilion"
    assert below.range == (0.0, 0.5)
    small = {"before": torque, "after": 0.01 * torque}  # its error has a scale of its own
    assert len(move_with_torque(robot, motion, t, torque, small, "run").strips) == 2
    assert drawn.gaps == [pytest.approx((400 * 249 / 399, 400 * 11 / 399))]
    assert path in render_page(Page("a", summary=(Answers((), (drawn,)),)))
