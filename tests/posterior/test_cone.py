import numpy as np
import pytest
from arviz_stats.base import array_stats
from scipy.special import ndtr, ndtri

from identifiability.physical.pseudo_inertia import margin, to_matrix
from identifiability.posterior.exact import TRIANGLE, Cone, Flight, build_sampler, positive

from .exactly import sample_exact


def rejection(target, count, rng):
    """Independent draws of a Gaussian posterior, those outside the set thrown away."""
    information = target.data.R.T @ target.data.R / target.variance
    precision = information + np.diag(target.prior.sd**-2)
    linear = target.data.R.T @ target.data.z / target.variance
    mean = np.linalg.solve(precision, linear + target.prior.mean * target.prior.sd**-2)
    root = np.linalg.cholesky(np.linalg.inv(precision))
    phi = mean + rng.standard_normal((count, mean.size)) @ root.T
    inside = (margin(phi[:, :10]) >= 0) & (phi[:, 10] >= 0)
    return phi[inside], inside.mean()


def hit_and_run(target, start, chains, steps, rng):
    """Second sampler of the cone: random lines, with the exact chord from 4×4 eigenvalues."""
    sd = target.prior.sd
    gain, centre = target.data.R * sd, (target.prior.mean - 0) / sd
    precision = gain.T @ gain / target.variance + np.eye(sd.size)
    mean = np.linalg.solve(precision, gain.T @ target.data.z / target.variance + centre)
    root = np.linalg.cholesky(np.linalg.inv(precision))
    x = np.repeat((start / sd)[None], chains, axis=0)
    kept = []
    for step in range(steps):
        d = rng.standard_normal(x.shape) @ root.T
        J, D = (to_matrix((y * sd)[:, target.region.bodies]) for y in (x, d))
        L = np.linalg.cholesky(J)
        half = np.linalg.solve(L, D)
        turn = np.linalg.eigvalsh(np.linalg.solve(L, half.transpose(0, 1, 3, 2)))
        rates = np.concatenate([turn.reshape(chains, -1), d[:, -1:] / x[:, -1:]], axis=1)
        high = -1 / np.minimum(rates.min(axis=1), -1e-300)
        low = -1 / np.maximum(rates.max(axis=1), 1e-300)
        weight = np.einsum("ki,ij,kj->k", d, precision, d)
        best = -np.einsum("ki,ij,kj->k", d, precision, x - mean) / weight
        a, b = ((end - best) * np.sqrt(weight) for end in (low, high))
        u = ndtr(a) + rng.uniform(size=chains) * (ndtr(b) - ndtr(a))
        move = best + ndtri(np.clip(u, 1e-300, 1 - 1e-16)) / np.sqrt(weight)
        x = x + np.clip(move, 0.999999 * low, 0.999999 * high)[:, None] * d
        if step >= steps // 4 and step % 5 == 0:
            kept.append(x * sd)
    return np.array(kept).transpose(1, 0, 2)


def test_one_body_agrees_with_rejection_sampling(posteriors, rng):
    target, start = posteriors.body_target(rng, spread=0.5, variance=1.0)
    exact = sample_exact(target, start, 150, rng, chains=100)
    free, share = rejection(target, 400_000, rng)
    assert share < 0.3  # the cone matters
    count = len(free) // 100
    assert count > 50
    other = free[: 100 * count].reshape(100, count, -1)
    posteriors.assert_same_distribution(exact, other)
    assert (margin(exact[..., :10]) >= 0).all()


@pytest.mark.everything
def test_two_bodies_agree_with_hit_and_run(posteriors, rng):
    target, start = posteriors.body_target(rng, bodies=2, rows=9, variance=1.0)
    exact = sample_exact(target, start, 120, rng, chains=100)
    other = hit_and_run(target, start, 200, 1800, rng)
    posteriors.assert_same_distribution(exact, other)


def test_seven_bodies_forget_where_they_start_and_most_transitions_succeed(posteriors, rng):
    target, start = posteriors.body_target(rng, bodies=7, rows=35)
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


