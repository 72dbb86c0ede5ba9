"""A log that disagrees is found before effects are named: which, where, when."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Model, Preparation, Robot, diagnose, prepare_log
from identifiability.workflows.diagnose.naming import leave_out

QUICK = {"quick": True, "forward": False}
FEW = {"effects": ["joint_stiffness", "torque_offset", "position_ripple"], **QUICK}


def changed(log, since=0.0, size=0.5):
    """A log with more dry friction [N·m] in the elbow from a share of its time on."""
    more = size * np.tanh(20 * np.gradient(log.q[:, 1], log.t))
    late = log.t >= log.t[0] + since * np.ptp(log.t)
    return replace(log, tau=log.tau + np.outer(more * late, [0.0, 1.0]))


def test_a_log_of_another_robot_is_left_out_and_effects_are_named_from_the_others(logs_of, named):
    """Of two fitted logs nobody knows which is odd, and what is in all of them is an effect."""
    few = {**FEW, "effects": [*FEW["effects"], "coulomb_friction"]}
    logs = list(logs_of("two-link", "joint_stiffness@shoulder=0.04"))
    logs[1] = changed(logs[1])
    d = diagnose("two-link", logs[:4], logs[4:], **few)
    assert named(d) == [("joint_stiffness", ("shoulder",))]
    (change,) = d.changes
    assert (change.log, change.family, change.place) == (
        logs[1].name, "coulomb_friction", "elbow"
    )  # fmt: skip
    assert change.whole
    assert f" in all of {change.log}" in d.statement
    end = logs[0].t[-2]
    part = replace(change, log=logs[0].name, stop=end, ended=(end, end))
    assert leave_out(d.problem, part).changes[-1].whole  # the other rows are too few
    assert "N·m ± " in d.details.partition(f" in {logs[1].name}. The rows logged meanwhile")[0]
    assert [s.name for s in d.samples] == [log.name for log in (logs[0], *logs[2:4])]
    assert change.when in [table.rows[0][-1].text for table in d.tables()]
    assert d.to_dict()["roles"]["left_out"] == [logs[1].name]
    alone = diagnose("two-link", [logs[0], *logs[2:4]], logs[4:], **few)
    assert d.error_after == alone.error_after  # nothing of that log is in it
    assert not diagnose("two-link", logs[:2], logs[2], **few).changes
    assert not diagnose("two-link", [changed(log) for log in logs[2:]], logs[0], **few).changes


CHANGES = {"effects": ["payload", "coulomb_friction", "torque_offset"], **QUICK}


@pytest.fixture
def logs(logs_of):
    return list(logs_of("two-link")[:4])


def find_changes(logs):
    return diagnose("two-link", logs[:3], logs[3:], **CHANGES).changes


def gripped(log, since):
    """A log with a mass of .5 kg in the hand from a time on."""
    robot = Robot.load("two-link")
    effect = Model.of("payload@link2")
    motion = prepare_log(robot, log, Preparation(decimate=1)).motion
    phi = np.zeros(10)
    phi[:4] = 0.5, 0.05, 0.0, 0.025
    torque = effect.regressor(robot, motion) @ phi
    late = log.t >= log.t[0] + since
    own = np.stack([np.interp(log.t, motion.t, x) for x in torque.T], 1)
    return replace(log, tau=log.tau + own * late[:, None])


def test_a_mass_gripped_in_the_middle_of_a_log_is_told_with_its_instant_and_left_out(logs):
    since = 0.6 * np.ptp(logs[1].t)
    logs[1] = gripped(logs[1], since)
    d = diagnose("two-link", logs[:3], logs[3:], **CHANGES)
    (change,) = d.changes
    assert (change.log, change.family, change.place) == (
        logs[1].name,
        "payload",
        d.robot.bodies[-1],
    )
    assert change.began[0] <= logs[1].t[0] + since <= change.began[1]
    assert np.isinf(change.stop)
    assert abs(change.sizes[0] - 0.5) < 4 * change.sd[0] + 0.02
    assert not d.effects
    assert d.samples[1].motion.t.max() < logs[1].t[0] + since + 0.3
    assert change.called[1:] in d.details
    assert change.called.startswith("load of link2 grew by 0.")
    assert d.to_dict()["changes"][0]["from95"][0] == change.began[0]


@pytest.mark.parametrize("size", [0.5, 5.0])
def test_a_brake_that_drags_for_seconds_is_told_however_large(logs, size):
    """What a large one leaves in whatever it is not fitted to is no noise."""
    t = logs[2].t - logs[2].t[0]
    begin = 0.3 * t[-1]
    end = 0.6 * t[-1]
    more = size * np.tanh(20 * np.gradient(logs[2].q[:, 1], t)) * ((t > begin) & (t < end))
    logs[2] = replace(logs[2], tau=logs[2].tau + np.outer(more, [0.0, 1.0]))
    (change,) = find_changes(logs)
    assert (change.log, change.place) == (logs[2].name, "elbow")
    assert ("coulomb_friction", "elbow") in ((change.family, change.place), *change.rivals)
    assert abs(change.start - logs[2].t[0] - begin) < 0.7
    assert abs(change.stop - logs[2].t[0] - end) < 0.7


def test_logs_in_which_nothing_changes_say_nothing(logs):
    assert not find_changes(logs)


def test_friction_that_warms_up_through_a_session_is_no_change_at_an_instant(logs):
    begun = 0.0
    for k, log in enumerate(logs):
        t = log.t - log.t[0]
        dry = 0.3 * np.exp(-(begun + t) / 8) * np.tanh(20 * np.gradient(log.q[:, 1], t))
        logs[k] = replace(log, tau=log.tau + np.outer(dry, [0.0, 1.0]))
        begun += t[-1]
    assert not find_changes(logs)


def test_short_logs_of_two_parts_of_time_say_nothing(logs_of):
    """There is one way in which each may have changed, as a whole."""
    logs = [log.rows(0, len(log) // 6, log.name) for log in logs_of("two-link")[:4]]
    assert not find_changes(logs)
