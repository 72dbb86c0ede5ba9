import numpy as np
import pytest
from numpy.testing import assert_array_equal

from identifiability.posterior.diagnostics import diagnose_convergence
from identifiability.posterior.ensemble import ROUND, sample_posterior
from identifiability.posterior.rules import Thresholds

from .conftest import assert_same_distribution, body_target, sign_target
from .exactly import sample_exact


def chains(posterior):
    return posterior.draws.reshape(-1, *posterior.draws.shape[2:])


@pytest.mark.parametrize("kind", ["signs", "cone"])
def test_emcee_and_the_exact_sampler_agree_and_few_chains_stand_still(kind, rng):
    make = {"signs": sign_target, "cone": body_target}[kind]
    target, start = make(rng)
    found = sample_posterior(target, start, rng, walkers=32)
    assert np.diff(chains(found), axis=1).any(axis=2).mean() > 0.9
    assert found.draws.shape == (4, 32, 100, target.size)
    assert target.region.contains(found.draws).all()
    other = sample_exact(target, start, 100, rng, chains=128)
    assert_same_distribution(chains(found), other)


def test_the_same_seed_gives_the_same_draws_and_the_global_state_is_not_touched(rng):
    target, start = sign_target(rng)
    runs = []
    for seed in (1, 1, 2):
        np.random.seed(seed + 40 * len(runs))  # noqa: NPY002 - must not matter
        before = np.random.get_state()[1].copy()  # noqa: NPY002
        found = sample_posterior(target, start, np.random.default_rng(seed), draws=5, walkers=8)
        assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
        runs.append(found.draws)
    assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).any()


def test_sampling_ends_when_it_is_enough_or_when_the_budget_is_used_up(rng):
    target, start = sign_target(rng)
    asked = []

    def enough(found):
        asked.append(found.draws.shape[2])
        return len(asked) == 2

    done = sample_posterior(target, start, rng, draws=50, walkers=8, enough=enough)
    assert (asked, done.draws.shape[2], done.stopped) == ([ROUND, 2 * ROUND], 2 * ROUND, "")
    poor = sample_posterior(target, start, rng, draws=50, walkers=8, warmup=5, pieces=150)
    assert ROUND <= poor.draws.shape[2] < 50
    said = f"Sampling stopped at {poor.draws.shape[2]} of 50 draws a walker"
    assert poor.stopped.startswith(said)
    assert poor.stopped.count(".") == 1
    reasons = diagnose_convergence(poor, thresholds=Thresholds(ess=1e5)).reasons
    assert reasons[0] == poor.stopped
    assert len(reasons) > 1
    assert diagnose_convergence(poor, thresholds=Thresholds(2.0, 1.0, 0.1)).reasons == ()
