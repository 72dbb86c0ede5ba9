"""The first screen: graded errors, trust, commands, and the robot drawn from its kinematics."""

import re

import numpy as np
import pytest

from identifiability.foundation.answers import Note
from identifiability.report.skeleton import Part, draw_skeleton
from identifiability.robot import Robot
from identifiability.workflows.answers import answer_quality, answer_trust


def test_quality_names_the_best_and_the_worst_joint():
    answer = answer_quality(0.05, ("a", "b", "c"), np.array([0.04, 0.09, 0.02]), "another log")
    assert answer.short == "Good: relative validation error 5.00 %."
    assert "Each joint over its own variation: b 9 %, a 4 %, c 2 %." in answer.text
    assert answer.text.endswith("Measured on another log.")
    assert answer.tone == "green"


@pytest.mark.parametrize("name", ["3-rps", "six-dof-arm", "six-ups", "two-link"])
def test_every_body_and_joint_is_drawn_inside_the_picture(name):
    robot = Robot.load(name)
    parts = {owner: Part("blue", "all") for owner in (*robot.bodies, *robot.joints)}
    drawing = str(draw_skeleton(robot, robot.home, parts))
    owners = re.findall(r'data-owner="([^"]*)"', drawing)
    assert sorted(owners) == sorted((*robot.bodies, *robot.joints))
    paths = re.findall(r' d="(M[^"]*)"', drawing)
    numbers = [float(x) for p in paths for x in re.findall(r"[ML ](-?[\d.]+)", p)]
    assert min(numbers) >= 0
    assert max(numbers) <= 400


def test_a_name_cannot_leave_the_drawing():
    robot = Robot.load("two-link")
    evil = '"><script>x</script>'
    drawing = str(draw_skeleton(robot, robot.home, {robot.bodies[0]: Part("blue", evil)}))
    assert "<script" not in drawing


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note, warning = Note("note", "Small.", ""), Note("warning", "Grave.", "")
    assert answer_trust([note], "", 3, 4).short.startswith("Yes")
    assert "“Grave”" in answer_trust([note, warning], "", 3, 4).text
    assert answer_trust([note, warning], "", 3, 4).short == "With care."
    assert answer_trust([note], "nothing moved", 3, 4).short == "No."
