"""The scatter of scores is the standard deviation of the estimate, column by column."""

import numpy as np
import pytest
from scipy.signal import lfilter

from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import scatter_scores
from identifiability.regression.information import Information

SAMPLES, BLOCK = 2400, 8


def columns():
    """A constant, a slow and a fast column: their scores remember differently long."""
    t = np.arange(SAMPLES)
    return np.stack([np.ones(SAMPLES), np.sin(0.02 * t), np.where(t % 2, 1.0, -1.0)], 1)


def information_of(W, tau):
    return Information.of_rows("abc", W[:, None], tau[:, None], np.zeros(len(tau), int), BLOCK)


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=pytest.mark.everything), 0.8])
def test_each_column_gets_its_own(rho):
    rng, W, trials = np.random.default_rng(5), columns(), 300
    time = (1 + rho) / (1 - rho)
    values, claimed, white = [], [], []
    for _ in range(trials):
        noise = lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.standard_normal(SAMPLES + 100))[100:]
        information = information_of(W, W @ [1.0, 2.0, 3.0] + noise)
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
