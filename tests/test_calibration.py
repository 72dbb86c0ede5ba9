"""Intervals hold the truth under autocorrelated noise, and verdicts are seldom wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from identifiability import Noise, analyze, calibrate
from identifiability.estimation.noise import JointNoise
from identifiability.foundation.rounding import REACH
from identifiability.workflows.calibrate.world import Experiment, World, count_outcomes

from .marks import everything
from .posterior.ranking import build_target, calibrate_posterior


@pytest.fixture(scope="module")
def analysis(noisy_log):
    return analyze("3-rps", noisy_log, replicates=0)


def remembering(size, rho):
    """AR(1) noise of joints of some standard deviations."""
    return tuple(JointNoise(np.array([rho]), x * np.sqrt(1 - rho**2)) for x in size)


def outcomes(analysis, noise, trials):
    """Outcomes of Model 1 under AR(1) noise of the residual's size, and the truth of each."""
    world = World.of(analysis, analysis.chosen, 80, default_rng(0))
    own = [x.sigma / np.sqrt(np.prod(1 - x.pacf**2)) for x in world.noise]
    world = replace(world, noise=noise(own))
    found = [world.repeat(seed) for seed in np.random.SeedSequence(0).spawn(trials)]
    return tuple(zip(*found, strict=True))


@pytest.fixture(scope="module")
def red(analysis):
    """Model 1, AR(1) noise with ρ = 0.9 of the size of the residual."""
    return outcomes(analysis, lambda size: remembering(size, 0.9), 32)


def test_a_repetition_is_asked_what_is_left_out_as_the_logs_are(analysis):
    result = next(m for m in analysis.models if m.name == "Model 4")
    method = result.estimate.estimator
    e = Experiment.of(analysis.structure, analysis.samples, result.submodel, method=method)
    found = e.judge(analysis.information, e.tau, e.W, default_rng(0))
    assert_array_equal(found.paper, result.estimate.paper_rule)
    assert found.judged
    assert_allclose(found.value, result.estimate.value, rtol=1e-6)
    # No repetition seeks its nearest real robot, asks what may be missing, or has noisy motion.
    beyond = ("prior", "alternatives", "bias")
    alone = {k: x for k, x in result.fit.terms.items() if k not in beyond}
    omitted, alone = alone["omitted"], np.linalg.norm(list(alone.values()), axis=0)
    assert np.median(omitted / alone) > 0.3
    assert_allclose(found.robust, alone, rtol=0.15)
    short = replace(e, **{name: getattr(e, name)[:14] for name in ("W", "tau", "log", "moves")})
    found = short.judge(short.gather(short.tau, short.W), short.tau, short.W, default_rng(0))
    assert not found.judged
    assert not found.identifiable.any()


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


@pytest.mark.pictures
def test_the_command_writes_a_report(simulated_session, succeeds, tmp_path):
    log = simulated_session("two-link", "a", 0, samples=300).write(tmp_path / "log.csv")
    report, data = tmp_path / "calibration.html", tmp_path / "calibration.json"
    words = ["two-link", log, "--quick", "--set", "workers=1", "--replicates", 16, "-v"]
    run = succeeds("calibrate", *words, "--report", report, "--json", data)
    said = " ".join(run.stdout.split())
    assert "repetitions with known values (without torque offset)." in said
    assert "of the parameters called identifiable are off by more than half." in said
    assert "of its intervals hold the truth." in said
    assert "Coverage of every parameter" in report.read_text().replace("\u00a0", " ")
    (cell,) = json.loads(data.read_text())["cells"]
    assert min(e["coverage"] for e in cell["each"]) <= cell["coverage_robust"]


@pytest.mark.parametrize(
    "model, replicates",
    [
        (3, 1000),
        # A thousand experiments once gave one of the 37 by chance what six thousand do not show.
        everything(0, 3000),
    ],
)
def test_planted_values_rank_uniformly_in_their_posterior(analysis, model, replicates):
    result = analysis.models[model] if model else analysis.full
    target, start = build_target(result, result.submodel.reduce(analysis.information))
    found = calibrate_posterior(target, start, default_rng(0), replicates=replicates)
    assert found.min() > 1e-3 / len(found)
    assert stats.kstest(found, "uniform").pvalue > 1e-3


def test_a_log_without_noise_is_calibrated_without_a_word(simulated_session):
    log = simulated_session("two-link", "a", noise=Noise(), samples=300)
    found = calibrate(analyze("two-link", log, replicates=0), replicates=8, refits=20)
    assert found.cell.coverage > 0.9
