"""What noise remembers is found from blocks of time, and weighs: planted noise, known truth."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import t

from identifiability import estimate
from identifiability.estimation.estimate import estimate_noise, find_estimator
from identifiability.estimation.estimator import measure_memory, weigh
from identifiability.foundation.rounding import ENDS
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.physical.fitted_model import LeastSquares

from ...marks import everything
from .made import ar1, gather

#: (1 + ρ) / (1 - ρ) of ρ = .9.
SLOW = 19.0


def slow_columns(rng, samples, columns, actuators=2):
    """Sums of a few slow sines, (samples, actuators, columns): a motion excites like this."""
    time = np.linspace(0, 1, samples)[:, None, None, None]
    shape = (actuators, columns, 3)
    turns = rng.uniform(1, 25, shape)
    phase = rng.uniform(0, 7, shape)
    return np.sin(2 * np.pi * turns * time + phase).sum(-1)


def noise_of(rng, samples, *rho):
    return np.column_stack([ar1(rng, r, samples)[:, 0] for r in rho])


@pytest.mark.parametrize("size", [everything(3), 20, 100])
@pytest.mark.parametrize("logs", [(), (9000, 15_000)])
def test_times_are_those_of_the_noise_whatever_the_blocks(size, logs, rng):
    W = slow_columns(rng, 24_000, 3)
    tau = W @ [1.0, 2.0, 3.0] + noise_of(rng, 24_000, 0.9, 0.0) * [3.0, 1.0]
    fit = estimate(gather(W, tau, size, logs))
    assert_allclose(fit.times, [SLOW, 1.0], rtol=0.25)
    assert_allclose(fit.variance, [9.0, 1.0], rtol=0.15)
    assert_allclose(fit.weights[1] / fit.weights[0], 9 * SLOW, rtol=0.3)
    assert_array_equal(estimate(gather(W, tau, size, logs), "ols").times, fit.times)


def test_what_the_columns_swallow_is_counted():
    """Of 750 samples 30 slow columns take the slow noise first: what is left seems to forget."""
    rng = default_rng(1)
    seen = []
    left = []
    size = []
    for _ in range(30):
        W = slow_columns(rng, 750, 30, 1)
        noise = noise_of(rng, 750, 0.9)
        fit = estimate(gather(W, noise, 3))
        seen.append(fit.times[0])
        size.append([fit.rss[0] / 750, fit.variance[0]])
        left.append(autocorrelation_time(noise - W @ fit.value)[0])
    assert np.mean(left) < 0.6 * SLOW < 0.7 * SLOW < np.mean(seen) < 1.3 * SLOW
    swallowed, counted = np.mean(size, 0)
    assert swallowed < 0.6 < 0.8 < counted < 1.5


def test_slow_noise_of_one_actuator_is_not_taken_for_that_of_another():
    """All columns act at both; of large slow noise at the first they carry some to the second."""
    rng = default_rng(2)
    times = []
    for _ in range(20):
        W = slow_columns(rng, 750, 12)
        noise = noise_of(rng, 750, 0.98, 0.0)
        times.append(estimate(gather(W, noise * [5.0, 1.0], 3)).times)
    assert np.mean(times, 0)[0] > 30
    assert np.mean(times, 0)[1] < 1.3


def test_what_rounding_left_remembers_nothing():
    W = slow_columns(default_rng(3), 400, 3)
    fit = estimate(gather(W, W @ [1.0, 2.0, 3.0]))
    assert_array_equal(fit.times, 1.0)
    noise = measure_memory(gather(W, W @ [1.0, 2.0, 3.0]), fit)
    assert np.isfinite(noise.variance).all()
    assert_array_equal(noise.times, 1.0)


def test_times_that_do_not_differ_are_one_and_leave_the_weights_to_the_variances():
    rng = default_rng(7)
    W = slow_columns(rng, 1500, 4, 3)
    same = W @ np.ones(4) + noise_of(rng, 1500, 0.8, 0.8, 0.8) * [1.0, 2.0, 3.0]
    apart = W @ np.ones(4) + noise_of(rng, 1500, 0.8, 0.0, 0.0) * [1.0, 2.0, 3.0]
    one = estimate(gather(W, same, 6))
    own = estimate(gather(W, apart, 6))
    assert one.times[0] == pytest.approx(9.0, rel=0.4)
    assert_allclose(one.times, one.times[0], rtol=1e-12)
    assert_allclose(one.weights * one.variance, one.weights[0] * one.variance[0])
    assert own.times[0] > 5 > 2 > own.times[1:].max()


def test_white_deviations_stay_those_of_independent_residuals():
    """Weights by memory are not those of white noise: the covariance is the sandwich's."""
    rng = default_rng(4)
    W = slow_columns(rng, 4000, 3)
    tau = W @ [1.0, 2.0, 3.0] + noise_of(rng, 4000, 0.95, 0.0) * [1.0, 2.0]
    fit = estimate(gather(W, tau))
    G = np.einsum("tnk,tnl->nkl", W, W)
    bread = np.linalg.inv(np.tensordot(fit.weights, G, 1))
    scale = fit.weights @ fit.rss / ((4000 / fit.times).sum() - 3)
    white = bread @ np.tensordot(scale * fit.weights / fit.times, G, 1) @ bread
    assert_allclose(fit.covariance, white, rtol=1e-8)
    meat = np.tensordot(fit.weights**2 * [1.0, 4.0], G, 1)
    assert_allclose(fit.sigma, np.sqrt(np.diag(bread @ meat @ bread)), rtol=0.1)


