import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from identifiability.physical.fitted_model import LeastSquares
from identifiability.posterior.exact import build_sampler, interior
from identifiability.posterior.target import Prior, Target

from ..physical.bodies import without_bodies
from .conftest import assert_same_distribution, body_target
from .exactly import sample_exact


def free_target(rng, dof=12.0, **options):
    R = rng.normal(size=(5, 5)) + np.eye(5)
    data = LeastSquares(R, R @ rng.normal(size=5), 1.7 * dof, dof)
    region = without_bodies(np.zeros(5, bool))
    wide = Prior(np.zeros(5), np.full(5, 1e6))
    return Target(data, options.pop("prior", wide), region, **options)


def test_without_constraints_and_prior_it_is_the_textbook_student_t(rng):
    target = free_target(rng, dof=25.0)
    best = np.linalg.solve(target.data.R, target.data.z)
    nu = target.data.dof
    scale = target.data.variance * np.linalg.inv(target.data.R.T @ target.data.R)
    draws = sample_exact(target, best, 100, rng, chains=200)
    t = (draws[:, ::5] - best) / np.sqrt(np.diag(scale))
    for j in range(target.size):
        # One draw a chain is independent of the others.
        assert stats.kstest(t[:, -1, j], stats.t(nu).cdf).pvalue > 1e-3
    expected = rng.multivariate_normal(np.zeros(5), scale, (200, 100))
    expected *= np.sqrt(nu / rng.chisquare(nu, (200, 100, 1)))
    assert_same_distribution(draws, best + expected)


@pytest.mark.parametrize("variance", [None, 2.0])
def test_the_density_is_likelihood_times_prior(variance, rng):
    prior = Prior(rng.normal(size=5), rng.uniform(0.5, 2.0, 5))
    target = free_target(rng, prior=prior, variance=variance)
    phi = rng.normal(size=(40, 5))
    rss = target.data.rss(phi)
    nu = target.data.dof
    likelihood = -(nu + 5) / 2 * np.log(rss) if variance is None else -rss / (2 * variance)
    expected = likelihood - 0.5 * np.sum(((phi - prior.mean) / prior.sd) ** 2, axis=1)
    found = target.diagonal.log_density(target.to_eta(phi))
    assert_allclose(found - found[0], expected - expected[0], rtol=1e-9, atol=1e-9)


def test_what_the_data_do_not_see_keeps_its_prior(rng):
    R = np.array([[1.0, 1.0, 0.0]])
    data = LeastSquares(R, np.array([2.0]), 20.0, 20.0)
    region = without_bodies(np.zeros(3, bool))
    prior = Prior(np.array([0.0, 0.0, 5.0]), np.array([10.0, 10.0, 2.0]))
    draws = sample_exact(Target(data, prior, region), prior.mean, 200, rng, chains=100)
    expected = rng.normal(5.0, 2.0, (100, 200, 1))
    assert_same_distribution(draws[..., 2:], expected)
    assert np.std(draws[..., 0] + draws[..., 1]) < 0.2 * np.std(draws[..., 0])


def test_a_prior_around_a_rod_is_narrow_across_it():
    rod = np.array([1, 0, 0, 1, 0, 0, 0, 0, 0, 1.0])
    sd = Prior.around(rod, [range(10)], 1.0, rod).sd
    assert sd[6] < 0.1 * sd[8]


def test_what_rounding_takes_outside_is_inside_and_more_is_not(rng):
    target, truth = body_target(rng)
    sampler = build_sampler(target)
    edge = np.array(truth)
    edge[-1] = 0.0  # friction, which may not be negative
    for outside, inside in ((1.5e-14, True), (1e-6, False)):
        edge[-1] = -outside
        if inside:
            assert sampler.contains(interior(target, sampler, edge)[None])[0]
        else:
            with pytest.raises(ValueError, match="not inside the physical set"):
                interior(target, sampler, edge)
    body = np.array(truth)
    body[:10] = [1, 0, 0, 1, 0, 2 + 1.5e-14, 0, 0, 0, 1]  # a plane body: on the cone's edge
    assert sampler.contains(interior(target, sampler, body)[None])[0]
    body[5] = 2 + 1e-6
    assert not sampler.contains(target.to_eta(body)[None])[0]
