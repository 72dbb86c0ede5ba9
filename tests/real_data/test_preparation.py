"""What real logs taught the preparation of samples, on synthetic signals."""

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, Preparation, Robot, prepare_samples
from identifiability.logs.prepare.plan import choose_rest_rule
from identifiability.logs.spectrum import Spectrum, choose_band

RATE = 500.0


def find_rests(q, dq):
    """Return where all joints stand still, (N,) bool."""
    rule = choose_rest_rule([q], [dq], 1 / RATE)
    return np.zeros(len(q), bool) if rule is None else rule.find(dq)


def stop_and_go(rest: float, joints: int = 2, seed: int = 0):
    """Two seconds of motion, a rest [s], two seconds of motion."""
    move = np.arange(0, 2, 1 / RATE)
    swing = np.stack([np.cos(2 * np.pi * (k + 1) * move) - 1 for k in range(joints)], 1)
    still = np.zeros((round(rest * RATE), joints))
    q = np.concatenate([swing, still, swing])
    q += 1e-6 * np.random.default_rng(seed).standard_normal(q.shape)
    return np.arange(len(q)) / RATE, q, np.gradient(q, 1 / RATE, axis=0)


def test_a_rest_is_found_and_reversals_are_none():
    _, q, dq = stop_and_go(rest=1.0)
    rest = find_rests(q, dq)
    assert 490 < rest.sum() <= 502
    assert rest[1010:1490].all()
    single = find_rests(q[:1000, :1], dq[:1000, :1])  # stands still at each reversal
    assert not single.any()


def test_a_stop_shorter_than_half_a_period_is_a_reversal():
    assert not find_rests(*stop_and_go(rest=0.1)[1:]).any()


def test_a_robot_that_never_moves_does_not_rest():
    assert not find_rests(np.ones((100, 2)), np.zeros((100, 2))).any()


def test_one_joint_at_rest_is_not_a_robot_at_rest():
    t, q, dq = stop_and_go(rest=1.0)
    q[:, 1], dq[:, 1] = np.sin(3 * t), 3 * np.cos(3 * t)
    assert not find_rests(q, dq).any()


@pytest.mark.parametrize(("keep", "fewest", "most"), [(False, 1990, 2015), (True, 2500, 2500)])
def test_rests_are_left_out_of_the_samples_unless_asked_for(keep, fewest, most):
    robot = Robot.load("two-link")
    t, q, _ = stop_and_go(rest=1.0)
    frame = {"t": t}
    for k, joint in enumerate(robot.joints):
        frame |= {f"{joint}.q": q[:, k], f"{joint}.tau": np.ones(len(t))}
    log = Log.from_frame(pd.DataFrame(frame))
    samples = prepare_samples(robot, log, Preparation(decimate=1, keep_rest=keep))
    assert fewest <= samples.outputs <= most
    assert len(samples.tau) == len(samples.motion) == len(samples.output_times())
    assert any("stand still" in note for note in samples.notes) != keep


def test_the_cut_off_is_ten_bandwidths_between_5_hz_and_a_fifth_of_the_rate():
    t = np.arange(0, 20, 1 / RATE)
    for hertz, cutoff in [(0.1, 5.0), (2.0, 20.0), (30.0, 100.0)]:
        q = np.sin(2 * np.pi * hertz * t)[:, None]
        band = choose_band([Spectrum.of([q], 1 / RATE)])
        assert band.cutoff == pytest.approx(cutoff, rel=0.05)
