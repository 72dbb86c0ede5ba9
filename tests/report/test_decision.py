"""The first screen: graded errors, trust, commands, and the robot drawn from its kinematics."""

import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.foundation.answers import Note
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.preparation import SettledPreparation
from identifiability.logs.spectrum import Band
from identifiability.regression.reduction import LadderEntry, LadderSource, ModelEntry
from identifiability.report import build_analysis_page, render_page
from identifiability.report.analysis import section_correlated
from identifiability.report.blocks import Trace
from identifiability.report.figures import order_correlated
from identifiability.report.skeleton import Part, draw_skeleton, trace_limbs
from identifiability.robot import Robot
from identifiability.workflows.answers import (
    answer_quality,
    answer_trust,
    grade_of,
    state_error,
    state_joints,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    ladder_option,
    name_logs,
    preparing_options,
    reading_options,
    source_name,
)
from identifiability.workflows.diagnose import result as missing
from identifiability.workflows.diagnose.findings import call
from identifiability.workflows.predict import correlation_of


@pytest.mark.parametrize(
    ("error", "grade"),
    [(0.03, "very-good"), (0.031, "good"), (0.15, "fair"), (0.16, "poor"), (0.51, "useless")],
)
def test_an_error_has_a_grade(error, grade):
    assert grade_of(error) == grade


def test_quality_names_the_best_and_the_worst_joint():
    answer = answer_quality(0.05, ("a", "b", "c"), np.array([0.04, 0.09, 0.02]), "another log")
    assert answer.short == "Good: relative validation error 5.00 %."
    assert "Each joint over its own variation: b 9 %, a 4 %, c 2 %." in answer.text
    assert answer.text.endswith("Measured on another log.")
    assert answer.tone == "green"


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note, warning = Note("note", "Small.", ""), Note("warning", "Grave.", "")
    assert answer_trust([note], "", 3, 4).short.startswith("Yes")
    assert "“Grave”" in answer_trust([note, warning], "", 3, 4).text
    assert answer_trust([note, warning], "", 3, 4).short == "With care."
    assert answer_trust([note], "nothing moved", 3, 4).short == "No."


def test_names_are_quoted_for_a_shell():
    robot = Robot.load("3-rps")
    assert source_name(robot) == "3-rps"
    assert name_logs(robot, ["run-1.csv"]) == "run-1.csv"
    assert shlex.split(name_logs(robot, ["my run's.csv", "b"])) == ["my run's.csv", "b"]


@pytest.mark.everything
def test_commands_stand_on_the_page_and_can_be_copied(paper_analysis):
    html = render_page(build_analysis_page(paper_analysis))
    export = r"identifiability export 3-rps analyze.json --out fitted.(xml|json)"
    made = r"identifiability analyze 3-rps [^\"]* --json analyze.json &amp;&amp; "
    assert re.search(f'data-copy="{made}{export}"', html)
    written = replace(paper_analysis)
    written.note_written("json", Path("mine.json"))
    html = render_page(build_analysis_page(written))
    assert 'data-copy="identifiability export 3-rps mine.json --out fitted.' in html


def test_limbs_go_from_joint_to_joint_and_close_loops():
    robot = Robot.load("five-bar")
    limbs, at = trace_limbs(robot, robot.home)
    ends = [lines[1] for body, lines in limbs.items() if "distal" in body]
    assert np.allclose(ends[0], ends[1], atol=1e-9)  # both end in the point where the loop closes
    assert np.allclose(limbs["left_proximal"][1], limbs["left_distal"][0])
    assert len(at) == len(robot.tree.joints)


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


def test_a_gap_breaks_a_trace_and_values_are_short():
    t = np.array([0.0, 0.1, 0.2, 5.0, 5.1])
    trace = Trace.of("a", "N", t, {"measured": np.arange(5) / 3}, 9)
    assert "null" in trace.data
    assert "0.33333" in trace.data
    assert "0.333333" not in trace.data


def test_correlated_parameters_stand_beside_each_other_and_others_are_left_out():
    correlation = np.eye(5)
    for a, b, rho in ((0, 3, -0.95), (1, 4, 0.8), (2, 3, 0.5)):
        correlation[a, b] = correlation[b, a] = rho
    assert order_correlated(correlation).tolist() == [0, 3, 1, 4]


def test_the_words_of_the_map_say_which_pair_and_its_sign():
    covariance = np.array([[4.0, -1.9, 0.0], [-1.9, 1.0, 0.0], [0.0, 0.0, 9.0]])
    assert np.isclose(correlation_of(covariance)[0, 1], -0.95)
    found = section_correlated(SimpleNamespace(covariance=covariance, names=("a", "b", "c")))
    assert "a and b (−0.95)" in found.lead
    apart = section_correlated(SimpleNamespace(covariance=np.eye(3), names=("a", "b", "c")))
    assert apart.blocks == ()
    assert apart.lead.startswith("None")


def test_statistics_in_detail_are_hidden_and_the_rest_is_short(chain_analysis):
    analysis = chain_analysis(["a", "b"], held=1)
    html = render_page(build_analysis_page(analysis))
    assert 'id="statistics"' in html
    for name in ("residuals", "full-model", "thresholds", "provenance"):
        assert f'<section id="{name}" class="detail">' in html
    assert '<section id="parameters">' in html


