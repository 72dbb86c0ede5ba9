"""Intervals of draws, from numbers alone."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from identifiability.workflows.analyze.belief import believed_interval


@pytest.mark.parametrize("truth", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("signed", [True, False])
def test_intervals_hold_the_truth_at_the_edge_of_the_possible_too(truth, signed):
    """A measurement of known error, flat prior, truncated normal posterior; 98 % at the edge."""
    best = truth + np.random.default_rng(0).standard_normal(1500)
    law = stats.truncnorm(-best, np.inf, loc=best)
    draws = law.ppf(np.linspace(0.0, 0.9999, 1000)[:, None])
    low, high = believed_interval(draws, np.full(1500, signed)).T
    held = np.mean((low <= truth) & (truth <= high))
    assert held == pytest.approx(0.977 if truth == 0 else 0.95, abs=0.025)
    assert_allclose(law.cdf(high) - law.cdf(low), 0.95, atol=2e-3)
    assert (high - low <= np.ptp(law.ppf([[0.025], [0.975]]), axis=0) + 1e-3).all()
