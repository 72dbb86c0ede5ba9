"""A UR10 that follows one exciting motion: friction that rises with speed in its shoulder pan."""

from dataclasses import replace

import pytest

from identifiability import Log, Robot, diagnose

PAN = "shoulder_pan_joint"


@pytest.mark.everything
@pytest.mark.parametrize("back", [False, True], ids=["1 to 2", "2 to 1"])
def test_the_friction_of_the_pan_is_found_and_its_error_falls_on_the_other_half(data, back):
    """Half a log is short, and the model misses much: what explains a little more is no rival."""
    folder = data("unisa")
    robot = Robot.load(folder / "ur10.urdf")
    log = Log.read(f"{folder / 'ur10_exciting.db3'}:/joint_states")
    half = len(log.t) // 2
    halves = [
        replace(log.rows(a, b, name), sha256=name)
        for a, b, name in ((0, half, "first"), (half, len(log.t), "second"))
    ]
    fitted, unseen = halves[::-1] if back else halves
    d = diagnose(robot, [fitted], [unseen], forward=False)
    pan = [e for e in d.effects if PAN in e.joints]
    assert [e for e in pan if e.unnamed or "friction" in e.title]
    before, after = d.gap.joint_rms()[0, [0, -1]]
    assert after < 0.6 * before
    assert all("stood out from the fitted motion" in d.statement for _ in d.refuted)