def test_a_body_is_as_good_as_its_best_parameter(paper_analysis):
    sketch = build_analysis_page(paper_analysis).summary[0].sketch
    best = {
        v.name.rpartition(".")[0]
        for v in paper_analysis.chosen.verdicts
        if v.verdict == "identifiable"
    }
    for owner in best:
        assert f'class="tone-blue" data-owner="{owner}"' in sketch.markup
    worse = replace(paper_analysis, selected=0)
    assert build_analysis_page(worse).summary[0].sketch.markup != sketch.markup


def test_parts_of_a_log_are_one_file_in_a_command(paper_analysis):
    (s,) = paper_analysis.samples
    parts = [replace(s, name=f"run.csv, part {k}", path="x/run.csv") for k in (1, 2)]
    other = replace(s, name="y/run.csv", path="y/run.csv")
    assert given_paths(parts) == ("x/run.csv", "x/run.csv")
    assert name_logs(paper_analysis.robot, given_paths(parts)) == "x/run.csv"
    assert held_back([*parts, other]) == " --validate x/run.csv --validate y/run.csv"
    assert held_back([*parts, other], parts[:1]) == " --validate y/run.csv"  # a part was set aside


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


def test_commands_prepare_logs_as_was_asked_and_name_every_log():
    robot = Robot.load("3-rps")
    how = Preparation(derivatives="butterworth", cutoff=7.5, decimate=2)
    asked = " --set derivatives=butterworth --set cutoff=7.5 --set decimate=2"
    assert preparing_options(how) == asked
    assert preparing_options(Preparation()) == preparing_options(None) == ""
    logs = [f"run {k}.csv" for k in range(5)]
    words = shlex.split(name_logs(robot, logs, "--start-from", how))
    assert words == [w for n in logs for w in ("--start-from", n)] + asked.split()


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


def test_where_loads_differ_each_joint_is_judged_by_its_own_error():
    joints, each = ("a", "b"), np.array([0.13, 0.22])
    judged, short, said = state_error(0.08, joints, each)
    assert 0.13 < judged < 0.22
    assert short.startswith("Poor: relative validation error 22.0 % (b) to 13.0 % (a)")
    assert "all together it is 8.00 %" in said
    assert state_error(0.12, joints, each)[0] == 0.12  # hardly below either
    assert state_error(0.05, joints, np.array([0.04, 0.3]))[1].startswith("Good, but not in b:")
    judged, short, said = state_error(0.15, joints, each)
    assert judged == 0.15
    assert short == "Fair: relative validation error 15.0 %."


def test_the_name_of_a_joint_stands_beside_its_dot_and_over_no_line():
    robot = Robot.load("six-dof-arm")
    parts = {joint: Part("blue", "") for joint in robot.joints}
    pose = robot.home + np.linspace(0.2, 0.9, len(robot.home))
    drawing = str(draw_skeleton(robot, pose, parts))
    names = re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*>([^<]+)</text>', drawing)
    assert sorted(n for *_, n in names) == sorted(robot.joints)
    limbs = re.findall(r'class="limb" d="([^"]+)"', drawing)
    ends = np.array([re.findall(r"[ML]([\d.]+) ([\d.]+)", p)[:2] for p in limbs], float)
    points = ends[:, :1] + np.linspace(0, 1, 20)[:, None] * (ends[:, 1:] - ends[:, :1])
    for x, y, name in names:
        room = np.array([6.2 * len(name), 13.0]) / 2
        away = np.abs(points - np.array([float(x), float(y) - 4]))
        assert not (away < room).all(-1).any(), name


@pytest.mark.parametrize(
    ("others", "said"),
    [((), "A"), (("b",), "A or B"), (("b", "c"), "A or one of 2 that look like it")],
)
def test_the_first_line_is_no_surer_than_the_name(others, said):
    assert call(["A", *(o.upper() for o in others)]) == said


def test_the_first_line_counts_places_once(monkeypatch):
    """Dry and viscous friction of one hinge are two placements at one place."""
    monkeypatch.setattr(missing, "headline", lambda _: "")
    places = ("a", "b", "c", "d")
    twice = tuple(SimpleNamespace(place=place) for place in (*places, *places))
    effect = SimpleNamespace(called="friction", alternatives=(), joints=places, placements=twice)
    said = missing._what(SimpleNamespace(changes=(), effects=(effect,))).short
    assert said == "Friction in a, b and 2 more."


def test_errors_of_joints_are_told_worst_first_where_that_of_all_hides_them():
    joints = tuple("abcdef")
    each = np.array([0.01, 0.05, 0.02, 0.03, 0.015, 0.012])
    told = state_joints(joints, each, 0.02)
    assert told == (
        "Each joint over its own variation: b 5 %, d 3 %, c 2 %, e 1.5 %, "
        "the other 2 at most 1.2 %."
    )
    assert state_joints(joints, np.full(6, 0.02), 0.02) == ""
    # Loads that differ: the torque of all varies more than that of any.
    assert state_joints(("a", "b"), np.array([0.10, 0.22]), 0.06).endswith("b 22 %, a 10 %.")
    assert state_joints(("a",), np.array([0.2]), 0.02) == ""
