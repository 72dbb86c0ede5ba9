import numpy as np
import pytest

from identifiability.posterior import exact
from identifiability.posterior.diagnostics import autocorrelation_time, diagnose_convergence
from identifiability.posterior.ensemble import Posterior, sample_posterior

from .conftest import sign_target


def test_ensembles_that_disagree_may_not_although_their_walkers_agree(rng):
    draws = rng.normal(size=(4, 16, 100, 3))
    draws[..., 1] += np.array([0, 0.5, 1.0, 0])[:, None, None]
    found = diagnose_convergence(Posterior(draws), ["a.Fv", "b.Fv", "c.Fv"])
    assert not found.trustworthy
    assert found.reasons[0].startswith("The ensembles disagree: nested R-hat of b.Fv is 1.")


def test_few_or_short_draws_may_not(rng):
    walk = np.cumsum(rng.normal(size=(4, 4, 40, 2)), axis=2)
    found = diagnose_convergence(Posterior(walk))
    said = " ".join(found.reasons)
    for part in ("Too few effective draws", "The chains are short"):
        assert part in said


def test_an_ensemble_that_has_not_converged_is_found_out(rng, monkeypatch):
    target, start = sign_target(rng, size=12)
    with monkeypatch.context() as slowed:
        slowed.setattr(exact, "TURN", (0.02, 0.03))
        slow = sample_posterior(target, start, rng, draws=60, warmup=0)
    assert not diagnose_convergence(slow).trustworthy
    assert diagnose_convergence(sample_posterior(target, start, rng, draws=150)).trustworthy


def test_the_autocorrelation_time_of_a_known_process(rng):
    rho = 0.8
    x = np.zeros((200, 2000, 1))
    for k in range(1, 2000):
        x[:, k] = rho * x[:, k - 1] + rng.normal(size=(200, 1))
    assert autocorrelation_time(x[:, 100:])[0] == pytest.approx((1 + rho) / (1 - rho), rel=0.03)
