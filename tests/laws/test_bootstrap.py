"""Refits from blocks equal refits from rows, fast, and their spread is what it should be."""

import time

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import bootstrap, draw_blocks, merge_blocks
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Regression
from identifiability.regression.structure import find_base_parameters


@pytest.fixture(scope="module")
def problem(simulated_session):
    from identifiability.regression.regression import Model
    from identifiability.robot import Robot

    robot = Robot.load("3-rps")
    model = Model.of("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia")
    base = find_base_parameters(robot, model)
    samples = prepare_samples(robot, simulated_session("3-rps", "601", 0))
    regression = Regression(robot, model, (samples,), base.kept)
    W = np.concatenate([W for _, _, W, _ in regression.chunks()])
    return gather_information(regression), W, samples.tau


def test_refits_equal_least_squares_on_resampled_rows(problem):
    information, W, tau = problem
    fit = estimate(information)
    merged = merge_blocks(information, 25)
    assert merged.counts.min() >= 20
    counts = draw_blocks(len(merged.counts), 12, np.random.default_rng(0))
    values = fit.estimator.refit(merged, fit, counts)
    root = np.sqrt(fit.weights)[None, :, None]
    for replicate, drawn in enumerate(counts):
        repeats = np.repeat(drawn, merged.counts).astype(int)
        rows = np.repeat(np.arange(len(tau)), repeats)
        flat = (W[rows] * root).reshape(-1, W.shape[2])
        naive = np.linalg.lstsq(flat, (tau[rows] * root[..., 0]).ravel(), rcond=None)[0]
        np.testing.assert_allclose(values[replicate], naive, atol=1e-8 * np.abs(naive).max())


def test_refits_from_blocks_are_ten_times_faster_than_from_rows(problem):
    information, W, tau = problem
    fit = estimate(information)
    flat, right = W.reshape(-1, W.shape[2]), tau.ravel()
    rows = np.random.default_rng(0).integers(0, len(flat), len(flat))
    ours, naive = [], []
    for _ in range(5):  # in turns, and the least of each: what runs beside disturbs both
        start = time.process_time()
        bootstrap(information, fit, np.random.default_rng(0), replicates=200, length=25)
        ours.append((time.process_time() - start) / 200)
        start = time.process_time()
        np.linalg.lstsq(flat[rows], right[rows], rcond=None)
        naive.append(time.process_time() - start)
    assert min(ours) * 10 <= min(naive), f"only {min(naive) / min(ours):.1f} × faster"


def test_under_white_noise_the_spread_is_that_of_the_formula(problem):
    information, _, _ = problem
    fit = estimate(information)
    found = bootstrap(information, fit, np.random.default_rng(1), replicates=3000, length=3)
    # The paper's noise is multiplicative, hence not quite white; agreement is to tens of percent.
    ratio = found.sd / fit.sigma
    assert 0.6 < np.median(ratio) < 1.5


def test_the_same_seed_gives_the_same_replicates(problem):
    information, _, _ = problem
    fit = estimate(information)
    a, b = (bootstrap(information, fit, np.random.default_rng(5), replicates=50) for _ in range(2))
    np.testing.assert_array_equal(a.values, b.values)


def test_too_few_blocks_are_refused_with_a_sentence(problem):
    information, _, _ = problem
    with pytest.raises(
        IdentifiabilityError, match=r"only 3 independent blocks.*longer or more logs"
    ):
        bootstrap(information, estimate(information), np.random.default_rng(0), length=250)


def test_blocks_do_not_cross_logs(problem):
    information, _, _ = problem
    both = information + information
    merged = merge_blocks(both, 100)
    assert merged.counts.sum() == 2 * information.samples
    assert (np.diff(merged.log) >= 0).all()
    for log in (0, 1):
        assert merged.counts[merged.log == log].sum() == information.samples
