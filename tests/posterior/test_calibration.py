import numpy as np
import pytest
from scipy import stats

from .ranking import Calibration, calibrate_posterior


def assert_uniform(calibration):
    p = calibration.p_values()
    assert p.min() > 1e-3 / p.size
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("variance", [None, pytest.param(1.0, marks=pytest.mark.everything)])
def test_ranks_are_uniform_under_signs(variance, posteriors, rng):
    target, start = posteriors.sign_target(rng, size=8, signs=4, prior_sd=1.5, variance=variance)
    found = calibrate_posterior(target, start, rng, replicates=1000)
    assert found.ranks.shape == (1000, 8)
    assert_uniform(found)


def test_ranks_are_uniform_on_the_cone(posteriors, rng):
    target, start = posteriors.body_target(rng, spread=0.7)
    assert_uniform(calibrate_posterior(target, start, rng, replicates=400, draws=15))


def test_a_posterior_that_is_too_narrow_is_found_out(posteriors, rng):
    target, start = posteriors.sign_target(rng, size=4, signs=2, prior_sd=1.5, variance=1.0)
    right = calibrate_posterior(target, start, rng, replicates=1000)
    centred = (right.ranks - 15.5) * 1.4 + 15.5  # as if each sd were 1.4 times too small
    wrong = Calibration(np.clip(centred.round(), 0, 31).astype(int), 31)
    assert wrong.p_values().max() < 1e-3


def test_a_flat_prior_cannot_be_calibrated(posteriors, rng):
    target, start = posteriors.sign_target(rng)
    with pytest.raises(ValueError, match="the prior is flat for some parameters"):
        calibrate_posterior(target, start, rng)
