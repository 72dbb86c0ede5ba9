"""What drifts from log to log is shown over the time of their session, where that is known."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, diagnose
from identifiability.simulation import Campaign, random_trajectory

NAME = "function_of_session_time"
#: What a drift resembles within each log, or in the mean.
EFFECTS = ("torque_offset", "torque_drift", "function_of_time", "joint_stiffness", NAME)

NOISE = Noise(additive=0.012, correlation=0.9)


def named(logs, **options):
    *fitted, last = logs
    return diagnose("two-link", fitted, last, effects=EFFECTS, forward=False, **options)


@pytest.mark.parametrize("count", [4, 6])
def test_a_robot_that_warms_is_shown_over_the_session_and_the_last_log_is_predicted(count):
    robot = Robot.load("two-link")
    rng = np.random.default_rng(1)
    session = Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(count)])
    logs = session.logs(["thermal_drift@elbow=0.1"], NOISE, rng)
    d = named(logs)
    (effect,) = d.effects
    assert (effect.name, effect.joints, effect.unnamed) == (NAME, ("elbow",), True)
    assert d.held_after < 0.9 * d.held_before
    assert "an unnamed function of the time of the session in elbow" in d.details.lower()
    (curve,) = d.curves
    ends = [log.start + log.t[-1] - logs[0].start for log in logs[:-1]]
    assert curve.against == "session"
    assert curve.x.max() == pytest.approx(ends[-1], abs=1.0)
    assert np.corrcoef(curve.x, curve.learned)[0, 1] ** 2 > 0.5
    assert d.predict(logs[-1]).error_ra == pytest.approx(d.held_after, rel=0.01)
    assert any("no clock tells" in hint for hint in d.predict(replace(logs[-1], start=None)).hints)


@pytest.mark.parametrize("told", ["one does not say", "two overlap"])
def test_where_logs_share_no_clock_the_session_is_not_asked_for(logs_of, told):
    logs = logs_of("two-link", "thermal_drift@elbow=0.1")
    without = [replace(log, start=None) for log in logs]
    if told == "one does not say":
        without = [*logs[:4], without[4]]
    if told == "two overlap":
        without = [*logs[:4], replace(logs[4], start=logs[3].start + 1.0)]
    d = named(without, quick=True)
    assert NAME not in {x.name for x in d.evidence}
    assert all("session" not in x.explained for x in d.discrepancies)


def test_the_zero_of_time_changes_no_answer(logs_of):
    drifting = logs_of("two-link", "friction_drift@elbow=0.3")
    early = [replace(log, start=None) for log in drifting]
    late = [replace(log, t=log.t + 1e5) for log in early]
    answers = []
    for logs in (early, late):
        d = diagnose("two-link", logs, effects=["friction_drift"], forward=False)
        found = d.effects[0].placements[0]
        fit = analyze("two-link", logs, quick=True).rows_by_name()
        answers.append([d.held_after, found.peak, *found.values, *(row.estimate for row in fit)])
    assert answers[1] == pytest.approx(answers[0], rel=1e-3)
