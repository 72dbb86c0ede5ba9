"""Where a joint stands its torque is no data; where it reverses it is, if no joint ever stands."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log, Model, Preparation, gather_information, prepare_log
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.regression.structure import Structure

RATE = 500.0
#: Errors of the records: none, an encoder, white noise.
ERRORS = {
    "none": lambda x, rng: x,
    "encoder": lambda x, rng: 1e-4 * np.rint(x / 1e-4),
    "noise": lambda x, rng: x + 3e-5 * rng.standard_normal(x.shape),
}


def stop_and_go(rest=0.6):
    """Return times (N,), the positions of a joint, and where it stands: a stop at each reversal."""
    move = np.arange(0, 0.8, 1 / RATE)
    still = round(rest * RATE)
    swing = 0.5 * (1 - np.cos(np.pi * move / 0.8))
    parts = [np.concatenate([s, np.full(still, s[-1])]) for s in (swing, swing[-1] - swing)] * 3
    stands = np.tile(np.arange(len(parts[0])) >= len(move), 6)
    q = np.concatenate(parts)
    return np.arange(len(q)) / RATE, q, stands


def swing(t):
    """Return the positions of a joint that never stands."""
    return 0.6 * np.sin(2 * np.pi * 0.9 * t)


def log_of(two, t, *q, **channels):
    frame = {"t": t}
    for kind, columns in {"q": q, "tau": np.add(q, 1.0), **channels}.items():
        frame |= {f"{j}.{kind}": x for j, x in zip(two.joints, columns, strict=True)}
    return Log.from_frame(pd.DataFrame(frame))


def samples_of(two, t, q, other, how=None, **channels):
    return prepare_log(two, log_of(two, t, q, other, **channels), how or Preparation())


def beside_turns(motion, reach):
    """Return the samples within some of where a speed crosses zero, (N, n) bool."""
    turns = np.sign(motion.actuated_v[1:]) != np.sign(motion.actuated_v[:-1])
    both = np.pad(turns, ((0, 1), (0, 0))).astype(float).T
    return np.stack([np.convolve(x, np.ones(2 * reach + 1), "same") > 0.5 for x in both], axis=1)


@pytest.mark.parametrize("error", ERRORS)
def test_beside_a_joint_that_stands_all_reversals_are_no_data(two, error):
    t, q, stands = stop_and_go()
    rng = default_rng(1)
    make = ERRORS[error]
    s = samples_of(two, t, make(q, rng), make(swing(t), rng))
    found, other = (s.weight == 0)[s.motion.kept].T
    reach = round(1.2 * RATE / s.cutoff)  # what the filters mix with a dwell, and a little more
    beside = np.convolve(stands, np.ones(2 * reach + 1), "same") > 0.5
    inside = np.convolve(~stands, np.ones(2 * reach + 1), "same") < 0.5
    assert found[inside].mean() > 0.98
    mixed = 2 * (round(0.5 * RATE / s.cutoff) - 2) + 1  # half a period of the cut-off on each side
    assert found[np.convolve(stands, np.ones(mixed), "same") > 0.5].mean() > 0.98
    assert not found[~beside].any()
    near = beside_turns(s.motion, round(np.ceil(0.5 * RATE / s.cutoff)))[:, 1]
    assert_array_equal(other, near)
    assert 0 < near.mean() < 0.2


def test_what_the_filters_mix_with_a_stop_on_the_way_is_no_data(two):
    """A joint that goes on as it came reverses nowhere."""
    t, q, stands = stop_and_go()
    onward = np.cumsum(np.abs(np.diff(q, prepend=0.0)))
    how = Preparation(cutoff=5.0)
    s = samples_of(two, t, onward, swing(t), how)
    mixed = 2 * (round(0.5 * RATE / s.cutoff) - 2) + 1
    near = np.convolve(stands, np.ones(mixed), "same") > 0.5
    assert near.sum() > stands.sum() + 5 * (mixed - 1)
    assert (s.weight == 0)[s.motion.kept][near, 0].mean() > 0.98


def test_reversals_are_data_where_no_joint_ever_stands(two):
    t = np.arange(0, 8, 1 / RATE)
    assert samples_of(two, t, *[0.6 * np.sin(2 * np.pi * f * t) for f in (0.7, 0.9)]).weight.all()


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_recorded_speeds_tell_without_positions(two, noise):
    t, q, stands = stop_and_go(1.5)
    rng = default_rng(2)
    both = np.stack([q, swing(t)])
    dq = np.gradient(both, t, axis=1)
    ddq = np.gradient(dq, t, axis=1)
    dq = dq + noise * dq.std(1, keepdims=True) * rng.standard_normal(dq.shape)
    s = samples_of(two, t, *both * (1 + 0.04 * rng.standard_normal(both.shape)), dq=dq, ddq=ddq)
    inside = np.convolve(~stands, np.ones(11), "same") < 0.5
    assert (s.weight == 0)[inside, 0].mean() > 0.98
    assert (s.weight == 0)[~stands, 0].mean() < 0.1
    assert (s.weight == 0)[:, 1][~beside_turns(s.motion, 1)[:, 1]].mean() < 0.01


def test_fourier_motion_has_no_dwells_whatever_its_errors(two):
    t = np.arange(0, 20, 0.01)
    rng = default_rng(3)
    w = 2 * np.pi * np.arange(1, 6) / 10
    shares = []
    masked = []
    for error in ERRORS.values():
        for _ in range(4):
            q = [np.sin(np.outer(t, w) + rng.uniform(0, 7, 5)) @ (1 / w) for _ in two.joints]
            s = samples_of(two, t, *(error(x, rng) for x in q))
            near = beside_turns(s.motion, 1) & (s.weight == 0)
            masked.append(near.sum() == beside_turns(s.motion, 1).sum())
            shares.append((s.weight == 0).mean())
    assert np.mean(shares) < 0.03  # of all reversals 5 % are so slow
    assert np.mean(masked) <= 0.25  # a twentieth of the motions, each told in two ways


def test_a_log_that_is_cut_in_two_has_the_same_data(two):
    t, q, _ = stop_and_go()
    t = np.arange(2 * len(t)) / RATE
    swings = [0.3 * np.sin(2 * np.pi * f * t + 0.3) for f in (0.7, 0.9)]
    swings[0][: len(q)] = q  # in the second half nothing stands
    whole = log_of(two, t, *swings)
    parts = [whole.rows(0, len(q)), whole.rows(len(q), len(t))]
    ways = [choose_cutoff(two, logs, Preparation(cutoff=8.0)) for logs in ([whole], parts)]
    one = prepare_log(two, whole, ways[0])
    first, second = (prepare_log(two, part, ways[1]) for part in parts)
    away = int(RATE)  # the filters of the parts end at the cut
    assert 0.01 < (one.weight == 0)[len(q) + away :].mean() < 0.5
    assert_array_equal(second.weight[away:], one.weight[len(q) + away :])
    assert_array_equal(first.weight[:-away, 1], one.weight[: len(q) - away, 1])


@pytest.mark.parametrize("decimated", [False, True])
def test_torque_of_a_dwelling_joint_is_in_no_row_and_that_of_others_is(two, decimated):
    t, q, _ = stop_and_go()
    structure = Structure.of(two, Model.of("rigid_body", "viscous_friction", "coulomb_friction"))
    rng = default_rng(4)
    found = []
    for size in (0.0, 50.0):
        s = samples_of(two, t, q, swing(t))
        tau = s.tau.copy()
        tau[:, 0] += size * (s.weight == 0)[:, 0] * rng.standard_normal(len(tau))
        assert s.decimation is not None
        s = replace(s, tau=tau) if decimated else replace(s, tau=tau, decimation=None)
        found.append(gather_information(structure.regression([s])))
    plain, spoilt = found
    assert_allclose(spoilt.factor(), plain.factor(), rtol=1e-9, atol=1e-9)
    moving, every = plain.data.sum(0)
    assert plain.samples >= every > moving > 0  # the other joint reverses, no more
    assert every > 0.95 * plain.samples
    assert plain.rows == moving + every


def test_a_joint_that_never_moves_says_nothing_and_nothing_fails(two):
    t = np.arange(0, 6, 0.01)
    s = samples_of(two, t, np.full(len(t), 0.3), swing(t))
    assert (s.weight == 0)[:, 0].all()
    assert not (s.weight == 0)[:, 1].any()
    assert s.survey.rows.tolist() == [0, s.outputs]
    assert any(f"{two.joints[0]} 100 %" in note for note in s.notes)
