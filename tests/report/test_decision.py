"""The first screen: graded errors, trust, commands, and the robot drawn from its kinematics."""

import re
import shlex
import shutil
from dataclasses import replace

import numpy as np
import pytest

from identifiability.foundation.answers import Note
from identifiability.logs.prepare.preparation import SettledPreparation
from identifiability.logs.spectrum import Band
from identifiability.regression.reduction import LadderEntry, LadderSource, ModelEntry
from identifiability.report.skeleton import Part, draw_skeleton
from identifiability.robot import Robot
from identifiability.workflows.answers import answer_quality, answer_trust
from identifiability.workflows.commands import (
    ladder_option,
    preparing_options,
    reading_options,
    source_name,
)


def test_quality_names_the_best_and_the_worst_joint():
    answer = answer_quality(
        0.05, ("a", "b", "c"), np.array([0.04, 0.09, 0.02]), "Measured on another log."
    )
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


def test_commands_read_robot_and_logs_as_they_were_read(tmp_path):
    path = tmp_path / "two.xml"
    path.write_text(Robot.load("two-link").path.read_text())
    shutil.copy(Robot.load("two-link").sidecar, tmp_path / "two.toml")
    columns = {r"axis(\d)_pos": r"joint\1.q"}
    robot = Robot.load(path, lock=["elbow=0.5"], columns=columns, time_unit="ms", angles="deg")
    assert source_name(robot) == f"{path} --lock elbow=0.5"
    words = shlex.split(reading_options(robot))
    assert words == [
        *("--map", r"axis(\d)_pos=joint\1.q", "--set", "time_unit=ms", "--set", "angles=deg"),
    ]
    assert source_name(Robot.load("3-rps")) == "3-rps"
    assert reading_options(Robot.load("3-rps")) == ""


def test_a_cutoff_that_was_chosen_is_chosen_again():
    band = Band(
        cutoff=8.0,
        bandwidth=0.8,
        limit=20.0,
        noise=0.0,
        reason="it is",
        joints=np.array([0.8]),
        outputs=8.0,
    )
    chosen = SettledPreparation(cutoff=8.0, band=band)
    assert preparing_options(chosen) == ""
    assert preparing_options(replace(chosen, band=replace(band, reason=""))) == " --set cutoff=8"


def test_a_sidecar_and_a_ladder_are_named_where_they_do_not_lie_beside_the_robot(tmp_path):
    known = Robot.load("two-link")
    path, other = tmp_path / "two.xml", tmp_path / "other.toml"
    path.write_text(known.path.read_text())
    shutil.copy(known.sidecar, other)
    assert source_name(Robot.load(path, other)) == f"{path} --sidecar {other}"
    shutil.copy(known.sidecar, tmp_path / "two.toml")
    assert source_name(Robot.load(path)) == str(path)
    entry = LadderEntry(models=[ModelEntry(name="m")])
    robot = Robot.load(path)
    assert ladder_option(robot, LadderSource(entry, "pruned.toml", "")) == " --ladder pruned.toml"
    assert ladder_option(robot, LadderSource(entry, "default", "")) == ""
    assert ladder_option(robot, None) == ""


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note, warning = Note("note", "Small.", ""), Note("warning", "Grave.", "")
    assert answer_trust([note], "", 3, 4).short.startswith("Yes")
    assert "“Grave”" in answer_trust([note, warning], "", 3, 4).text
    assert answer_trust([note, warning], "", 3, 4).short == "With care."
    assert answer_trust([note], "nothing moved", 3, 4).short == "No."
