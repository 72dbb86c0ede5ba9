"""How far a posterior is the prior's density at the edge, against laws that are known exactly."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy import integrate, stats

from identifiability.physical.fitted_model import PhysicalSet
from identifiability.posterior.diagnostics import log_distances, measure_prior_sensitivity
from identifiability.posterior.rules import RULES as POSTERIOR_RULES

from ..physical.bodies import without_bodies

SIGNS = without_bodies([True, False])


def sway(draws):
    """Of draws (D, 2), the first of which may not be negative, as four ensembles."""
    chains = draws.reshape(4, 8, -1, 2)
    return measure_prior_sensitivity(chains, log_distances(SIGNS, chains))


def test_an_exponential_moves_by_half_of_its_sd():
    """Times the distance to a power ε it is a gamma law of mean 1 + ε."""
    rng = default_rng(0)
    x = rng.exponential(size=160_000)
    other = rng.standard_normal(160_000)
    assert_allclose(
        sway(np.column_stack([x, other])), [POSTERIOR_RULES.prior_power, 0.0], atol=0.015
    )
    # What goes with it moves with it, and half as far where half of its variance is its own.
    both = np.column_stack([x, x + other])
    assert_allclose(
        sway(both),
        [POSTERIOR_RULES.prior_power, POSTERIOR_RULES.prior_power / np.sqrt(2)],
        atol=0.015,
    )


@pytest.mark.parametrize("mean", [0.0, 1.0, 2.0, 5.0])
def test_a_truncated_normal_moves_as_its_mean_under_another_power(mean):
    law = stats.truncnorm(-mean, np.inf, loc=mean)
    eps = 1e-3

    def under(power):
        top, bottom = (
            integrate.quad(lambda x, k=k: law.pdf(x) * x ** (k + power), 0, mean + 10)[0]
            for k in (1, 0)
        )
        return top / bottom

    moved = POSTERIOR_RULES.prior_power * (under(eps) - under(-eps)) / (2 * eps) / law.std()
    draws = law.ppf(default_rng(1).uniform(size=(160_000, 2)))
    found = sway(draws)[0]
    assert found == pytest.approx(moved, abs=0.015)
    assert (found > POSTERIOR_RULES.prior_sensitivity) == (mean < 2.5)


def test_the_distance_of_a_body_is_its_determinant():
    """Of a body's pseudo-inertia: m³ times the volume of its ellipsoid, to scale."""
    one = PhysicalSet(np.arange(10)[None], np.zeros(10, bool))
    theta = np.array([0.17, 0.01, 0.0, 0.10, 0.0, 0.09, 0.1, 0.0, 0.0, 2.0])
    logs = log_distances(one, np.stack([theta, 2 * theta]))
    assert logs.shape == (2, 1)
    assert logs[1, 0] - logs[0, 0] == pytest.approx(4 * np.log(2))
    near = np.stack([theta, theta + 0.2 * np.eye(10)[6]])
    assert np.diff(log_distances(one, near)[:, 0])[0] < -0.5
