"""Roles: the motion that verifies is neither fitted nor used to choose."""

from dataclasses import replace

import pytest

from identifiability.foundation.errors import LogError
from identifiability.workflows import opening
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.diagnose.motion import SHORTEST, assign_roles


@pytest.fixture
def logs(logs_of):
    return logs_of("two-link")


def names(logs):
    return [log.name for log in logs]


def test_all_fitted_logs_are_fitted_and_all_held_out_ones_verify(logs):
    roles = assign_roles(logs[:3], logs[3:])
    assert names(roles.fit) == ["motion 1", "motion 2", "motion 3"]
    assert names(roles.verify) == ["motion 4", "motion 5"]
    assert roles.verified_on == "motion 4 and motion 5"


def test_without_held_out_logs_the_last_log_or_the_last_part_is_set_aside(logs):
    roles = assign_roles(logs[:3], [])
    assert names(roles.fit) == ["motion 1", "motion 2"]
    assert names(roles.verify) == ["motion 3"]
    assert "set aside" in roles.verified_on
    one = assign_roles(logs[:1], [])
    assert one.fit[0].t[-1] < one.verify[0].t[0]
    assert len(one.verify[0]) >= SHORTEST


def test_a_log_too_short_to_be_divided_is_refused_in_one_sentence(logs):
    short = logs[0].cut(0, len(logs[0]) // 5, "short")
    with pytest.raises(LogError, match="too few to name effects from one part and verify"):
        assign_roles([short], [])
    # As the only held-out log it verifies whole.
    assert assign_roles(logs[:1], [short]).verify == (short,)


def test_what_verifies_can_only_refute(logs_of, monkeypatch):
    """Law: the torque of a verifying log fits nothing and gives no name."""
    logs = logs_of("two-link", "joint_stiffness@elbow=0.05")
    spoiled = replace(logs[4], tau=-3.0 * logs[4].tau[::-1], sha256="")
    monkeypatch.setattr(opening, "check_held_out", lambda *_: None)
    known = ("joint_stiffness", "torque_offset", "free_spring", "stribeck_friction")
    few = {"effects": known, "quick": True, "forward": False}
    a, b, c = (
        diagnose("two-link", logs[:3], [last], **few)
        for last in (logs[4], replace(logs_of("two-link")[4], sha256=""), spoiled)
    )
    assert [e.name for e in a.effects] == ["joint_stiffness"]
    assert b.effects == ()
    assert {"joint_stiffness"} <= {e.name for e in b.refuted}
    assert {e.name for e in c.effects} <= {"joint_stiffness"}
    assert c.held_before > 10 * a.held_before
    kept = ["effect", "joint", "shape", "log_odds", "parameter", "value", "error"]
    other = diagnose("two-link", logs[:3], [replace(logs[3], sha256="")], **few)
    assert a.to_frame()[kept].equals(other.to_frame()[kept])
