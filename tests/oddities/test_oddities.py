"""Where robot file, limits and physics contradict a log it is said, and nowhere else."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import scipy

from identifiability import analyze, diagnose, inspect, new_study, prune
from identifiability.estimation.verdict import Class
from identifiability.logs.prepare import prepare_log
from identifiability.quality import MeasuredLogs, find_oddities
from identifiability.quality.registry import CHECKS, ORDER, Does, check
from identifiability.quality.timing import measure_shift
from identifiability.regression.structure import Structure

from .conftest import MODEL, record


def test_a_good_log_is_not_spoken_of(say, good):
    assert say(*good) == ()


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "mN·m"), (1e-3, "kN·m"), (0.02, "")])
def test_torque_in_another_unit(say, good, factor, unit):
    structure, log = good
    (hint,) = say(structure, replace(log, tau=factor * log.tau))
    assert "what the robot file asks for" in hint
    assert "at all joints alike" in hint
    assert unit in hint
    guess = replace(structure.robot, guessed=structure.robot.bodies)  # of which nothing follows
    assert say(Structure.of(guess, MODEL), replace(log, tau=factor * log.tau)) == ()


def test_a_check_of_ones_own_is_one_function(six_axis):
    """What it says goes before what it explains; of columns that are misread it withholds more."""
    structure, log = six_axis
    turned = replace(log, tau=1000.0 * log.tau)
    logs = MeasuredLogs(structure, (turned,), (prepare_log(structure.robot, turned),))
    before = find_oddities(logs)
    assert before.explains
    assert not before.misread
    sound = MeasuredLogs(structure, (log,), (prepare_log(structure.robot, log),))
    for does, logs_, hints in (
        (Does.EXPLAINS, sound, ("Mine.",)),
        (Does.MISREADS, sound, ("Mine.",)),
        (Does.HINTS, logs, (*before.hints, "Mine.")),
        (Does.EXPLAINS, logs, before.hints),
    ):
        check("mine", does)(lambda _: ("Mine.",))
        own = next(c for c in CHECKS if c.key == "mine")
        try:
            found = find_oddities(logs_)
        finally:
            CHECKS.remove(own)
        assert found.hints == hints
        assert found.misread == (does is Does.MISREADS)
        assert found.explains == (does is not Does.HINTS or before.explains)
    assert [c.key for c in CHECKS] == list(ORDER)


def test_torque_that_stops_at_a_limit(say, good):
    structure, log = good
    top = 0.7 * np.abs(log.tau[:, 0]).max()
    tau = log.tau.copy()
    tau[:, 0] = np.clip(tau[:, 0], -top, top)
    hint = say(structure, replace(log, tau=tau))[0]
    assert f"'{log.joints[0]}.tau' stays at" in hint
    assert f"{top:.4g}" in hint


@pytest.mark.parametrize("channel", ["q", "tau"])
def test_a_column_that_hangs(say, good, channel):
    structure, log = good
    column = getattr(log, channel).copy()
    first = int(np.argmax(np.abs(column[60:] - column[:-60])[100:400, 0])) + 100
    column[first : first + 60, 0] = column[first, 0]
    hint = say(structure, replace(log, **{channel: column}))[0]
    assert f"of {log.joints[0]} in data rows {first + 1}–{first + 60} of {log.name}" in hint


def test_the_torque_of_one_joint_that_is_late_under_noise():
    """Noise of all joints together hides it from a search by whole samples."""
    structure, log = record("six-dof-arm")
    rng = np.random.default_rng(4)
    at = log.t[:, None] - np.where(np.arange(6) == 3, 1.5, 0.0) * np.median(np.diff(log.t))
    late = [np.interp(t, log.t, x) for t, x in zip(at.T, log.tau.T, strict=True)]
    tau = np.transpose(late) + 0.1 * log.tau.std(0) * rng.standard_normal(log.tau.shape)
    found = measure_shift(structure, prepare_log(structure.robot, replace(log, tau=tau)))
    assert found.certain
    assert found.joint == 3
    assert abs(found.samples - 1.5) <= 3 * found.sigma <= 0.75


@pytest.mark.parametrize("late", [0.5, -0.5])
@pytest.mark.parametrize("name", ["two-link", "six-dof-arm"])
def test_positions_that_are_half_a_sample_late_or_early(say, name, late):
    structure, log = record(name)
    at = log.t - late * np.median(np.diff(log.t))
    (hint,) = say(structure, replace(log, q=scipy.interpolate.CubicSpline(log.t, log.q)(at)))
    assert "apart in time" in hint
    assert ("early" if late > 0 else "late") + " beside the motion" in hint


@pytest.mark.parametrize(
    ("factor", "text"), [(-1.0, "wrong sign"), (180 / np.pi, "joint_2 seem to be degrees")]
)
def test_positions_of_one_joint_in_another_way(say, six_axis, factor, text):
    structure, log = six_axis
    scale = np.where(np.arange(6) == 1, factor, 1.0)
    hints = say(structure, replace(log, q=scale * log.q))
    assert text in hints[0]
    if factor > 1:
        assert "'joint_2.q' spans" in hints[1]
        assert "in degrees it would not" in hints[1]


def test_whole_turns_are_no_other_zero(say, six_axis):
    structure, log = six_axis
    turns = 2 * np.pi * np.array([0, 0, 0, 1, -3, 2])
    assert say(structure, replace(log, q=log.q + turns)) == ()
    (hint,) = say(structure, replace(log, q=log.q + np.array([0, 0, 1.5, 0, 0, 0])))
    assert "'joint_3.q' spans" in hint
    assert "Check the zero" in hint


def test_no_verdict_stands_where_positions_are_misread():
    structure, log = record("two-link", samples=900)
    misread = structure.robot, replace(log, q=log.q * [1.0, -1.0])
    analysis = analyze(*misread, replicates=10)
    for found in (analysis, prune(*misread, replicates=2)):
        assert "a column seems to have the wrong sign, unit or joint" in found.nothing
        assert any("elbow seem to have the wrong sign" in hint for hint in found.hints)
        assert found.statement.startswith("Nothing is identifiable, because a column seems")
    rows = [v for m in analysis.models for v in m.verdicts]
    assert {v.verdict for v in rows} == {Class.NOT_IDENTIFIABLE}
    assert diagnose(*misread, quick=True, forward=False).nothing


def test_one_joint_in_another_unit_is_named(tmp_path):
    """Its inertia hardly shows in its torque, so that only its friction, which is stated, tells."""
    folder = new_study(tmp_path / "study").folder
    log = pd.read_csv(folder / "run1.csv")
    assert not [h for h in inspect(folder / "robot.urdf", log).hints if "alone" in h]
    log["joint_6.tau"] *= 1e-3
    hints = inspect(folder / "robot.urdf", log).hints
    assert any("joint_6 alone" in hint and "kN·m" in hint for hint in hints)
