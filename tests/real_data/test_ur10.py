"""A UR10 that follows one exciting motion: friction that rises with speed in its shoulder pan."""

from dataclasses import replace

import pytest

from identifiability import Log, Robot, analyze, diagnose, predict

PAN = "shoulder_pan_joint"


@pytest.fixture
def robot(data):
    return Robot.load(data("unisa") / "ur10.urdf")


@pytest.fixture
def halves(data):
    """The two halves of the log."""
    log = Log.read(f"{data('unisa') / 'ur10_exciting.db3'}:/joint_states")
    half = len(log.t) // 2
    return [
        replace(log.rows(a, b, name), sha256=name)
        for a, b, name in ((0, half, "first"), (half, len(log.t), "second"))
    ]


@pytest.mark.everything
@pytest.mark.parametrize("back", [False, True], ids=["1 to 2", "2 to 1"])
def test_the_friction_of_the_pan_is_found_and_its_error_falls_on_the_other_half(
    robot, halves, back
):
    """Half a log is short, and the model misses much: what explains a little more is no rival."""
    fitted, unseen = halves[::-1] if back else halves
    d = diagnose(robot, [fitted], [unseen], forward=False)
    pan = [e for e in d.effects if PAN in e.joints]
    assert [e for e in pan if e.unnamed or "friction" in e.title]
    before, after = d.gap.joint_rms()[0, [0, -1]]
    assert after < 0.75 * before
    assert all("stood out from the fitted motion" in d.statement for _ in d.refuted)


@pytest.mark.everything
def test_names_of_half_a_log_alone_predict_the_other_half_better_than_analyze(robot, halves):
    """The torque of the shoulder would hide what a function does wrong in a wrist."""
    fitted, unseen = (replace(half, dq=None) for half in halves)
    results = analyze(robot, [fitted], replicates=0), diagnose(robot, [fitted], forward=False)
    without, named = (predict(robot, r, [unseen]).error_ra_raw for r in results)
    assert named < without
