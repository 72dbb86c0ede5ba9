"""Intervals hold the truth under autocorrelated noise, and verdicts are seldom wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

from identifiability import analyze
from identifiability.cli import app
from identifiability.estimation.estimate import estimate
from identifiability.estimation.noise import ResidualNoise, find_runs, fit_residual_noise
from identifiability.foundation.numbers import REACH, clustered_share, exact_share
from identifiability.foundation.options import OptionError
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import find_base_parameters
from identifiability.workflows.calibrate.calibration import calibrate
from identifiability.workflows.calibrate.outcome import (
    Experiment,
    Outcome,
    base_columns,
    count_outcomes,
)
from identifiability.workflows.calibrate.world import World

from .laws.numbers.made import ar1
from .posterior.ranking import build_target, calibrate_posterior


@pytest.fixture(scope="module")
def analysis(simulated_session):
    return analyze("3-rps", simulated_session("3-rps", "601", 0), replicates=0)


def outcomes(analysis, noise, trials):
    """Outcomes of Model 1 under AR(1) noise of the residual's size, and the truth of each."""
    rng = np.random.default_rng(0)
    world = World.of(analysis, analysis.chosen, 80, rng)
    world = replace(world, noise=noise(world.noise.sd))
    found = [world.repeat(seed) for seed in np.random.SeedSequence(0).spawn(trials)]
    return tuple(zip(*found, strict=True))


@pytest.fixture(scope="module")
def red(analysis):
    """Model 1, AR(1) noise with ρ = 0.9 of the size of the residual."""
    return outcomes(analysis, lambda sd: ResidualNoise.first_order(sd, 0.9), 32)


def test_a_repetition_is_asked_what_is_left_out_as_the_logs_are(analysis):
    result = next(m for m in analysis.models if m.name == "Model 4")
    experiment = replace(
        Experiment.of(analysis.regression, result.submodel),
        method=result.estimate.estimator,
        structure=analysis.structure,
    )
    whole = analysis.information
    found = experiment.judge(whole, experiment.tau, experiment.W, np.random.default_rng(0))
    np.testing.assert_allclose(found.value, result.estimate.value, rtol=1e-6)
    # No repetition seeks its nearest real robot, or asks what may be missing.
    alone = {k: x for k, x in result.fit.terms.items() if k not in ("prior", "alternatives")}
    omitted, alone = alone["omitted"], np.linalg.norm(list(alone.values()), axis=0)
    assert np.median(omitted / alone) > 0.3
    np.testing.assert_allclose(found.robust, alone, rtol=0.15)


def test_robust_intervals_hold_the_truth_where_white_ones_do_not(analysis, red):
    trials, truth = red
    cell = count_outcomes(trials, np.array(truth), analysis.chosen.submodel.columns)
    off = np.abs(np.array([t.value for t in trials]) - truth)
    white = np.mean(off <= REACH * np.array([t.white for t in trials]))
    # Thirty-two trials; their spread is measured, and the bounds leave three standard errors.
    assert cell.coverage > 0.90 - 3 * cell.coverage_se
    assert white < 0.62
    assert cell.coverage - white > 0.25
    assert cell.called > 0
    assert cell.wrong.value < 0.02


@pytest.mark.everything
def test_at_low_noise_as_many_are_found_as_by_the_10x_rule(analysis):
    trials, truth = outcomes(analysis, lambda sd: ResidualNoise.first_order(0.3 * sd, 0.0), 12)
    cell = count_outcomes(trials, np.array(truth), analysis.chosen.submodel.columns)
    assert cell.called >= np.mean([t.paper.sum() for t in trials])
    assert cell.wrong.value < 0.02


def test_an_outcome_without_noise_gives_the_truth_back(analysis):
    regression = Regression(
        analysis.robot, Model.of(*analysis.effects), analysis.samples, analysis.base.kept
    )
    submodel = analysis.models[3].submodel
    experiment = Experiment.of(regression, submodel)
    truth = np.arange(1.0, 13.0)
    tau = experiment.W @ submodel.expand(truth)
    information = submodel.reduce(experiment.gather(tau, experiment.W))
    np.testing.assert_allclose(estimate(information, "ols").value, truth, rtol=1e-9)
    assert find_base_parameters(analysis.robot, Model.of(*analysis.effects)).rank == 37


