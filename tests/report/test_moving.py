"""Robots that move on a page are where their kinematics put them, and light."""

import json

import numpy as np
import pytest

from identifiability import Robot
from identifiability.report.blocks import Section
from identifiability.report.results import Page, render_page
from identifiability.report.skeleton import MOST_FRAMES, move_skeletons


@pytest.fixture(scope="module")
def moving():
    robot = Robot.load("hobby-arm")
    t = np.arange(0, 40, 0.02)
    home = robot.actuated_positions(robot.home[None])[0]
    q = home + 0.3 * np.sin(t)[:, None] * np.ones(6)
    other = q + 0.01
    other[1500:] = np.nan  # it diverged
    errors = [1e3 * np.abs(other - q).max(1)]
    robots = {"recording": ("grey", q), "fitted.xml": ("blue", other)}
    return move_skeletons(robot, t, robots, errors, "They move.", "mrad")


def test_places_are_in_the_picture_and_few(moving):
    assert moving.frames == MOST_FRAMES
    first, second = moving.points
    assert np.all((first >= 0) & (first <= np.array(moving.size)))
    apart = np.nanmax(np.abs(first - second))
    assert 0.1 < apart < 10
    assert np.isnan(second[-1]).all()
    told = json.loads(moving.data)
    assert told["robots"][1][-1] is None
    assert told["errors"][0][0] == "fitted.xml 10 mrad"
    assert told["errors"][0][-1] == "diverged"
    assert len(moving.data) < 200_000


def test_bodies_keep_their_length_on_a_robot_that_lies_in_its_plane():
    robot = Robot.load("two-link")
    t = np.arange(0, 4, 0.02)
    q = np.stack([np.sin(t), np.cos(2 * t)], 1)
    drawn = move_skeletons(robot, t, {"recording": ("grey", q)}, [], "", "mrad")
    for a, b in drawn.lines:
        length = np.linalg.norm(drawn.points[0][:, a] - drawn.points[0][:, b], axis=1)
        np.testing.assert_allclose(length, length[0], rtol=1e-6)


def test_a_page_carries_the_script_only_where_robots_move(moving):
    page = Page("a", sections=(Section("a", "b", blocks=(moving,)),))
    assert "drawMoving" in render_page(page)
    assert "drawMoving" not in render_page(Page("a"))