@pytest.mark.parametrize("rho", [(0.0, 0.0), (0.9, 0.9), (0.98, 0.0)])
def test_the_posterior_covers_every_parameter_and_weights_do_no_harm(rho):
    """60 logs of 750 samples; limits are three Monte-Carlo errors below what the study finds."""
    rng = default_rng(6)
    W = slow_columns(rng, 750, 6)
    W[:, 0, :2] = W[:, 1, 2:4] = 0.0
    W[:, 0, 4] = 1.0  # an offset, which slow noise hurts most
    truth = np.arange(1.0, 7.0)
    trials = 60
    off = []
    held = []
    even = []
    flat = np.einsum("tnk,tnl->nkl", W, W)
    for _ in range(trials):
        tau = W @ truth + noise_of(rng, 750, *rho) * [2.0, 1.0]
        information = gather(W, tau, 3)
        fit = estimate(information)
        data = LeastSquares.likelihood(information, fit)
        sd = np.sqrt(data.variance * np.diag(np.linalg.inv(data.R.T @ data.R)))
        off.append(fit.value - truth)
        held.append(np.abs(off[-1]) < t.ppf(ENDS[1], data.dof) * sd)
        rest = np.einsum("tnk,tn->nk", W, tau - W @ truth)
        weights = [0.25, 1.0]  # by variance alone, known
        even.append(np.linalg.solve(np.tensordot(weights, flat, 1), weights @ rest))
    share = np.mean(held, 0)
    assert share.mean() > 0.92
    assert share.min() > 0.88 - 3 * np.sqrt(0.88 * 0.12 / trials)
    error = np.sqrt(np.mean(np.square(off), 0) / np.mean(np.square(even), 0))
    assert np.exp(np.log(error).mean()) < (0.85 if rho[1] < rho[0] else 1.03)


def test_a_model_that_leaves_a_constant_out_has_the_memory_of_the_whole_one():
    """What a model leaves out looks like noise that remembers for ever, and is none."""
    rng = default_rng(5)
    W = rng.normal(size=(400, 3, 5))
    W[:, :, 4] = [0.0, 0.0, 1.0]  # a constant torque at the last actuator
    tau = W @ [1.0, -1.0, 2.0, 0.5, 2.0] + rng.standard_normal((400, 3))
    whole = gather(W, tau, 2)
    small = whole.select([0, 1, 2, 3])
    own = find_estimator("wls").fit(small)
    settled = estimate_noise(find_estimator("wls"), whole).fit(small)
    assert own.times[2] > 20  # the model by itself takes it for slow noise,
    assert own.weights[2] < 0.1 * own.weights[0]  # and does not fit that actuator any more
    assert_allclose(settled.times, 1.0, atol=0.8)
    assert_allclose(settled.variance, [1.0, 1.0, 1.0 + 2.0**2], rtol=0.3)
    assert_allclose(settled.weights[2] / settled.weights[0], 1 / 5, rtol=0.4)


def test_an_actuator_that_a_model_cannot_explain_does_not_decide_what_others_need():
    """The quietest of three actuators has a torque that looks like what all three share."""
    rng = default_rng(9)
    off = {"settled": [], "noise alone": [], "own": []}
    for _ in range(40):
        W = rng.normal(size=(200, 3, 5))
        W[:, :2, 4] = 0.0
        W[:, 2, 4] += W[:, 2, :4] @ rng.normal(size=4) * 0.5
        noise = rng.standard_normal((200, 3)) * [1.0, 1.0, 0.2]
        whole = gather(W, W @ np.ones(5) + noise, 2)
        small = whole.select(range(4))
        wls = find_estimator("wls")
        known = estimate_noise(wls, whole)
        own = wls.fit(small)
        alone = replace(own, weights=weigh(whole, known.noise.variance * known.noise.times))
        off["settled"].append(known.fit(small).value - 1.0)
        off["noise alone"].append(wls.refit(small, alone, np.ones((1, len(whole.counts))))[0] - 1.0)
        off["own"].append(own.value - 1.0)
    error = {name: np.sqrt(np.mean(np.square(x))) for name, x in off.items()}
    assert error["settled"] < 0.7 * error["noise alone"]
    assert error["settled"] == pytest.approx(error["own"], rel=0.1)


def test_too_few_outputs_for_all_columns_say_nothing_of_the_noise():
    rng = default_rng(7)
    W = rng.normal(size=(30, 1, 12))
    whole = gather(W, W @ np.ones(12) + rng.standard_normal((30, 1)), 1)
    assert estimate_noise(find_estimator("wls"), whole).noise is None
    assert estimate_noise(find_estimator("wls"), whole.select(range(5))).noise is not None
