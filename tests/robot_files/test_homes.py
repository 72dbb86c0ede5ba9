"""A closed chain whose files state no home: the same robot, or refused with the ways it closes."""

import re

import numpy as np
import pytest

from identifiability.foundation.errors import RobotError
from identifiability.robot import complete_motion
from identifiability.robot.locate import locate_robot
from identifiability.workflows.inspect import inspect


def homeless(text):
    return re.sub(r"(?s)<keyframe>.*?</keyframe>", "", text)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def shipped_without_home(name):
    path = locate_robot(name)
    return homeless(path.read_text()), path.with_suffix(".toml").read_text()


@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "delta"])
def test_without_its_home_a_robot_that_is_drawn_open_is_asked_for_one(name, load_text):
    text, side = shipped_without_home(name)
    robot, other = Robot.load(name), load_text(text, sidecar=side)
    q = rng.uniform(*robot.limits.T, (200, len(robot.joints)))
    one, two = (complete_motion(r, np.arange(200.0), q, q, q) for r in (robot, other))
    np.testing.assert_array_equal(one.kept, two.kept)
    np.testing.assert_allclose(two.q, one.q, atol=1e-9)
    np.testing.assert_allclose(two.a, one.a, rtol=1e-6, atol=1e-6)
    assert other.identity["home"] == other.home_table
    assert "home" not in robot.identity


def test_a_home_that_was_computed_is_said_until_it_is_stated(load_text):
    text, side = shipped_without_home("3-rps")
    robot = load_text(text, sidecar=side)
    need = inspect(robot).needs[0]
    assert "robot.xml states no home position: the nearest one that closes its loops" in need.text
    assert need.text in inspect(robot, locate_robot("3-rps").parent / "logs" / "run1.csv").hints
    stated = load_text(text, sidecar=f"{side}\n{need.line}\n")
    np.testing.assert_allclose(stated.home, robot.home, atol=1e-5)
    assert not stated.describe_assembly()


@pytest.mark.parametrize(
    "name",
    [
        "five-bar",
        "delta",
    ],
)
def test_without_its_home_a_robot_of_several_assemblies_is_told_them(name, load_text):
    text, side = shipped_without_home(name)
    sentence = r"open by .* not determined \(\d+ that close them were found\); give .* \[home\]"
    with pytest.raises(RobotError, match=sentence) as told:
        load_text(text, sidecar=side)
    for way in str(told.value).partition("such as ")[2].split(" or "):
        home = "\n".join(way.removesuffix(".").split(", "))
        assert not load_text(text, sidecar=f"{side}\n[home]\n{home}\n").assembled
