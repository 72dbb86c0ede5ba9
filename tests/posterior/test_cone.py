import numpy as np
from arviz_stats.base import array_stats

from identifiability.physical.pseudo_inertia import margin
from identifiability.posterior.exact import build_sampler

from .conftest import assert_same_distribution, body_target
from .exactly import sample_exact


def rejection(target, rng):
    """Independent draws of a Gaussian posterior, those outside the set thrown away."""
    information = target.data.R.T @ target.data.R / target.variance
    precision = information + np.diag(target.prior.sd**-2)
    linear = target.data.R.T @ target.data.z / target.variance
    mean = np.linalg.solve(precision, linear + target.prior.mean * target.prior.sd**-2)
    root = np.linalg.cholesky(np.linalg.inv(precision))
    phi = mean + rng.standard_normal((400_000, mean.size)) @ root.T
    inside = (margin(phi[:, :10]) >= 0) & (phi[:, 10] >= 0)
    return phi[inside], inside.mean()


def test_one_body_agrees_with_rejection_sampling(rng):
    target, start = body_target(rng, spread=0.5, variance=1.0)
    exact = sample_exact(target, start, 150, rng, chains=100)
    free, share = rejection(target, rng)
    assert share < 0.3  # the cone matters
    count = len(free) // 100
    assert count > 50
    other = free[: 100 * count].reshape(100, count, -1)
    assert_same_distribution(exact, other)
    assert (margin(exact[..., :10]) >= 0).all()


def test_seven_bodies_forget_where_they_start_and_most_transitions_succeed(rng):
    target, start = body_target(rng, bodies=7, rows=35)
    sampler, centre = build_sampler(target).centred(target.to_eta(start))
    eta = sampler.disperse(centre, 64, rng)
    kept = []
    for step in range(30):
        new = sampler.step(eta, rng)
        assert (new != eta).any(axis=1).mean() > 0.6
        eta = new
        if step >= 10:
            kept.append(target.to_phi(eta))
    draws = np.array(kept).transpose(1, 0, 2)
    assert target.region.contains(draws).all()
    assert array_stats.rhat(draws, chain_axis=0, draw_axis=1).max() < 1.1
