"""Too few independent outputs, or nothing to resample, is no verdict, whatever the numbers."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.estimation.judge import Evidence, judge
from identifiability.estimation.scores import FEWEST, scatter_scores
from identifiability.estimation.uncertainty import assess_uncertainty, recurrence
from identifiability.estimation.verdict import Class, Thresholds

from .made import ar1, fit_of, gather


def assess(samples, columns=4, *, rho=0.0, actuators=2, size=1, replicates=100, seed=0):
    """Return the estimate of a regression with noise of 1 %, and its uncertainty."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((samples, actuators, columns))
    noise = 0.01 * ar1(rng, rho, samples, actuators)
    tau = W @ np.arange(1.0, columns + 1) + noise
    information = gather(W, tau, size)
    fit = estimate(information)
    series = np.zeros(samples, int)
    found = assess_uncertainty(information, fit, tau - W @ fit.value, series, rng, replicates)
    return fit, found


def judged(fit, found, rules=None):
    rules, k = rules or Thresholds(), len(fit.columns)
    evidence = Evidence(
        fit, found.robust, recurrence(fit, found, rules), np.ones(k), np.full(k, 1e3), 1.0,
        ("Only with another.",) * k, found.why_unjudged(len(fit.kept), rules),
    )  # fmt: skip
    return judge(["label"] * k, ["kg"] * k, evidence, None, rules)


def kinds(verdicts):
    return {v.verdict for v in verdicts}


def test_the_word_is_public_and_the_threshold_is_stated():
    assert Class.NOT_JUDGED.value == "not judged"
    assert Thresholds().outputs_per_parameter == 3.0


@pytest.mark.parametrize(("least", "judges"), [(3.0, True), (100.0, False)])
def test_a_long_log_is_judged_unless_more_is_asked_of_it(least, judges):
    fit, found = assess(150)
    verdicts = judged(fit, found, Thresholds(outputs_per_parameter=least))
    assert kinds(verdicts) == {Class.IDENTIFIABLE if judges else Class.NOT_JUDGED}


def test_outputs_of_all_actuators_count_each_by_the_memory_of_its_residual():
    _, white = assess(400)
    _, slow = assess(400, rho=0.9)
    np.testing.assert_allclose(white.independent, (400 / white.times).sum())
    assert white.independent == pytest.approx(800, rel=0.2)
    # (1 + ρ) / (1 - ρ) samples count as one.
    assert slow.independent == pytest.approx(800 / 19, rel=0.5)


def test_correlated_outputs_are_too_few_where_as_many_white_ones_are_enough():
    rules = Thresholds(outputs_per_parameter=30)
    assert kinds(judged(*assess(400), rules)) == {Class.IDENTIFIABLE}
    verdicts = judged(*assess(400, rho=0.9), rules)
    assert kinds(verdicts) == {Class.NOT_JUDGED}
    assert "independent outputs for 4 parameters, fewer than 30 for each" in verdicts[0].reason
    assert "give longer or more logs, or a higher cut-off" in verdicts[0].reason


def test_few_outputs_are_not_judged_however_well_they_fit():
    verdicts = judged(*assess(14, 10, size=1))
    assert kinds(verdicts) == {Class.NOT_JUDGED}
    assert "independent outputs for 10 parameters" in verdicts[0].reason
    assert "10× rule" not in verdicts[0].reason


def test_without_a_bootstrap_nothing_is_judged():
    fit, found = assess(150, replicates=0)
    assert kinds(judged(fit, found)) == {Class.NOT_JUDGED}
    assert "No logs were resampled" in found.why_unjudged(4, Thresholds())
    assert np.isfinite(found.robust).all()  # scores were asked


def test_without_bootstrap_and_scores_the_robust_deviation_is_not_the_white_one():
    fit, found = assess(200, size=50)  # four blocks of time
    assert found.bootstrap is None
    assert found.scores is None
    assert np.isinf(found.robust).all()
    verdicts = judged(fit, found)
    assert kinds(verdicts) == {Class.NOT_JUDGED}
    assert "the bootstrap needs 8" in verdicts[0].reason


def test_without_scores_nothing_is_judged():
    fit, found = assess(200, size=20)  # ten blocks: enough for one road, too few for the other
    assert found.bootstrap is not None
    assert found.scores is None
    assert kinds(judged(fit, found)) == {Class.NOT_JUDGED}


def test_a_missing_share_of_resampled_logs_never_counts_as_agreement():
    evidence = Evidence(
        fit_of([1.0], [0.01]), np.array([0.01]), np.array([np.nan]), np.ones(1), np.ones(1), 1.0,
        ("",),
    )  # fmt: skip
    (verdict,) = judge(["label"], ["kg"], evidence)
    assert verdict.verdict is Class.NOT_JUDGED


def test_what_the_motion_leaves_open_is_said_as_before():
    evidence = Evidence(
        fit_of([1.0, 2.0], [0.01, 0.01], [False, True]), np.array([np.inf, 0.01]), np.ones(2),
        np.ones(2), np.ones(2), 1.0, ("Only with another.", ""), "Too short.",
    )  # fmt: skip
    first, second = judge(["label"] * 2, ["kg"] * 2, evidence)
    assert (first.verdict, first.reason) == (Class.NOT_IDENTIFIABLE, "Only with another.")
    assert (second.verdict, second.reason) == (Class.NOT_JUDGED, "Too short.")


@pytest.mark.parametrize("logs", [(20,), (43,), (20, 23), (17, 13, 13)])
def test_short_logs_have_scores_as_long_as_there_are_rows_for_twelve_stretches(logs):
    """Stretches end with their log, so fewer of them fit than all samples would make."""
    rng = np.random.default_rng(0)
    W = rng.standard_normal((sum(logs), 2, 3))
    tau = W @ np.ones(3) + ar1(rng, 0.8, sum(logs), 2)
    information = gather(W, tau, 1, logs)
    found = scatter_scores(information, estimate(information), 9.0)
    assert found is not None
    assert found.stretches >= FEWEST
