"""Least squares corrected by what new noise does: the map, and what follows from it."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.bootstrap import bootstrap, scatter_scores
from identifiability.estimation.estimate import estimate
from identifiability.estimation.instrumental import InstrumentalVariables, RenoisedLeastSquares
from identifiability.estimation.least_squares import OrdinaryLeastSquares
from identifiability.estimation.uncertainty import resample
from identifiability.regression.information import Information

TRUTH = np.array([1.0, -2.0, 0.5, 3.0])
SIZE = np.array([0.3, 1.0])
RENOISED = RenoisedLeastSquares(OrdinaryLeastSquares())
MIX = np.eye(4) + 0.3 * np.ones((4, 4))
M = np.array([[1, 0], [1, 0], [0, 1.0], [0, 1.0]])


def planted(rng, samples=1200, noise=0.3, level=None):
    """Return noisy columns, torque, and the exact columns with new noise beside them."""
    level = noise * np.ones(4) if level is None else level
    exact = rng.normal(size=(samples, 2, 4)) @ MIX
    W, again = (exact + level * rng.normal(size=exact.shape) for _ in range(2))
    tau = exact @ TRUTH + SIZE * rng.normal(size=(samples, 2))
    return W, tau, exact, again


def compress(W, tau, exact, again, size=20):
    at = np.zeros(len(W), int)
    echo = Information.of_rows("abcd", exact, 0 * tau, at, len(W), again)
    return replace(Information.of_rows("abcd", W, tau, at, size), echo=echo)


@pytest.fixture
def rows():
    return planted(np.random.default_rng(5))


def flat(x):
    return x.reshape(-1, x.shape[2])


def shrinkage(exact, again, M=None):
    M = np.eye(4) if M is None else M
    return np.linalg.lstsq(flat(again) @ M, flat(exact) @ M, rcond=None)[0]


def test_values_are_those_that_noise_turns_into_least_squares(rows):
    W, tau, exact, again = rows
    information = compress(*rows)
    fit = RENOISED.fit(information)
    B = shrinkage(exact, again)
    plain = np.linalg.lstsq(flat(W), tau.ravel(), rcond=None)[0]
    np.testing.assert_allclose(fit.value, np.linalg.solve(B, plain), rtol=1e-8)
    np.testing.assert_allclose(fit.correction.least_squares, plain, rtol=1e-8)
    H = np.linalg.inv(B)
    of_plain = estimate(information, "ols").covariance
    np.testing.assert_allclose(fit.covariance, H @ of_plain @ H.T, rtol=1e-8)
    assert not len(fit.correction.bias)
    reduced = RENOISED.fit(information.reduce(M, "xy"))
    plain = np.linalg.lstsq(flat(W) @ M, tau.ravel(), rcond=None)[0]
    direct = np.linalg.solve(shrinkage(exact, again, M), plain)
    np.testing.assert_allclose(reduced.value, direct, rtol=1e-8)


def test_without_an_echo_it_is_least_squares(rows):
    information = replace(compress(*rows), echo=None)
    fit = RENOISED.fit(information)
    assert (fit.correction, fit.estimator.name) == (None, "ols")


def test_what_noise_drowns_stays_with_least_squares():
    level = np.array([0.1, 0.1, 0.1, 4.0])
    rows = planted(np.random.default_rng(6), level=level)
    fit = RENOISED.fit(compress(*rows))
    assert len(fit.correction.bias) == 1
    B = shrinkage(*rows[2:])
    everything = np.linalg.solve(B, fit.correction.least_squares)
    assert abs(fit.value[3]) < 0.5 * abs(everything[3])


@pytest.mark.parametrize("measured_again", [False, True])
def test_verdicts_hold_what_noise_drowns(measured_again):
    held, formula = [], []
    for seed in range(12):
        rng = np.random.default_rng([seed, 3])
        W, tau, exact, again = planted(rng, level=np.array([0.1, 0.1, 0.1, 4.0]))
        information, one = compress(W, tau, exact, again), RENOISED
        if measured_again:
            second = exact + [0.1, 0.1, 0.1, 4.0] * rng.normal(size=W.shape)
            information = Information.of_rows("abcd", W, tau, np.zeros(len(W), int), 20, second)
            one = InstrumentalVariables(OrdinaryLeastSquares())
        fit = one.fit(information)
        assert len(fit.correction.bias) == 1
        found = resample(information, fit, 1.0, rng, 50)
        held.append(np.abs(fit.value - TRUTH) <= 1.96 * found.robust)
        formula.append(found.scatter[3] < 0.2 * found.robust[3])
    assert np.mean(held) > 0.9
    assert all(formula)  # resampling keeps the bias


def test_a_fold_that_does_not_determine_all_is_corrected_in_what_it_does(rows):
    fit, (W, tau, exact, again) = RENOISED.fit(compress(*rows)), rows
    still = np.array([1, 1, 1, 0])  # one column says nothing there
    fold = compress(W * still, tau, exact * still, again * still)
    three = np.eye(4)[:, :3]
    B = RENOISED.map_noise(fold, fit)[:4, :4]
    np.testing.assert_allclose(B[:3, :3], shrinkage(exact, again, three), atol=1e-8)
    np.testing.assert_allclose(B[3], np.eye(4)[3], atol=1e-8)
    assert np.isfinite(RENOISED.loss(fold, fit)).all()


def test_refits_and_scores_follow_it(rows):
    W, tau, exact, again = rows
    information = compress(*rows)
    fit = RENOISED.fit(information)
    counts = np.random.default_rng(0).multinomial(60, np.full(60, 1 / 60), 3).astype(float)
    H = np.linalg.inv(shrinkage(exact, again))
    for row, found in zip(counts, RENOISED.refit(information, fit, counts), strict=True):
        w = np.sqrt(np.repeat(row, 40))
        plain = np.linalg.lstsq(w[:, None] * flat(W), w * tau.ravel(), rcond=None)[0]
        np.testing.assert_allclose(found, H @ plain, rtol=1e-8)
    plain = estimate(information, "ols")
    moved = RENOISED.influence(information, fit)
    direct = OrdinaryLeastSquares().influence(information, plain) @ H.T
    np.testing.assert_allclose(moved, direct, atol=1e-10)


def test_the_loss_is_least_at_the_fit_and_measures_in_its_covariance(rows):
    information = compress(*rows)
    fit = RENOISED.fit(information)
    F = RENOISED.loss(information, fit)
    assert np.allclose(np.tril(F, -1), 0)
    np.testing.assert_allclose(np.linalg.solve(F[:4, :4], F[:4, 4]), fit.value, rtol=1e-8)
    inverse = np.linalg.inv(F[:4, :4].T @ F[:4, :4])
    np.testing.assert_allclose(inverse / inverse[0, 0], fit.covariance / fit.covariance[0, 0],
                               rtol=1e-7)  # fmt: skip


def test_the_mean_of_many_estimates_is_the_truth_and_intervals_hold_it():
    trials, held, values, plain, means = 80, [], [], [], []
    for seed in range(trials):
        rng = np.random.default_rng([seed, 12])
        # The motion is the same; the echo knows it, not the noise.
        information = compress(*planted(rng, 480, 0.3), size=8)
        fit = RENOISED.fit(information)
        scores = scatter_scores(information, fit, 1.0)
        drawn = bootstrap(information, fit, rng, replicates=200)
        held.append(np.abs(fit.value - TRUTH) <= 1.96 * np.maximum(scores.widened, drawn.sd))
        means.append([scores.sd, drawn.sd])
        values.append(fit.value)
        plain.append(fit.correction.least_squares)
    values, plain = np.array(values), np.array(plain)
    error = values.std(0, ddof=1)
    off = np.abs(values.mean(0) - TRUTH)
    assert np.all(off < 5 * error / np.sqrt(trials))
    assert np.abs(plain.mean(0) - TRUTH).max() > 3 * plain.std(0).max()
    assert np.mean(held) > 0.95 - 4 * np.sqrt(0.95 * 0.05 / trials)
    for one in np.mean(means, 0):  # the noise of the echo is not in them
        assert np.all(one < error * (1 + 4 / np.sqrt(2 * trials)))
