"""Roles: the motion that verifies is neither fitted nor used to choose."""

from dataclasses import replace

import pytest

from identifiability import diagnose
from identifiability.quality import recordings


def test_what_verifies_can_only_refute(logs_of, monkeypatch):
    """Law: the torque of a verifying log fits nothing and gives no name."""
    logs = logs_of("two-link", "joint_stiffness@elbow=0.05")
    spoiled = replace(logs[4], tau=-3.0 * logs[4].tau[::-1], sha256="")
    monkeypatch.setattr(recordings, "check_held_out", lambda *_: None)
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
    found, again = (d.to_frame(details=True)[kept] for d in (a, other))
    assert found.equals(again)


def test_what_predicts_worse_on_folds_is_said_and_in_no_model(logs_of, monkeypatch):
    monkeypatch.setattr("identifiability.workflows.diagnose.naming.Naming.predicts", False)
    *fitted, last = logs_of("two-link", "joint_stiffness@elbow=0.05")
    d = diagnose("two-link", fitted, last, effects=["joint_stiffness"], forward=False)
    assert [e.name for e in d.effects] == ["joint_stiffness"]
    assert d.fit.structure.model.texts == d.structure.model.texts
    assert d.held_after == pytest.approx(d.held_before, rel=1e-12)  # a sum in another order
    assert d.held_before > d.effects[0].after
