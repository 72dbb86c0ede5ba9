"""σ is that of scores, whatever resampling says beside it, and its terms add up."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from identifiability import Thresholds, estimate
from identifiability.estimation.fit import TERMS, Fit, ScoreScatter, spread_of
from identifiability.logs.spectrum import autocorrelation, autocorrelation_time

from .made import ar1, fit_known, fit_of, gather


def replicates(sd):
    """Return replicates whose central 68 % are exactly so far from zero."""
    unit = np.linspace(-1, 1, 5)
    return np.outer(unit / np.quantile(unit, norm.cdf(1)), sd)


def roads(white, resampled, scores):
    drawn = None if resampled is None else spread_of(replicates(resampled))
    white = np.array(white, float)
    estimate = fit_of(np.zeros(len(white)), white, np.isfinite(white))
    if scores is not None:
        scores = ScoreScatter(np.array(scores, float), np.array([1e6]))
    return fit_known(estimate, scores, bootstrap=drawn)


def test_the_robust_deviation_is_that_of_scores_whatever_resampling_says():
    assert_allclose(roads([9, 1], [3, 2], [2, 3]).robust, [2, 3], rtol=1e-5)
    assert_allclose(roads([1, 1], None, [1, 3]).robust, [1, 3], rtol=1e-5)
    assert_array_equal(roads([1, 1], [1, 3], None).robust, np.inf)
    assert_allclose(roads([1, np.inf], [3, 0], [1, 2]).robust, [1, np.inf], rtol=1e-5)


def test_a_log_of_few_memories_holds_the_truth_as_often_as_promised():
    """A log of 27 autocorrelation times: eight blocks of five are not there."""
    held = []
    drawn = []
    judged = 0
    N = 250
    rho = 0.8
    for rng in default_rng(3).spawn(50):
        t = np.arange(N) / N
        waves = [np.sin(2 * np.pi * (k + 1) * t + rng.uniform(0, 6)) for k in range(4)]
        W = np.stack([np.stack(waves, 1), np.stack(waves[::-1], 1) * [1, -1, 1, -1]], 1)
        tau = W @ np.ones(4) + ar1(rng, rho, N, 2)
        information = gather(W, tau, size=1)
        fit = estimate(information)
        found = Fit.of(information, fit, rng, 100)
        judged += not any(found.why_unjudged(Thresholds()))
        held.append(np.abs(fit.value - 1) <= 1.96 * found.robust)
        if found.bootstrap is not None:
            drawn.append(found.bootstrap / found.scores.sd)
    share = np.mean(held, axis=1)
    error = share.std(ddof=1) / np.sqrt(len(share))
    assert judged >= 45
    assert 0.8 < np.median(drawn) < 1.25  # resampling agrees
    assert 0.90 - 3 * error < share.mean()


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_the_autocorrelation_time_is_that_of_the_noise(rho):
    """(1 + ρ) / (1 - ρ); the estimate of 40,000 samples is within a fifth."""
    noise = ar1(default_rng(3), rho, 40_000, 2)
    assert_allclose(autocorrelation_time(noise), (1 + rho) / (1 - rho), rtol=0.2)
    acf = autocorrelation(noise)
    assert_allclose(acf[0], 1.0)
    assert_allclose(acf[1:4].mean(1), rho ** np.arange(1, 4), atol=0.03)


def test_noise_that_turns_back_does_not_count_as_less_than_white():
    turns = np.where(np.arange(100) % 2, 1.0, -1.0)[:, None]
    assert_array_equal(autocorrelation_time(turns), [1.0])


def test_the_interval_of_a_label_is_the_sum_of_its_terms():
    own = np.array([0.3, 0.4])
    shared = {"delay": np.array([[0.3, 0.0], [0.4, 0.0]])}
    found = fit_known(fit_of([1.0, 2.0], own), ScoreScatter(own, np.full(2, 1e9)), shared=shared)
    terms = found.terms
    assert set(terms) == set(TERMS)
    assert_allclose(terms["delay"], [0.5, 0.0])
    assert_allclose(found.robust, [np.hypot(0.3, 0.5), 0.4], rtol=1e-4)
    assert_allclose(found.sigma, found.robust)
