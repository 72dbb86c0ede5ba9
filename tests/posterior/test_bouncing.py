import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtr, ndtri

from identifiability.posterior.exact import Cone, Flight, exit_through_rows, travel

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


def fly(flight):
    while not flight.advance():
        pass
    return flight


@pytest.mark.everything
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
        x, _ = travel(free, np.diag(sd[0]), x, mean, sd, rng)
    assert stats.kstest(((x - mean) / sd).ravel(), "norm").pvalue > 1e-3


@pytest.mark.parametrize("mean", [-6.0, -3.0, 0.0, 2.0])
def test_a_half_normal_has_its_closed_form_wherever_its_mean_is(mean, rng):
    wall, x = Cone(np.eye(1), np.zeros(1), rows=1), np.ones((4000, 1))
    for _ in range(40):
        x, _ = travel(wall, np.eye(1), x, np.full_like(x, mean), np.ones_like(x), rng)
    law = stats.truncnorm(-mean, np.inf, loc=mean)
    assert stats.kstest(x[:, 0], law.cdf).pvalue > 1e-3


def test_a_transition_can_be_taken_back(rng):
    # Reversed velocity, same time: every chain must come home, or detailed balance is lost.
    region = Cone(rng.normal(size=(3, 4)), np.ones(3), rows=3)
    x, root = np.zeros((200, 4)), rng.normal(size=(4, 4))
    mean, sd = rng.normal(size=(200, 4)), rng.uniform(0.5, 2, (200, 4))
    turn = rng.uniform(1, 2, 200)
    there = fly(Flight(region, root, x, mean, sd, rng.normal(size=x.shape), turn))
    push = np.linalg.solve(root, -there.v.T).T
    back = fly(Flight(region, root, there.x, mean, sd, push, turn))
    assert (there.x != x).all()
    np.testing.assert_allclose(back.x, x, atol=1e-9)
    np.testing.assert_allclose(back.energy() - back.start, there.start - there.energy(), atol=1e-9)


def test_the_first_exit_is_the_first_one_on_a_fine_grid(rng):
    y, dy = np.abs(rng.normal(size=(200, 4))), rng.normal(size=(200, 4))
    time, row = exit_through_rows(y, dy)
    for k in range(len(time)):
        falls = [-y[k, j] / dy[k, j] for j in range(4) if dy[k, j] < 0]
        assert time[k] == min(falls, default=np.inf)
        assert not falls or y[k, row[k]] + time[k] * dy[k, row[k]] == pytest.approx(0, abs=1e-12)


def test_a_start_outside_is_refused_with_the_reason(posteriors, rng):
    target, start = posteriors.sign_target(rng)
    start[1] = -0.5
    with pytest.raises(ValueError, match="not inside the physical set"):
        sample_exact(target, start, 10, rng)
