"""Errors on motion that was not fitted, by hand: weights, folds, gains, intervals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.noise import ARNoise, JointNoise
from identifiability.workflows.diagnose.dictionary import Dictionary
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.held_out import HeldOut


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def data(rng, rows_of, n=240, log=None, noise=(0.1, 5.0)):
    """Two joints, the second fifty times as noisy; one model column, two of the dictionary."""
    X, D = rng.standard_normal((n, 2, 1)), rng.standard_normal((n, 2, 2))
    tau = X @ [2.0] + D @ [1.0, 0.0] + np.array(noise) * rng.standard_normal((n, 2))
    return rows_of(tau, X, D, log)


def solve(W, tau, weight=(1.0, 1.0)):
    w = np.array(weight)
    A = (W * w[:, None]).reshape(-1, W.shape[2])
    return np.linalg.lstsq(A, (tau * w).ravel(), rcond=None)[0]


def weighted(W, tau):
    """Least squares in units of each joint's own residual of plain least squares."""
    rms = np.sqrt(np.mean((tau - W @ solve(W, tau)) ** 2, axis=0))
    return solve(W, tau, 1 / rms)


def test_joints_weigh_by_the_residual_that_they_have_in_a_plain_fit(rng, rows_of, candidate):
    rows, c = data(rng, rows_of), [candidate("a", "j", 0)]
    W = np.concatenate([rows.X, rows.D.take([0])], axis=2)
    held = HeldOut(train=rows, choosing=None)
    np.testing.assert_allclose(held.fit(c), weighted(W, rows.tau), rtol=1e-9)
    others = np.arange(len(rows)) * 5 // len(rows) != 1
    expected = weighted(W[others], rows.tau[others])
    np.testing.assert_allclose(held.fit(c, 1), expected, rtol=1e-9)
    rms = np.sqrt(np.mean((rows.tau - W @ solve(W, rows.tau)) ** 2, axis=0))
    assert rms[1] > 20 * rms[0]
    exact = HeldOut(train=replace(rows, tau=W @ [1.0, 2.0]), choosing=None)
    np.testing.assert_allclose(exact.fit(c), [1.0, 2.0])  # no residual at all


def test_values_come_in_the_order_in_which_candidates_are_given(rng, rows_of, candidate):
    rows, a, b = data(rng, rows_of), candidate("a", "j", 0), candidate("b", "j", 1)
    held = HeldOut(train=rows, choosing=None)
    first, second = held.fit([a, b]), held.fit([b, a])
    np.testing.assert_allclose(second, first[[0, 2, 1]], rtol=1e-9)
    np.testing.assert_allclose(first[1:], [1.0, 0.0], atol=0.05)
    assert held.errors([b, a]) is held.errors([a, b])  # they are one model


def test_what_was_fitted_is_known_by_what_it_is_whatever_its_number(rng, rows_of, candidate):
    rows = data(rng, rows_of)
    turned = replace(rows, D=Dictionary.of(rows.D.take([1, 0])))
    before, fresh = HeldOut(train=rows, choosing=None), HeldOut(train=turned, choosing=None)
    again = HeldOut(train=turned, choosing=None)
    first, second = [candidate("a", "j", 0)], [candidate("a", "j", 1)]
    before.fit(first), before.errors(first)
    assert again.recall(before).fit(second) is before.fit(first)
    assert again.errors(second) is before.errors(first)
    np.testing.assert_allclose(fresh.fit(second), again.fit(second), rtol=1e-9)


def test_other_shapes_signs_and_folds_are_other_fits(rng, rows_of, candidate):
    held = HeldOut(train=data(rng, rows_of), choosing=None)
    one, other = (candidate("a", "j", k, shape=1.0 + k) for k in range(2))
    np.testing.assert_allclose(held.fit([one])[1], 1.0, atol=0.2)
    np.testing.assert_allclose(held.fit([other])[1], 0.0, atol=0.2)
    assert abs(held.fit([one], 0)[1] - held.fit([one])[1]) > 1e-6
    assert held.fit([replace(one, positive=True)]) is not held.fit(
        [one]
    )  # of a real robot it may be


