"""Instrumental variables: what noise in the columns does, and what a second record mends."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Information, estimate
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.fit import bootstrap, scatter_scores, spread_of
from identifiability.estimation.noise import Noise
from identifiability.workflows.prune.elimination import Refits

TRUTH = np.array([1.0, -2.0, 0.5, 3.0])
SIZE = np.array([0.3, 1.0])
IV = Estimator(instruments=True)
#: With noise that is known to be white.
KNOWN = Estimator(instruments=True, noise=Noise(SIZE**2, np.ones(2)))
PLAIN = Estimator(weighted=False, instruments=True)


def planted(rng, samples=1200, noise=0.15, idle=False):
    """Return columns along a noisy motion and along a second record of it, and torque."""
    exact = rng.normal(size=(samples, 2, 4)) @ (np.eye(4) + 0.3 * np.ones((4, 4)))
    W, V = (exact + noise * rng.normal(size=exact.shape) for _ in range(2))
    if idle:  # a motion so small that each record is mostly noise
        exact[:, :, 3] *= 0.02
        for record in (W, V):
            record[:, :, 3] = exact[:, :, 3] + noise * rng.normal(size=exact.shape[:2])
    tau = exact @ TRUTH + SIZE * rng.normal(size=(samples, 2))
    return V, W, tau


def compress(V, W, tau, size=20):
    return Information.of_rows("abcd", W, tau, np.zeros(len(W), int), size, V)


@pytest.fixture
def rows():
    return planted(default_rng(5))


def weighted(fit, *arrays):
    """Return rows of all actuators, weighted."""
    root = np.sqrt(fit.weights)[:, None]
    wide = [x if x.ndim == 3 else x[:, :, None] for x in arrays]
    return [(root * x).reshape(-1, x.shape[2]) for x in wide]


def test_strong_instruments_solve_their_own_equations(rows):
    V, W, tau = rows
    fit = KNOWN.fit(compress(*rows))
    Z, X, y = weighted(fit, V, W, tau)
    assert_allclose(fit.value, np.linalg.solve(Z.T @ X, Z.T @ y)[:, 0], rtol=1e-9)
    assert not len(fit.bias)
    bread = np.linalg.inv(Z.T @ X)
    sigma2 = float(((y[:, 0] - X @ fit.value) ** 2).sum()) / fit.dof
    assert_allclose(fit.covariance, sigma2 * bread @ Z.T @ Z @ bread.T, rtol=1e-8)
    # What instruments leave more than least squares is noise.
    squares = replace(KNOWN, instruments=False).fit(compress(*rows))
    more = fit.variance - squares.variance
    assert (more > 0.001 * squares.variance).all()
    assert_allclose(more, (fit.rss - squares.rss) / len(W), rtol=1e-6)


def test_without_instruments_it_is_least_squares(rows):
    _, W, tau = rows
    information = Information.of_rows("abcd", W, tau, np.zeros(len(W), int), 20)
    fit = IV.fit(information)
    assert fit.bias is None
    assert fit.estimator.name == "wls"
    assert_array_equal(fit.value, estimate(information).value)


def test_what_is_not_determined_has_no_variance(rows):
    """The last two columns act alike."""
    V, W, tau = (x.copy() for x in rows)
    V[:, :, 3], W[:, :, 3] = V[:, :, 2], W[:, :, 2]
    assert np.isinf(IV.fit(compress(V, W, tau)).sigma).tolist() == [False, False, True, True]


@pytest.mark.parametrize("idle", [False, True])
@pytest.mark.parametrize("size", [3, 20])
def test_refits_are_those_of_the_rows(idle, size):
    V, W, tau = planted(default_rng(7), 240, idle=idle)
    information = compress(V, W, tau, size)
    fit = IV.fit(information)
    B = len(information.counts)
    counts = default_rng(0).multinomial(B, np.full(B, 1 / B), 4).astype(float)
    found = fit.estimator.refit(information, fit, counts)
    Z, X, y = weighted(fit, V, W, tau)
    Qz = np.linalg.qr(Z)[0]
    Qx = np.linalg.qr(X)[0]
    U, s, Yt = np.linalg.svd(Qz.T @ Qx)
    strong = s > 0.5
    T = np.column_stack([(Qz @ U)[:, strong], (Qx @ Yt.T)[:, ~strong]])
    for row, values in zip(counts, found, strict=True):
        w = np.repeat(np.repeat(row, size), 2)[:, None]
        direct = np.linalg.solve(T.T @ (w * X), T.T @ (w * y))[:, 0]
        assert_allclose(values, direct, rtol=1e-7)
    assert_allclose(fit.estimator.refit(information, fit, np.ones((1, B)))[0], fit.value, rtol=1e-9)


@pytest.mark.parametrize("idle", [False, True])
def test_the_loss_is_least_at_the_fit_and_measures_in_its_covariance(idle):
    information = compress(*planted(default_rng(5), idle=idle))
    fit = KNOWN.fit(information)
    F = fit.estimator.loss(information, fit)
    assert np.allclose(np.tril(F, -1), 0)
    assert_allclose(np.linalg.solve(F[:4, :4], F[:4, 4]), fit.value, rtol=1e-9)
    sigma2 = float(fit.weights @ fit.rss) / fit.dof
    assert_allclose(sigma2 * np.linalg.inv(F[:4, :4].T @ F[:4, :4]), fit.covariance, rtol=1e-8)
    assert F[4, 4] ** 2 == pytest.approx(float(fit.weights @ fit.rss))


def test_moments_refit_without_some_blocks(rows):
    information = compress(*rows)
    fit = IV.fit(information)
    R = fit.estimator.loss(information, fit)
    counts = np.ones((1, len(information.counts)))
    counts[0, ::5] = 0.0
    found = Refits.of(information, fit, R, counts)
    assert_allclose(found.grams[0], np.eye(4), atol=1e-9)
    assert_allclose(found.right[0] / R[4, 4], 0.0, atol=1e-9)
    y = found.centre + np.linalg.solve(found.grams[1], found.right[1])
    direct = fit.estimator.refit(information, fit, counts)[0]
    assert_allclose(
        np.linalg.solve(R[:4, :4], y), direct, atol=0.02 * np.abs(direct - fit.value).max()
    )


def faint(rng):
    """Return columns of which the last is a motion as large as its noise; V knows it by itself."""
    exact = rng.normal(size=(400, 2, 4))
    W = exact.copy()
    W[:, :, 3] += 1.2 * rng.normal(size=exact.shape[:2])
    return exact, W, exact @ TRUTH + SIZE * rng.normal(size=(400, 2))


def test_intervals_hold_what_weak_directions_leave_biased():
    trials = 40
    held = []
    for seed in range(trials):
        rows = planted(default_rng([seed, 17]), 400, idle=True)
        fit = PLAIN.fit(compress(*rows))
        held.append(np.abs(fit.value - TRUTH) <= 1.96 * fit.sigma)
    assert np.mean(held, 0).min() > 0.95 - 4 * np.sqrt(0.95 * 0.05 / trials)


def check_coverage(held):
    assert abs(np.mean(held) - 0.95) < 4 * np.sqrt(0.95 * 0.05 / len(held))


def test_intervals_hold_a_motion_that_is_half_noise():
    trials = 60
    held = []
    short = []
    for seed in range(trials):
        rng = default_rng([seed, 13])
        information = compress(*faint(rng), size=5)
        fit = IV.fit(information)
        drawn = spread_of(bootstrap(information, fit, rng, replicates=100))
        held.append(np.abs(fit.value - TRUTH) <= 1.96 * np.maximum(fit.sigma, drawn))
        plain = estimate(information)
        short.append(np.abs(plain.value - TRUTH) <= 1.96 * plain.sigma)
    check_coverage(held)
    assert np.mean(short, 0)[3] < 0.1


def test_the_mean_of_many_estimates_is_the_truth_and_intervals_hold_it():
    trials = 80
    held = []
    values = []
    plain = []
    means = []
    for seed in range(trials):
        rng = default_rng([seed, 11])
        information = compress(*planted(rng, 240, 0.2), size=4)
        fit = IV.fit(information)
        scores = scatter_scores(information, fit, 1.0)
        drawn = spread_of(bootstrap(information, fit, rng, replicates=200))
        robust = np.maximum(scores.widened, drawn)
        held.append(np.abs(fit.value - TRUTH) <= 1.96 * robust)
        means.append([fit.sigma, scores.sd, drawn])
        values.append(fit.value)
        plain.append(estimate(information).value)
    values = np.array(values)
    plain = np.array(plain)
    error = values.std(0, ddof=1)
    assert np.all(np.abs(values.mean(0) - TRUTH) < 4 * error / np.sqrt(trials))
    assert np.all(np.abs(plain.mean(0) - TRUTH).max() > 1.5 * plain.std(0).max())
    check_coverage(held)
    for one in np.mean(means, 0):  # by formula, by scores, by resampling
        assert_allclose(one, error, rtol=4 / np.sqrt(2 * trials))


def test_a_fold_that_does_not_determine_all_says_what_it_does():
    """A column that says nothing there has no weight, and ends in no traceback."""
    rng = default_rng(8)
    V = rng.standard_normal((300, 1, 3))
    W = V + 0.1 * rng.standard_normal(V.shape)
    tau = V @ np.array([1.0, 2.0, 3.0])
    fit = IV.fit(compress(V, W, tau))
    still = np.array([1.0, 1.0, 0.0])
    F = fit.estimator.loss(compress(V * still, W * still, tau), fit)
    assert np.isfinite(F).all()
    assert np.abs(F[:, 2]).max() < 1e-9 * np.abs(F[:, :2]).max()
