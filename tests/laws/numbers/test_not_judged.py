"""Too few independent outputs, or nothing to resample, is no verdict, whatever the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Thresholds, estimate
from identifiability.estimation.fit import Fit, count_freedom, scatter_scores
from identifiability.estimation.groups import LabelAlternatives
from identifiability.estimation.verdict import judge

from .made import ar1, fit_known, fit_of, gather


def assess(samples, columns=4, *, rho=0.0, size=1, replicates=100):
    """Return the estimate of a regression with noise of 1 %, and its uncertainty."""
    rng = default_rng(0)
    W = rng.standard_normal((samples, 2, columns))
    noise = 0.01 * ar1(rng, rho, samples, 2)
    tau = W @ np.arange(1.0, columns + 1) + noise
    information = gather(W, tau, size)
    fit = estimate(information)
    return fit, Fit.of(information, fit, rng, replicates)


def judged(fit, found, rules=None):
    k = len(fit.columns)
    alias = ("Only with another.",)
    found = replace(found, column_noise=np.full(k, 1e3))
    told = ["label"] * k, ["kg"] * k, 1.0, alias * k, np.zeros(k, bool), None
    return judge(found, *told, rules or Thresholds())


def kinds(verdicts):
    return {v.look for v in verdicts}


@pytest.mark.parametrize("least, judges", [(3.0, True), (100.0, False)])
def test_a_long_log_is_judged_unless_more_is_asked_of_it(least, judges):
    fit, found = assess(150)
    verdicts = judged(fit, found, Thresholds(outputs_per_parameter=least))
    assert kinds(verdicts) == {"identifiable" if judges else "not judged"}


def test_a_direction_that_a_few_outputs_decide_is_not_judged_and_others_are(rng):
    """The second column acts in two short stretches, the third in a fifth of the log."""
    W = rng.standard_normal((600, 1, 3))
    W[:, 0, 1] *= (np.arange(600) % 300) < 8
    W[:, 0, 2] *= np.arange(600) < 120
    tau = W @ np.ones(3) + 0.01 * rng.standard_normal((600, 1))
    information = gather(W, tau, 1)
    fit = estimate(information)
    found = Fit.of(information, fit, rng, 99)
    verdicts = judged(fit, found)
    assert [v.look for v in verdicts] == ["identifiable", "not judged", "identifiable"]
    assert "independent outputs that say how much its value scatters" in verdicts[1].reason
    assert "give longer or more logs, or a higher cut-off" in verdicts[1].reason
    assert "10× rule" not in verdicts[1].reason


def test_degrees_of_freedom_are_those_of_simulated_scatter():
    """Mean squared over half the variance of the sum of squares of what blocks do to values."""
    rng = default_rng(1)
    W = rng.standard_normal((240, 1, 4)) * np.array([1, 1, 1, 1]) ** 2
    W[:, 0, 3] *= np.exp(-np.arange(240) / 40)
    squares = []
    for one in rng.spawn(600):
        information = gather(W, one.standard_normal((240, 1)), 20)
        fit = estimate(information, "ols")
        z = np.append(-fit.value, 1.0)[:, None]
        score = information.products(np.ones(1), np.eye(5)[:, :4], z)[:, :, 0]
        turned = score @ fit.covariance
        squares.append((turned**2).sum(0) / np.diag(fit.covariance) ** 1)
    squares = np.array(squares)
    expected = 2 * squares.mean(0) ** 2 / squares.var(0)
    assert_allclose(count_freedom(information, fit), expected, rtol=0.25)


def test_there_is_no_cliff_as_a_log_gets_shorter():
    """Parameters are lost one after the other, not all at one sample less."""
    counts = [
        sum(v.verdict == "identifiable" for v in judged(*assess(n, 10, rho=0.9)))
        for n in (400, 200, 100, 70)
    ]
    assert counts[0] == 10
    assert counts[2] > 0


def test_without_a_bootstrap_verdicts_are_those_of_scores():
    fit, found = assess(150, replicates=0)
    assert found.bootstrap is None
    verdicts = judged(fit, found)
    assert kinds(verdicts) == {"identifiable"}
    _, drawn = assess(150)
    assert [v.reason for v in verdicts] == [v.reason for v in judged(fit, drawn)]
    assert np.isnan([v.sigma_bootstrap for v in verdicts]).all()
    assert_allclose([v.sigma_bootstrap for v in judged(fit, drawn)], drawn.bootstrap)


def test_a_log_of_few_memories_is_not_judged_with_a_bootstrap_or_without():
    for replicates in (0, 50):
        fit, found = assess(200, size=50, replicates=replicates)
        assert "to judge takes 8" in found.note
        assert kinds(judged(fit, found)) == {"not judged"}


def test_values_that_no_verdict_stands_on_are_those_of_the_fit():
    fit = fit_of([1.0, 2.0], [0.01, 0.01])
    missing = LabelAlternatives(np.ones(2), np.ones(2), ("friction", "friction"), *np.ones((2, 2)))
    verdicts = judged(fit, fit_known(fit, note="Too short.", alternatives=missing))
    assert [v.value for v in verdicts] == [1.0, 2.0]


@pytest.mark.parametrize("logs", [(20,), (43,), (20, 23), (17, 13, 13)])
def test_short_logs_have_scores_as_long_as_there_are_rows_for_twelve_stretches(logs, rng):
    """Stretches end with their log, so fewer of them fit than all samples would make."""
    W = rng.standard_normal((sum(logs), 2, 3))
    tau = W @ np.ones(3) + ar1(rng, 0.8, sum(logs), 2)
    information = gather(W, tau, 1, logs)
    assert scatter_scores(information, estimate(information), 9.0) is not None