@pytest.mark.pictures
def test_the_command_writes_a_report(simulated_session, tmp_path):
    log = simulated_session("two-link", "a", 0, samples=300).write(tmp_path / "log.csv")
    report, data = tmp_path / "calibration.html", tmp_path / "calibration.json"
    run = CliRunner().invoke(
        app,
        [
            "calibrate",
            "two-link",
            str(log),
            "--quick",
            "--engine",
            "serial",
            "--replicates",
            "16",
            "--names",
            "0",
            "--report",
            str(report),
            "--json",
            str(data),
        ],
    )
    assert run.exit_code == 0, run.output
    said = " ".join(run.stdout.split())
    assert "Of 95 % intervals of no torque offset, " in said
    assert "of what is called identifiable is off by more than half." in said
    assert "of its intervals hold the truth." in said
    html = report.read_text().replace("\u00a0", " ")
    assert "Coverage of every parameter" in html
    assert "Noise of the repetitions" in html
    (row,) = [r for r in json.loads(data.read_text())["noise"] if r["joint"] == "elbow"]
    assert row["order"] >= 0
    assert row["autocorrelation_time"] > 0


@pytest.mark.parametrize(
    ("model", "replicates"),
    [
        (3, 1000),
        # A thousand experiments once gave one of the 37 by chance what six thousand do not show.
        pytest.param(0, 3000, marks=pytest.mark.everything),
    ],
    ids=["small", "full"],
)
def test_planted_values_rank_uniformly_in_their_posterior(analysis, model, replicates):
    result = analysis.models[model] if model else analysis.full
    target, start = build_target(result, result.submodel.reduce(analysis.information))
    rng = np.random.default_rng(0)
    found = calibrate_posterior(target, start, rng, replicates=replicates).p_values(8)
    assert found.min() > 1e-3 / len(found)
    assert stats.kstest(found, "uniform").pvalue > 1e-3


def test_an_unknown_model_is_named(analysis):
    with pytest.raises(OptionError, match="'Model 5', did you mean 'Model"):
        calibrate(analysis, model="Model 5")


def test_the_worst_parameter_is_found_beyond_monte_carlo_error():
    """Twenty parameters: intervals of one are half as wide as they should be (coverage 67 %)."""
    rng, k = np.random.default_rng(0), 20
    sd, yes = np.full(k, 0.1), np.ones(k, bool)
    narrow = np.where(np.arange(k) == 7, 0.05, sd)
    trials = [Outcome(1 + 0.1 * rng.standard_normal(k), sd, narrow, yes, yes) for _ in range(240)]
    names = [f"p{j}" for j in range(k)]
    cell = count_outcomes(trials, np.ones(k), names)
    assert cell.names[cell.worst] == "p7"
    assert cell.below == ("p7",)
    share = cell.each[7]
    assert share.low < 2 * stats.norm.cdf(0.98) - 1 < share.high < 0.95
    assert count_outcomes([replace(t, robust=sd) for t in trials], np.ones(k), names).below == ()
    assert cell.to_dict()["each"][0]["interval95"][0] < cell.to_dict()["each"][0]["coverage"]


def test_exact_shares_are_those_of_clopper_and_pearson():
    for count, total in ((0, 30), (3, 30), (30, 30)):
        known = stats.binomtest(count, total).proportion_ci(0.95, method="exact")
        share = exact_share(count, total)
        assert (share.low, share.high) == pytest.approx((known.low, known.high))
    assert np.isnan(exact_share(0, 0).high)


def test_shares_of_events_that_come_together_allow_for_it():
    """All ten parameters of a trial are wrong together: it is one event, not ten."""
    rng, truth, held, naive = np.random.default_rng(0), 0.1, 0, 0
    among = np.ones((60, 10), bool)
    for _ in range(400):
        events = np.repeat(rng.random((60, 1)) < truth, 10, axis=1)
        share = clustered_share(events, among, events)
        alone = exact_share(events.sum(), events.size)
        held += share.low <= truth <= share.high
        naive += alone.low <= truth <= alone.high
    assert held / 400 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 400)
    assert naive / 400 < 0.6
    never = clustered_share(np.zeros((60, 10), bool), among, events)
    assert 0.03 < never.high < 0.1  # sixty trials, not six hundred
    assert np.isnan(clustered_share(events, ~among, events).value)