def test_the_error_while_choosing_is_in_units_of_each_joint_without_candidates(
    rng, rows_of, candidate
):
    train, choosing, verifying = (data(rng, rows_of) for _ in range(3))
    held = HeldOut(train=train, choosing=choosing, verifying=verifying)
    c = [candidate("a", "j", 0)]
    W, U = (np.concatenate([r.X, r.D.take([0])], axis=2) for r in (train, choosing))
    scale = np.sqrt(np.mean((choosing.tau - choosing.X @ weighted(train.X, train.tau)) ** 2, 0))
    left = choosing.tau - U @ weighted(W, train.tau)
    np.testing.assert_allclose(held.errors(c), np.mean(np.abs(left) / scale, axis=1), rtol=1e-9)
    assert held.error(c) == pytest.approx(float(np.mean(np.abs(left) / scale)))
    # The motion that verifies has no say in it.
    spoiled = replace(held, verifying=replace(verifying, tau=1e6 + verifying.tau))
    np.testing.assert_array_equal(spoiled.errors(c), held.errors(c))
    assert spoiled.gap([c]).relative_error()[0] > 1.5 * held.gap([c]).relative_error()[0]


@pytest.mark.parametrize("logs", [1, 3])
def test_without_other_motion_logs_or_fifths_are_left_out_in_turn(rng, rows_of, candidate, logs):
    n = 240
    log = np.arange(n) * logs // n
    rows = data(rng, rows_of, n, log)
    held, c = HeldOut(train=rows, choosing=None), [candidate("a", "j", 0)]
    folds = log if logs > 1 else np.arange(n) * 5 // n
    W = np.concatenate([rows.X, rows.D.take([0])], axis=2)
    left, plain = np.empty((n, 2)), np.empty((n, 2))
    for fold in np.unique(folds):
        out = folds == fold
        left[out] = rows.tau[out] - W[out] @ weighted(W[~out], rows.tau[~out])
        plain[out] = rows.tau[out] - rows.X[out] @ weighted(rows.X[~out], rows.tau[~out])
    scale = np.sqrt(np.mean(plain**2, axis=0))
    np.testing.assert_allclose(held.errors(c), np.mean(np.abs(left) / scale, axis=1), rtol=1e-9)
    np.testing.assert_allclose(held.gap([c]).residual[:, :, 0], left, rtol=1e-9, atol=1e-12)


def test_a_gain_is_relative_and_its_error_is_that_of_24_stretches(rng, rows_of, candidate):
    train, choosing = (data(rng, rows_of, 250) for _ in range(2))
    held, c = HeldOut(train=train, choosing=choosing), [candidate("a", "j", 0)]
    before, after = held.errors([]), held.errors(c)
    means = [np.mean(p) for p in np.array_split(before - after, 24)]
    gain = held.gain([], c)
    assert gain.share == pytest.approx(1 - after.mean() / before.mean())
    assert gain.error == pytest.approx(np.std(means, ddof=1) / np.sqrt(24) / before.mean())
    assert held.gain(c, []).share == pytest.approx(-gain.share * before.mean() / after.mean())
    nothing = held.gain(c, c)
    assert (nothing.share, nothing.error) == (0.0, 0.0)


def test_a_fit_that_was_fitted_has_the_smallest_error_where_it_was_fitted(rng, rows_of, candidate):
    rows, c = data(rng, rows_of, noise=(1.0, 1.0)), [candidate("a", "j", 0)]
    held = HeldOut(train=rows, choosing=None)
    W = np.concatenate([rows.X, rows.D.take([0])], axis=2)
    left = rows.tau - W @ weighted(W, rows.tau)
    np.testing.assert_allclose(held.fitted_residual(c), left, atol=1e-9)
    assert np.sum(left**2) < np.sum(held.gap([c]).residual[:, :, 0] ** 2)


def rows_with(tau, **more):
    data = np.ones(tau.shape, bool)
    return SimpleNamespace(measured=tau, data=data, counts=data.sum(0), **more)


def test_the_relative_error_is_the_papers_sum_of_deviations_from_the_mean(rng, rows_of):
    tau = rng.standard_normal((50, 2)) + 3.0
    residual = rng.standard_normal((50, 2, 2))
    gap = Gap(rows=rows_with(tau), residual=residual)
    spread = np.abs(tau - tau.mean()).sum()
    expected = [np.abs(residual[:, :, k]).sum() / spread for k in range(2)]
    np.testing.assert_allclose(gap.relative_error(), expected)


def test_the_interval_of_a_change_is_that_of_whole_stretches_drawn_again(rng):
    """Errors that come in two long waves: far fewer independent numbers than rows."""
    n = 2400
    tau = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None]
    change = np.sign(np.sin(2 * np.pi * np.arange(n) / n))[:, None] * 0.2 - 0.1
    residual = np.stack([np.full((n, 1), 1.0), 1.0 + change], axis=2)
    gap = Gap(rows=rows_with(tau), residual=residual)
    low, high = gap.interval(0, 1, np.random.default_rng(0))
    parts = np.array([p.mean() for p in np.array_split(change, 24)])
    sd = np.std(parts) / np.sqrt(24)
    # The mean of 24 draws is close to normal; 2000 repetitions know a quantile to 5 %.
    assert low == pytest.approx(-0.1 - 1.96 * sd, abs=0.2 * sd)
    assert high == pytest.approx(-0.1 + 1.96 * sd, abs=0.2 * sd)
    assert gap.interval(0, 0, np.random.default_rng(0)) == (0.0, 0.0)
    back = gap.interval(1, 0, np.random.default_rng(0))
    np.testing.assert_allclose(back, (-high, -low), atol=1e-12)


