"""A closed chain whose files state no home: the same robot, or refused with the ways it closes."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import inspect
from identifiability.robot import complete_motion
from identifiability.robot.locate import locate_robot

from .made_robots import CLOSURES, parallelogram


def homeless(text):
    return re.sub(r"(?s)<keyframe>.*?</keyframe>", "", text)


@pytest.mark.parametrize("name", ["five-bar", "3-rrr", "delta"])
def test_without_its_home_a_robot_that_is_drawn_open_is_asked_for_one(name, load_text, rejected):
    path = locate_robot(name)
    side = path.with_suffix(".toml").read_text()
    with rejected(r"open by .* not determined; give .* \[home\]"):
        load_text(homeless(path.read_text()), sidecar=side)


def test_the_position_that_closes_a_drawing_is_used_and_said(load_text):
    text = parallelogram(CLOSURES["site on the root"])
    drawn = homeless(text)
    offset = np.array([0.6, -0.4, 0.5])
    for body, at in zip(("crank", "coupler", "rocker"), offset, strict=True):
        drawn = drawn.replace(f'<body name="{body}"', f'<body name="{body}" euler="0 {-at} 0"')
    robot = load_text(text)
    other = load_text(drawn)
    assert_allclose(other.home, [0.0, -0.2, 0.1], atol=1e-9)
    assert other.identity["home"] == other.home_table
    assert "home" not in robot.identity
    need = inspect(other).needs[0]
    assert "states no home position, so the one that closes its loops" in need.text
    stated = load_text(drawn, sidecar=f"{need.line}\n")
    assert_allclose(stated.home, other.home, atol=1e-5)
    assert not stated.describe_assembly()
    q = np.random.default_rng(11).uniform(0.2, 1.4, (100, 1))
    moved = [complete_motion(r, np.arange(100.0), x, q, q)
             for r, x in ((robot, q), (other, q - offset[0]))]  # fmt: skip
    assert_allclose(moved[1].q + offset, moved[0].q, atol=1e-9)


def test_positions_of_actuated_joints_that_a_sidecar_states_stay(load_text, rejected):
    text = homeless(parallelogram(CLOSURES["site on the root"]))
    for body, at in (("crank", 0.6), ("coupler", -0.5), ("rocker", 0.5)):
        text = text.replace(f'<body name="{body}"', f'<body name="{body}" euler="0 {-at} 0"')
    robot = load_text(text, sidecar="[home]\ndrive = 0.1")
    assert_allclose(robot.home, [0.1, -0.2, 0.2], atol=1e-9)
    with rejected(r"open by 0\.\d+ m .* such as knee = -0\.1000, heel"):
        load_text(text, sidecar="[home]\nknee = 1.0")