def test_noise_is_seen_through_what_the_fit_swallows(analysis):
    """Of ρ = 0.97 the residual of 37 parameters shows 0.75; likelihood beside them shows it."""
    W = base_columns(analysis.regression)[0] @ analysis.full.submodel.M
    rho, naive, seen, sizes = 0.97, [], [], []
    for seed in range(4):
        noise = 50.0 * ar1(np.random.default_rng(seed), rho, len(W), 3)
        found = fit_residual_noise(noise, W, [(0, len(W))])
        seen += [p[0] if len(p) else 0.0 for p in found.pacf]
        sizes += found.sd.tolist()
        left = noise[:, 0] - W[:, 0] @ np.linalg.lstsq(W[:, 0], noise[:, 0], rcond=None)[0]
        naive.append(np.corrcoef(left[1:], left[:-1])[0, 1])
    # The standard error of ρ from 750 samples is √((1 − ρ²)/750) = 0.009, of the median less.
    assert np.median(seen) == pytest.approx(rho, abs=0.015)
    assert np.median(naive) < 0.9
    # An autocorrelation time of 66 leaves 750/33 independent squares: 30 % a size, 12 in all.
    assert np.median(sizes) == pytest.approx(50, rel=0.25)


def test_noise_of_higher_order_and_gaps_between_stretches_are_kept():
    truth = ResidualNoise((np.array([0.6, -0.5]), np.empty(0)), np.array([2.0, 1.0]))
    runs = [(0, 2000), (2000, 6000)]
    noise = truth.simulate(runs, np.random.default_rng(0))
    found = fit_residual_noise(noise, np.ones((6000, 2, 1)), runs)
    assert found.orders == (2, 0)
    np.testing.assert_allclose(found.pacf[0], truth.pacf[0], atol=4 * 6000**-0.5)
    np.testing.assert_allclose(found.sd, truth.sd, rtol=0.1)
    np.testing.assert_allclose(noise.std(0), truth.sd, rtol=0.1)
    assert found.times[0] == pytest.approx(truth.times[0], rel=0.2)
    # An edge between stretches is no neighbourhood: offsets of opposite sign on either side.
    many = [(k, k + 2) for k in range(0, 4000, 2)]
    pairs = ResidualNoise.first_order(np.ones(1), 0.9).simulate(many, np.random.default_rng(1))
    inside = np.corrcoef(pairs[::2, 0], pairs[1::2, 0])[0, 1]
    across = np.corrcoef(pairs[1:-1:2, 0], pairs[2::2, 0])[0, 1]
    assert inside == pytest.approx(0.9, abs=0.02)
    assert abs(across) < 4 * 2000**-0.5
    assert fit_residual_noise(pairs, np.ones((4000, 1, 1)), many).pacf[0][0] > 0.85


def test_a_log_without_noise_is_calibrated_without_a_word(analysis):
    W = np.random.default_rng(0).normal(size=(200, 2, 5))
    found = fit_residual_noise(W @ np.arange(5.0), W, [(0, 200)])
    assert found.orders == (0, 0)
    assert (found.sd < 1e-12).all()
    zero = fit_residual_noise(np.zeros((200, 2)), W, [(0, 200)])
    np.testing.assert_array_equal(zero.sd, 0.0)


def test_stretches_end_at_gaps_and_at_the_ends_of_logs(analysis):
    samples = analysis.samples[0]
    cut = samples.motion[np.r_[0:100, 200 : len(samples.motion)]]
    gapped = replace(samples, motion=cut, tau=samples.tau[: len(cut)])
    n = len(samples.motion)
    assert find_runs([samples]) == [(0, n)]
    assert find_runs([gapped, samples]) == [(0, 100), (100, n - 100), (n - 100, 2 * n - 100)]