def test_the_expected_change_is_that_of_torque_which_is_really_there(rng):
    """The first model misses what the second adds, beside noise that knows nothing of it."""
    n = 200_000
    tau, noise = rng.standard_normal((2, n, 2)) * [[[1.0, 30.0]]]
    added = np.column_stack([0.4 * rng.standard_normal(n), np.zeros(n)])
    gap = Gap(rows_with(tau), np.stack([noise + added, noise], axis=2))
    before, after = gap.error_over_joints()
    assert gap.expected_change(0, 1) == pytest.approx(after - before, rel=0.03)
    # An effect that is not there is expected to help as much, and does the opposite.
    wrong = Gap(rows_with(tau), np.stack([noise, noise - added], axis=2))
    before, after = wrong.error_over_joints()
    assert wrong.expected_change(0, 1) < 0 < after - before
    assert gap.expected_change(1, 1) == 0


def test_errors_of_the_raw_torque_hold_what_the_filter_took_away():
    rng = np.random.default_rng(3)
    tau, noise = rng.standard_normal((2, 50, 2))
    residual = 0.1 * rng.standard_normal((50, 2, 2))
    gap = Gap(rows=rows_with(tau, raw=tau + noise), residual=residual)
    raw = tau + noise
    left, own = residual[:, :, 1] + noise, raw - raw.mean(0)
    expected = np.sqrt((left**2).sum(0) / (own**2).sum(0))
    np.testing.assert_allclose(gap.joint_error(raw=True)[:, 1], expected)
    assert (gap.joint_error()[:, 1] < 0.3 * expected).all()


def slow_noise(rng, n, pacf=0.95):
    """Noise of two joints that remembers, and its model."""
    e = rng.standard_normal((n, 2))
    for k in range(1, n):
        e[k] += pacf * e[k - 1]
    joint = JointNoise(theta=np.array([np.arctanh(pacf)]), covariance=np.zeros((1, 1)), sigma=1.0,
                       dof=1e9, left=1 / (1 - pacf**2))  # fmt: skip
    return e, ARNoise((joint, joint))


def test_fits_weigh_rows_by_the_noise(rng, rows_of, candidate):
    """Generalised least squares by hand: V⁻¹ of AR(1) noise has three diagonals [Prais 1954]."""
    n, pacf = 200, 0.95
    e, noise = slow_noise(rng, n, pacf)
    rows = data(rng, rows_of, n, noise=(0.0, 0.0))
    rows, c = replace(rows, tau=rows.tau + e), [candidate("a", "j", 0)]
    W = np.concatenate([rows.X, rows.D.take([0])], axis=2)
    P = np.eye(n) - pacf * np.eye(n, k=-1)
    P[0, 0] = np.sqrt(1 - pacf**2)
    A, y = (np.concatenate([P @ M[:, j] for j in (0, 1)]) for M in (W, rows.tau[:, :, None]))
    held = HeldOut(train=rows, choosing=None, noise=noise)
    np.testing.assert_allclose(held.fit(c), np.linalg.lstsq(A, y[:, 0])[0], rtol=0.02)
    off, equal = (abs(h.fit(c) - [2.0, 1.0]).max() for h in (held, HeldOut(rows, None)))
    assert off < 0.6 * equal


def test_noise_weighs_unless_equal_weights_surely_predict_better(rng, rows_of):
    n = 600
    e, noise = slow_noise(rng, n)
    rows = data(rng, rows_of, n, noise=(0.0, 0.0))
    right = replace(rows, tau=rows.X @ [2.0] + e)
    assert HeldOut.weighed(right, None, None, None, noise).noise is noise
    # Slow torque, seen through columns that fast noise spoils: whitened rows have little but that.
    slow = np.sin(np.arange(n)[:, None] / 60 + [0.0, 1.0])
    spoilt = replace(rows, X=(slow + 0.3 * rng.standard_normal((n, 2)))[:, :, None], tau=30 * slow)
    quiet = ARNoise(tuple(replace(j, left=1e3) for j in noise.joints))
    assert HeldOut.weighed(spoilt, None, None, None, quiet).noise is None
