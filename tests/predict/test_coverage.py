"""Intervals hold what they promise: the planted torque of the model, and new samples."""

import numpy as np
import pytest

from identifiability import Model, Robot, analyze, estimate, gather_information, prepare_log
from identifiability.estimation.fit import Fit
from identifiability.estimation.prediction import measure_spread, predict
from identifiability.regression.structure import Structure

TRIALS = 24


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=pytest.mark.everything), 0.8])
def test_intervals_cover_the_planted_torque_and_new_samples(rho, make_log, without_noise):
    structure = Structure.of(Robot.load("two-link"), Model.of("rigid_body", "viscous_friction"))
    other = structure.regression([prepare_log(structure.robot, without_noise("two-link", "b"))])
    (W,) = (c.W for c in other.chunks())
    truth = W @ true_values(structure, without_noise("two-link", "a"))
    mean = []
    new = []
    for seed in range(TRIALS):
        log = explained(structure, make_log("two-link", "a", seed, rho), without_noise)
        regression = structure.regression([prepare_log(structure.robot, log)])
        information = gather_information(regression)
        fit = estimate(information)
        found = predict(regression, fit.value[:, None])
        rng = np.random.default_rng(seed)
        spread = Fit.of(information, fit, rng, 60)
        rms = found.joint_rms()[:, 0]
        none = np.full(len(rms), np.nan)
        reach = measure_spread(information, spread, (rms, rms), (none, none)).reach(W)
        off = np.abs(W @ fit.value - truth)
        noise = make_log("two-link", "b", 100 + seed, rho).tau - without_noise("two-link", "b").tau
        mean.append((off <= reach[0]).mean())
        new.append((np.abs(W @ fit.value - truth - noise) <= reach[1]).mean())
    assert np.mean(mean) > 0.93
    assert 0.93 < np.mean(new) < 0.975


def true_values(structure, log):
    information = gather_information(structure.regression([prepare_log(structure.robot, log)]))
    return estimate(information).value


def explained(structure, log, without_noise):
    """The log with the torque that the model explains, and its own noise."""
    clean = without_noise("two-link", "a")
    regression = structure.regression([prepare_log(structure.robot, clean)])
    (chunk,) = regression.chunks()
    left = chunk.tau - chunk.W @ true_values(structure, clean)
    columns = {f"{j}.tau": (log.tau - left)[:, k] for k, j in enumerate(log.joints)}
    return type(log).from_frame(log.to_frame().assign(**columns), log.name)


@pytest.mark.everything
@pytest.mark.parametrize(("name", "rho"), [("two-link", 0.8), ("six-dof-arm", 0.5)])
def test_intervals_of_analyze_cover_planted_torque(name, rho, make_log, without_noise):
    mean = []
    new = []
    truth = without_noise(name, "b").select(Robot.load(name).joints).tau
    for seed in range(20):
        # All rows are fitted: the larger error, on unseen motion, would widen intervals further.
        found = analyze(name, make_log(name, "a", seed, rho), "none", replicates=100)
        along = found.predict(make_log(name, "b", 100 + seed, rho))
        mean.append((np.abs(truth - along.predicted) <= along.mean).mean())
        new.append((np.abs(along.tau - along.predicted) <= along.low).mean())
    assert np.mean(mean) > 0.92
    assert 0.92 < np.mean(new) < 0.985
