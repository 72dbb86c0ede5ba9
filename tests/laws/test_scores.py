"""The scatter of scores is the standard deviation of the estimate, column by column."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import scatter_scores

from .numbers.made import ar1, gather

SAMPLES, BLOCK = 2400, 8


def columns():
    """A constant, a slow and a fast column: their scores remember differently long."""
    t = np.arange(SAMPLES)
    return np.stack([np.ones(SAMPLES), np.sin(0.02 * t), np.where(t % 2, 1.0, -1.0)], 1)


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=pytest.mark.everything), 0.8])
def test_each_column_gets_its_own(rho):
    rng, W, trials = np.random.default_rng(5), columns(), 300
    time = (1 + rho) / (1 - rho)
    values, claimed, white = [], [], []
    for _ in range(trials):
        noise = ar1(rng, rho, SAMPLES + 100)[100:]
        information = gather(W[:, None], W[:, None] @ [1.0, 2.0, 3.0] + noise, BLOCK)
        fit = estimate(information, "ols")
        values.append(fit.value)
        claimed.append(scatter_scores(information, fit, time).sd)
        white.append(fit.sigma)
    true = np.std(values, axis=0, ddof=1)  # known to 1/√600 = 4 %
    found = np.sqrt(np.mean(np.square(claimed), axis=0))
    np.testing.assert_allclose(found, true, rtol=0.16)
    if rho:  # one time for all columns would be wrong by these factors
        ratio = true / np.mean(white, axis=0)
        assert ratio[0] > 2.5
        assert ratio[2] < 0.5
