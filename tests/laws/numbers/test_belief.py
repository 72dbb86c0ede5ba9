"""Priors around a robot and intervals of draws, from numbers alone."""

import numpy as np
import pytest
from scipy import stats

from identifiability.posterior.target import Prior
from identifiability.workflows.analyze.belief import believed_interval


def test_a_prior_around_a_robot_is_as_wide_as_its_bodies_are_large():
    """2 kg with second moments .01, .08 and .09 along the axes; others by their size."""
    theta = np.array([0.17, 0.01, 0.0, 0.10, 0.0, 0.09, 0.1, 0.0, 0.0, 2.0])
    phi = np.append(theta, [0.5, 0.0])
    prior = Prior.around(phi, np.arange(10)[None], 0.3, np.full(12, 7.0))
    np.testing.assert_allclose(prior.mean, phi)
    products = np.sqrt([0.01 * 0.08, 0.01 * 0.09, 0.08 * 0.09])
    np.testing.assert_allclose(prior.sd[[0, 3, 5]], 0.3 * theta[[0, 3, 5]])
    np.testing.assert_allclose(prior.sd[[1, 2, 4]], 0.3 * products)
    np.testing.assert_allclose(prior.sd[6:9], 0.3 * np.sqrt(2 * np.array([0.01, 0.08, 0.09])))
    np.testing.assert_allclose(prior.sd[9:], [0.3 * 2, 0.3 * 0.5, 7.0])


@pytest.mark.parametrize("truth", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("signed", [True, False])
def test_intervals_hold_the_truth_at_the_edge_of_the_possible_too(truth, signed):
    """A measurement of known error, flat prior, truncated normal posterior; 98 % at the edge."""
    rng = np.random.default_rng(0)
    best = truth + rng.standard_normal(1500)
    law = stats.truncnorm(-best, np.inf, loc=best)
    draws = law.ppf(np.linspace(0.0, 0.9999, 1000)[:, None])
    low, high = believed_interval(draws, np.full(1500, signed)).T
    held = np.mean((low <= truth) & (truth <= high))
    assert held == pytest.approx(0.977 if truth == 0 else 0.95, abs=0.025)
    np.testing.assert_allclose(law.cdf(high) - law.cdf(low), 0.95, atol=2e-3)
    assert (high - low <= np.ptp(law.ppf([[0.025], [0.975]]), axis=0) + 1e-3).all()
