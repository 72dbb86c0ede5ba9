"""What bodies that can exist, or the prior, add to a verdict, from numbers alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from identifiability.estimation.verdict import Class, Flag, Verdict
from identifiability.posterior.diagnostics import Convergence
from identifiability.posterior.target import Prior
from identifiability.workflows.analyze.belief import (
    Belief,
    StandardBelief,
    Summary,
    believed_interval,
    refine_verdicts,
)


def verdict(kind, robust=1.0, flags=()):
    return Verdict(
        name="x", label="x", unit="kg", value=2.0, sigma=0.1, terms={"noise": robust}, share=0.1,
        paper_rule=True, verdict=kind, reason="As the data say.", flags=flags,
    )  # fmt: skip


def summary(sd, reasons=(), prior_sensitivity=0.0):
    one = np.ones(1)
    return Summary(
        mean=3.0 * one, sd=np.array([sd]), interval=np.array([[2.5, 3.5]]),
        chains=np.zeros((1, 1, 5, 1)),
        prior_sensitivity=prior_sensitivity * one,
        convergence=Convergence(one, one, one, one, tuple(reasons)),
    )  # fmt: skip


def standard():
    one = np.ones(1)
    return StandardBelief(
        names=("x",), prior_mean=one, prior_sd=one, data_sd=one, mean=one, sd=one, source=(),
        chains=np.zeros((1, 1, 5, 1)),
    )  # fmt: skip


def refined(
    kind=Class.SIGN_ONLY,
    *,
    sd=0.1,
    prior=1.0,
    data=1.0,
    robust=1.0,
    reasons=(),
    flags=(),
    prior_sensitivity=0.0,
):
    belief = Belief(
        signs=None, physical=summary(sd, reasons, prior_sensitivity), standard=standard(),
        model_prior_sd=np.array([prior]), model_data_sd=np.array([data]),
    )  # fmt: skip
    (found,) = refine_verdicts((verdict(kind, robust, flags),), belief)
    return found


@pytest.mark.parametrize("kind", [Class.SIGN_ONLY, Class.NOT_IDENTIFIABLE])
def test_what_the_data_leave_open_may_be_determined_by_bodies(kind):
    found = refined(kind)
    assert found.flags == (Flag.BY_CONE,)
    assert found.reason.startswith("As the data say. Bodies that can exist, with the prior")
    assert "narrow it to 2.5 … 3.5 (95 %)" in found.reason
    assert found.interval95 == (2.5, 3.5)
    assert found.data_interval95 == verdict(kind).data_interval95
    assert found.value == 2.0


@pytest.mark.parametrize("flag", [None, Flag.IN_DOUBT, Flag.NEGLIGIBLE, Flag.NOT_JUDGED])
def test_what_is_identifiable_or_has_another_reason_stays(flag):
    kind = Class.NOT_IDENTIFIABLE if flag else Class.IDENTIFIABLE
    flags = (flag,) if flag else ()
    assert refined(kind, flags=flags) == verdict(kind, flags=flags)


@pytest.mark.parametrize(("sd", "narrowed"), [(0.70, True), (0.71, False)])
def test_narrowed_means_half_the_variance_that_the_data_leave(sd, narrowed):
    """.707² is a half."""
    found = refined(sd=sd, prior=10.0)
    assert (found.flags == (Flag.BY_CONE,)) == narrowed
    assert (found == verdict(Class.SIGN_ONLY)) == (not narrowed)


@pytest.mark.parametrize(("data", "kind"), [(0.99, Flag.BY_PRIOR), (1.01, Flag.BY_CONE)])
def test_by_bodies_means_half_the_variance_that_data_and_prior_leave(data, kind):
    assert refined(sd=0.707, data=data, prior=10.0, robust=2.0).flags == (kind,)


@pytest.mark.parametrize(("prior", "kind"), [(0.19, Flag.BY_PRIOR), (0.21, Flag.BY_CONE)])
def test_what_is_half_as_wide_as_the_prior_is_learned(prior, kind):
    found = refined(sd=0.1, prior=prior)
    assert found.flags == (kind,)
    assert ("it is the prior that narrows it" in found.reason) == (kind is Flag.BY_PRIOR)
    assert found.interval95 == (2.5, 3.5)


@pytest.mark.parametrize(("prior_sensitivity", "stated"), [(0.19, True), (0.21, False)])
def test_what_the_density_at_an_edge_decides_has_no_interval(prior_sensitivity, stated):
    found = refined(prior_sensitivity=prior_sensitivity)
    assert found.flags == (Flag.BY_CONE if stated else Flag.BY_PRIOR,)
    assert found.believed == ((2.5, 3.5) if stated else None)
    assert ("no interval is stated" in found.reason) == (not stated)


def test_a_posterior_that_may_not_be_shown_adds_nothing():
    before = verdict(Class.SIGN_ONLY)
    assert refined(reasons=["It moved too little."]) == before
    for missing in (replace_belief(physical=None), replace_belief(standard=None)):
        assert refine_verdicts((before,), missing) == (before,)


def replace_belief(**change):
    one = np.ones(1)
    whole = Belief(
        signs=None, physical=summary(0.1), standard=standard(), model_prior_sd=one,
        model_data_sd=one,
    )  # fmt: skip
    return replace(whole, **change)


def test_learning_is_one_less_what_is_left_of_the_priors_width():
    known = replace(standard(), prior_sd=np.array([4.0]), sd=np.array([1.0]))
    np.testing.assert_allclose(known.contraction, [0.75])


def test_a_prior_around_a_robot_is_as_wide_as_its_bodies_are_large():
    """2 kg with second moments .01, .08 and .09 along the axes; others by their size."""
    theta = np.array([0.17, 0.01, 0.0, 0.10, 0.0, 0.09, 0.1, 0.0, 0.0, 2.0])
    phi = np.append(theta, [0.5, 0.0])
    prior = Prior.around(phi, np.arange(10)[None], 0.3, np.full(12, 7.0))
    np.testing.assert_allclose(prior.mean, phi)
    products = np.sqrt([0.01 * 0.08, 0.01 * 0.09, 0.08 * 0.09])
    np.testing.assert_allclose(prior.sd[[0, 3, 5]], 0.3 * theta[[0, 3, 5]])
    np.testing.assert_allclose(prior.sd[[1, 2, 4]], 0.3 * products)
    np.testing.assert_allclose(prior.sd[6:9], 0.3 * np.sqrt(2 * np.array([0.01, 0.08, 0.09])))
    np.testing.assert_allclose(prior.sd[9:], [0.3 * 2, 0.3 * 0.5, 7.0])


@pytest.mark.parametrize("truth", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("signed", [True, False])
def test_intervals_hold_the_truth_at_the_edge_of_the_possible_too(truth, signed):
    """A measurement of known error, flat prior, truncated normal posterior; 98 % at the edge."""
    rng = np.random.default_rng(0)
    best = truth + rng.standard_normal(1500)
    law = stats.truncnorm(-best, np.inf, loc=best)
    draws = law.ppf(np.linspace(0.0, 0.9999, 1000)[:, None])
    low, high = believed_interval(draws, np.full(1500, signed)).T
    held = np.mean((low <= truth) & (truth <= high))
    assert held == pytest.approx(0.977 if truth == 0 else 0.95, abs=0.025)
    np.testing.assert_allclose(law.cdf(high) - law.cdf(low), 0.95, atol=2e-3)
    assert (high - low <= np.ptp(law.ppf([[0.025], [0.975]]), axis=0) + 1e-3).all()