def test_far_from_the_boundary_the_cone_changes_nothing(posteriors, rng):
    target, start = posteriors.body_target(rng, spread=1e-3, variance=1.0)
    exact = sample_exact(target, start, 150, rng, chains=100)
    free, share = rejection(target, 100_000, rng)
    assert share == 1.0
    posteriors.assert_same_distribution(exact, free.reshape(100, -1, 11))


def test_the_first_exit_is_the_first_one_on_a_fine_grid(rng):
    cone = Cone(np.eye(12), np.zeros(12), rows=2)
    root = rng.normal(size=(300, 4, 4))
    root[:100, :, 0] = 0.0  # a third starts on the boundary
    J = root @ root.transpose(0, 2, 1)
    y = np.column_stack([rng.uniform(0, 1, (300, 2)), J[:, *np.triu_indices(4)]])
    dy = rng.normal(size=y.shape)
    dy[:100, [2, 6, 9, 11]] += 3.0
    time, hit, inward = cone.first_exit(y, dy, np.full(300, 2.3))
    grid = np.linspace(0, 2.3, 4001)[1:]
    for k in range(300):
        out = np.flatnonzero(~cone.contains(y[k] + np.outer(grid, dy[k])))
        assert hit[k] == (out.size > 0) or out[0] >= 3998
        if hit[k]:
            assert grid[out[0]] - time[k] == pytest.approx(0, abs=1e-3)
            assert inward[k] @ dy[k] < 0
            edge = to_symmetric(y[k] + time[k] * dy[k])
            assert np.linalg.eigvalsh(edge)[0] == pytest.approx(0, abs=1e-12) or inward[k, :2].any()
    assert 50 < hit.sum() < 300


def to_symmetric(y):
    return y[2:][TRIANGLE]


def test_the_barrier_has_the_slope_and_the_bend_of_its_differences(posteriors, rng):
    target, start = posteriors.body_target(rng, bodies=2, rows=9, variance=1.0)
    region, eta = build_sampler(target).region, target.to_eta(start)
    value, slope, root = region.barrier(eta)
    y = region.offset + region.map @ eta
    J = np.array([y[1 + 10 * k : 11 + 10 * k][TRIANGLE] for k in range(2)])
    assert value == pytest.approx(-np.log(y[0]) - np.linalg.slogdet(J)[1].sum())
    for j, step in enumerate(1e-5 * np.eye(len(eta))):
        up, down = region.barrier(eta + step), region.barrier(eta - step)
        assert slope[j] == pytest.approx((up[0] - down[0]) / 2e-5, rel=1e-4, abs=1e-4)
        np.testing.assert_allclose(
            root.T @ root[:, j], (up[1] - down[1]) / 2e-5, rtol=1e-3, atol=1e-3
        )
    assert region.barrier(eta + 1e6)[0] == np.inf


def test_a_transition_can_be_taken_back(posteriors, rng):
    target, start = posteriors.body_target(rng, bodies=2, rows=9, variance=1.0)
    sampler, centre = build_sampler(target).centred(target.to_eta(start))
    x = np.repeat(centre[None], 60, axis=0)
    mean, sd = sampler.model.conditional(np.ones(60))
    turn = rng.uniform(1, 2, 60)
    there = Flight(sampler.region, sampler.root, x, mean, sd, rng.normal(size=x.shape), turn)
    while not there.advance():
        pass
    push = np.linalg.solve(sampler.root, -there.v.T).T
    back = Flight(sampler.region, sampler.root, there.x, mean, sd, push, turn)
    while not back.advance():
        pass
    np.testing.assert_allclose(back.x, x, atol=1e-6)


def test_pivots_tell_positive_definite_matrices(rng):
    root = rng.normal(size=(500, 4, 4))
    J = root @ root.transpose(0, 2, 1) - rng.exponential(0.2, (500, 1, 1)) * np.eye(4)
    expected = np.linalg.eigvalsh(J)[:, 0] > 0
    assert 50 < expected.sum() < 450
    np.testing.assert_array_equal(positive(J), expected)
