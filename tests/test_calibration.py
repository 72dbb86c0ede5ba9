"""Intervals hold the truth under autocorrelated noise, and verdicts are seldom wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from identifiability import analyze
from identifiability.calibration import calibrate
from identifiability.cli import app
from identifiability.errors import ModelError
from identifiability.estimation import estimate
from identifiability.grouping import find_base_parameters
from identifiability.model import Model, Regression
from identifiability.ranks import RankCheck, build_target, check_ranks
from identifiability.replicates import Experiment, correlated_noise


@pytest.fixture(scope="module")
def analysis(simulated_session):
    return analyze("3-rps", simulated_session("3-rps", "601", 0), replicates=0)


@pytest.fixture(scope="module")
def red(analysis):
    """Model 1, AR(1) noise with ρ = 0.9 of the size of the residual."""
    return calibrate(analysis, noise=(1.0,), rho=(0.9,), trials=30, replicates=150).cells[0]


def test_robust_intervals_hold_the_truth_where_white_ones_do_not(red):
    # Thirty trials; their spread is measured, and the bounds leave three standard errors.
    assert red.coverage_robust > 0.90 - 3 * red.coverage_se
    assert red.coverage_white < 0.62
    assert red.coverage_robust - red.coverage_white > 0.25


def test_what_is_called_identifiable_is_seldom_wrong_by_half(red):
    assert red.called > 0
    assert red.wrong < 0.02


def test_at_low_noise_as_many_are_found_as_by_the_10x_rule(analysis):
    cell = calibrate(analysis, noise=(0.3,), rho=(0.0,), trials=12, replicates=100).cells[0]
    assert cell.called >= cell.paper_called
    assert cell.wrong < 0.02


def test_an_outcome_without_noise_gives_the_truth_back(analysis):
    regression = Regression(
        analysis.robot, Model.of(*analysis.effects), analysis.samples, analysis.base.kept
    )
    rung = analysis.models[3].rung
    experiment = Experiment.of(regression, rung.M, rung.columns)
    truth = np.arange(1.0, 13.0)
    information, tau = experiment.outcome(truth, np.zeros((750, 3)))
    np.testing.assert_allclose(estimate(information, "ols").value, truth, rtol=1e-9)
    np.testing.assert_allclose(tau, experiment.W @ truth)
    assert find_base_parameters(analysis.robot, Model.of(*analysis.effects)).rank == 37


def test_correlated_noise_has_the_size_and_correlation_asked_for():
    log = np.repeat([0, 1], 20000)
    noise = correlated_noise(
        log, np.array([1.0, 5.0]), np.array([0.0, 0.9]), np.random.default_rng(0)
    )
    np.testing.assert_allclose(noise.std(0), [1.0, 5.0], rtol=0.05)
    lag = [np.corrcoef(x[:-1], x[1:])[0, 1] for x in noise.T]
    np.testing.assert_allclose(lag, [0.0, 0.9], atol=0.02)


def test_the_command_writes_a_report(simulated_session, tmp_path):
    log = simulated_session("two-link", "a", 0).write(tmp_path / "log.csv")
    report = tmp_path / "calibration.html"
    run = CliRunner().invoke(
        app, ["calibrate", "two-link", str(log), "--quick", "--report", str(report)]
    )
    assert run.exit_code == 0, run.output
    assert "intervals of full model hold the truth" in run.output
    assert "posterior is calibrated" in " ".join(run.output.split())
    html = report.read_text().replace("\u00a0", " ")
    assert "Coverage of 95 % intervals" in html
    assert "rank of the planted value" in html
    run = CliRunner().invoke(app, ["calibrate", "two-link", str(log), "--quick", "--no-sbc"])
    assert "posterior" not in run.output


def test_planted_values_rank_uniformly_in_their_posterior(analysis):
    found = check_ranks(
        analysis.full, analysis.full.rung.reduce(analysis.information), np.random.default_rng(0)
    )
    assert found.uniform
    assert found.counts.shape == (37, 8)
    assert (found.counts.sum(1) == 1000).all()
    assert stats.kstest(found.p_values, "uniform").pvalue > 1e-3
    assert found.to_dict()["parameters"][0]["name"] == analysis.full.rung.columns[0]


def test_a_posterior_that_ranks_badly_is_said_to_be_wrong():
    low, high = np.full(8, 125.0), np.array([300.0, 100, 100, 100, 100, 100, 100, 100])
    found = RankCheck(("a", "b"), np.stack([low, high]), np.array([1.0, 1e-40]), 1000)
    assert not found.uniform
    assert found.worst == 1
    assert "not calibrated on this motion" in found.statement
    assert found.band[0] < 125 < found.band[1]


def test_parameters_that_the_motion_leaves_open_can_be_ranked(analysis):
    full = analysis.full
    fit = full.estimate
    determined = np.arange(37) > 2
    blind = replace(fit, determined=determined)
    spread = replace(full.uncertainty, inflated=np.where(determined, fit.sigma, np.inf))
    result = replace(full, estimate=blind, uncertainty=spread)
    information = full.rung.reduce(analysis.information)
    target, start = build_target(result, information)
    assert np.isfinite(target.prior.sd).all()
    assert (start[full.rung.nonnegative] > 0).all()
    assert (
        check_ranks(result, information, np.random.default_rng(1), replicates=64).replicates == 64
    )


def test_an_unknown_model_is_named(analysis):
    with pytest.raises(ModelError, match="'Model 5', did you mean 'Model"):
        calibrate(analysis, model="Model 5")
