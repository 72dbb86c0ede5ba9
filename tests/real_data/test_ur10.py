"""A UR10 that follows one exciting motion: friction that rises with speed in its shoulder pan."""

from dataclasses import replace

import pytest

from identifiability import Log, Robot, analyze, diagnose, predict

PAN = "shoulder_pan_joint"
pytestmark = pytest.mark.everything


@pytest.fixture
def robot(data):
    return Robot.load(data("unisa") / "ur10.urdf")


@pytest.fixture(params=[1, -1])
def halves(data, request):
    """The two halves of the log."""
    log = Log.read(f"{data('unisa') / 'ur10_exciting.db3'}:/joint_states")
    half = len(log.t) // 2
    parts = log.rows(0, half, "first"), log.rows(half, len(log.t), "second")
    return [replace(part, sha256=part.name) for part in parts[:: request.param]]


def test_the_friction_of_the_pan_is_found_and_its_error_falls_on_the_other_half(robot, halves):
    """Half a log is short, and the model misses much: what explains a little more is no rival."""
    fitted, unseen = halves
    d = diagnose(robot, [fitted], [unseen], forward=False)
    pan = [e for e in d.effects if PAN in e.joints]
    assert [e for e in pan if e.unnamed or "friction" in e.title]
    before, after = d.gap.joint_rms()[0, [0, -1]]
    assert after < 0.75 * before


def test_half_a_log_alone_predicts_the_other_half_no_worse_than_analyze(robot, halves):
    """The torque of the shoulder would hide what a function does wrong in a wrist."""
    fitted, unseen = (replace(half, dq=None) for half in halves)
    results = analyze(robot, [fitted], replicates=0), diagnose(robot, [fitted], forward=False)
    without, named = (predict(robot, r, [unseen]).error_ra_raw for r in results)
    assert named <= without
