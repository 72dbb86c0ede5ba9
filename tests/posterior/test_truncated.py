import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

from identifiability.posterior.cone import Circles, Cone, exit_through_rows
from identifiability.posterior.exact import build_sampler
from identifiability.posterior.truncated import _State, travel

from .exactly import sample_exact


def gibbs(mean, precision, signs, chains, sweeps, rng):
    """Textbook Gibbs sampler of a Gaussian with signs: one truncated normal at a time."""
    x = np.abs(rng.normal(size=(chains, mean.size)))
    kept = []
    for sweep in range(sweeps):
        for j in range(mean.size):
            sd = precision[j, j] ** -0.5
            others = (x - mean) @ precision[j] - precision[j, j] * (x[:, j] - mean[j])
            centre = mean[j] - others / precision[j, j]
            low = ndtr(-centre / sd) if signs[j] else 0.0
            u = low + (1 - low) * rng.uniform(size=chains)
            x[:, j] = centre + sd * ndtri(np.clip(u, 1e-300, 1 - 1e-16))
        if sweep >= sweeps // 5:
            kept.append(x.copy())
    return np.array(kept).transpose(1, 0, 2)


def test_signs_agree_with_a_gibbs_sampler(posteriors, rng):
    target, start = posteriors.sign_target(rng, variance=1.0)
    draws = sample_exact(target, start, 300, rng, chains=128)
    precision = target.data.R.T @ target.data.R
    mean = np.linalg.solve(target.data.R, target.data.z)
    other = gibbs(mean, precision, target.region.nonnegative, 256, 1500, rng)
    assert (draws[..., :3] >= 0).all()
    # The signs matter here: without them the means would differ by many standard errors.
    centre, error = posteriors.standard_error(draws)
    assert (np.abs(centre - mean) / error).max() > 20
    posteriors.assert_same_distribution(draws, other)


def test_without_constraints_the_law_is_normal(rng):
    d, chains = 5, 4000
    free = Cone(np.zeros((0, d)), np.zeros(0), rows=0)
    mean, sd = rng.normal(size=d) * np.ones((chains, 1)), np.full((chains, d), 2.0)
    x = np.zeros((chains, d))
    for _ in range(8):
        x = travel(free, x, mean, sd, rng)
    assert stats.kstest(((x - mean) / sd).ravel(), "norm").pvalue > 1e-3


@pytest.mark.parametrize("mean", [-6.0, -3.0, 0.0, 2.0])
def test_a_half_normal_has_its_closed_form_wherever_its_mean_is(mean, rng):
    # At -3 a fixed quarter turn resonates with the bounces and needs a hundred transitions.
    wall, x = Cone(np.eye(1), np.zeros(1), rows=1), np.ones((4000, 1))
    for _ in range(40):
        x = travel(wall, x, np.full_like(x, mean), np.ones_like(x), rng)
    law = stats.truncnorm(-mean, np.inf, loc=mean)
    assert stats.kstest(x[:, 0], law.cdf).pvalue > 1e-3


def test_a_transition_can_be_taken_back(rng):
    # Reversed velocity, same turn: every chain must come home, or detailed balance is lost.
    region = Cone(rng.normal(size=(3, 4)), np.ones(3), rows=3)
    x = np.zeros((200, 4))
    mean, sd = rng.normal(size=(200, 4)), rng.uniform(0.5, 2, (200, 4))
    turn = rng.uniform(1, 2, 200)
    there = _State(region, x, mean, sd, rng.normal(size=x.shape), turn.copy())
    while not there.advance():
        pass
    back = _State(region, there.result(x), mean, sd, -there.v, turn.copy())
    while not back.advance():
        pass
    np.testing.assert_allclose(back.result(x), x, atol=1e-9)


def test_the_first_exit_is_the_first_one_on_a_fine_grid(rng):
    path = Circles(*rng.normal(size=(3, 200, 4)))
    inside = (path.centre + path.cosine > 0).all(axis=1)
    path = Circles(path.centre[inside], path.sine[inside], path.cosine[inside])
    time, row = exit_through_rows(path)
    grid = np.linspace(0, 2 * np.pi, 20_001)
    for k in range(len(time)):
        y = (
            path.centre[k]
            + np.outer(np.sin(grid), path.sine[k])
            + np.outer(np.cos(grid), path.cosine[k])
        )
        out = np.flatnonzero((y < 0).any(axis=1))
        if out.size:
            assert grid[out[0]] - time[k] == pytest.approx(0, abs=4e-4)
            assert y[out[0]].argmin() == row[k] or abs(y[out[0], row[k]]) < 1e-2
        else:
            assert time[k] > 2 * np.pi - 4e-4


def test_the_spread_does_not_depend_on_where_chains_start(posteriors, rng):
    target, start = posteriors.sign_target(rng, variance=1.0)
    far = start + np.array([30.0, 40.0, 50.0, 0, 0, 0])
    near = sample_exact(target, start, 200, rng, chains=64, warmup=30)
    away = sample_exact(target, far, 200, rng, chains=64, warmup=30)
    posteriors.assert_same_distribution(near, away)


def test_a_start_outside_is_refused_with_the_reason(posteriors, rng):
    target, start = posteriors.sign_target(rng)
    start[1] = -0.5
    with pytest.raises(
        ValueError, match=r"not inside the physical set. parameter 1 ≥ 0 does not hold"
    ):
        sample_exact(target, start, 10, rng)


def test_the_same_seed_gives_the_same_draws_and_the_global_state_is_not_touched(posteriors, rng):
    target, start = posteriors.sign_target(rng)
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    a, b = (sample_exact(target, start, 5, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_starts_are_spread_but_inside(posteriors, rng):
    target, start = posteriors.sign_target(rng)
    sampler = build_sampler(target)
    points = sampler.disperse(target.to_eta(start), 50, rng)
    assert sampler.contains(points).all()
    assert (points.std(axis=0) > 0).all()
