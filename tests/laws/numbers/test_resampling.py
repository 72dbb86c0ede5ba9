"""Blocks, refits on resampled blocks, and the scatter of scores, against formulas."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm, t

from identifiability import estimate
from identifiability.estimation.fit import (
    Fit,
    bootstrap,
    merge_blocks,
    merge_stretches,
    scatter_scores,
    spread_of,
)

from .made import ar1, gather


def rows(samples=192, seed=0, noise=(0.1, 1.0)):
    rng = default_rng(seed)
    W = rng.normal(size=(samples, len(noise), 3))
    tau = W @ [1.0, -2.0, 0.5] + rng.normal(size=(samples, len(noise))) * noise
    return W, tau


def test_blocks_are_joined_to_equal_ones_of_the_length_that_is_wanted():
    information = gather(*rows(), size=8)
    for length, counts in ((1, [8] * 24), (8, [8] * 24), (16, [16] * 12), (32, [32] * 6),
                           (48, [48] * 4), (64, [64] * 3), (96, [96] * 2), (192, [192]),
                           (1e9, [192])):  # fmt: skip
        merged = merge_blocks(information, length)
        assert_array_equal(merged.counts, counts)


def test_blocks_of_several_logs_are_joined_within_each():
    information = gather(*rows(), size=8, logs=(64, 128))
    merged = merge_blocks(information, 40)
    assert_array_equal(merged.log, [0, 1, 1, 1])
    assert_array_equal(merged.counts, [64, 48, 40, 40])
    assert merge_blocks(information, 1e9).log.tolist() == [0, 1]


def test_refits_are_weighted_least_squares_on_the_drawn_rows():
    W, tau = rows()
    information = gather(W, tau, size=8)
    weights = np.array([30.0, 0.1])
    counts = default_rng(1).multinomial(24, np.full(24, 1 / 24), size=5)
    fit = replace(estimate(information), weights=weights)
    values = bootstrap(information, fit, default_rng(1), replicates=5)
    for value, drawn in zip(values, counts, strict=True):
        repeat = np.sqrt(np.repeat(drawn, 8))[:, None] * np.sqrt(weights)
        expected = np.linalg.lstsq(
            (W * repeat[..., None]).reshape(-1, 3), (tau * repeat).ravel(), rcond=None
        )[0]
        assert_allclose(value, expected, rtol=1e-8)


def test_columns_that_the_fit_dropped_stay_zero_in_every_replicate():
    W, tau = rows()
    information = gather(np.concatenate([W[:, :, :1], W], axis=2), tau, size=8)
    fit = estimate(information)
    assert fit.kept == (0, 2, 3)
    found = bootstrap(information, fit, default_rng(0), replicates=20)
    assert_array_equal(found[:, 1], 0.0)
    assert (spread_of(found)[[0, 2, 3]] > 0).all()


def test_seven_blocks_say_nothing_and_eight_do(rng):
    information = gather(*rows(), size=8)
    fit = estimate(information)
    few, enough = (
        Fit.of(information, replace(fit, times=np.full(2, 95.9 / n)), rng, 20) for n in (7, 8)
    )
    assert "make only 7 independent blocks; to judge takes 8" in few.note
    assert few.bootstrap is None
    assert enough.note == ""
    assert (enough.bootstrap > 0).all()


def test_deviations_are_those_of_the_replicates():
    values = default_rng(0).normal(size=(4001, 2)) @ [[1.0, 0.6], [0.0, 0.8]]
    found = spread_of(values)
    assert_allclose(found, np.std(values, axis=0, ddof=1), rtol=0.03)
    one_wild = np.vstack([values, [[1e6, -1e6]]])
    assert_allclose(spread_of(one_wild), found, rtol=1e-2)


def single(residual, size, column=1.0):
    """Return the information of one column, constant by default, and its fit."""
    W = np.broadcast_to(column, len(residual))[:, None, None]
    information = gather(W, residual[:, None], size=size)
    return information, estimate(information, "ols")


def by_hand(residual, length):
    """Return the deviation of a mean by the scatter of sums over stretches, by the formulas.

    Leverage of a stretch is 1/B.
    """
    N = len(residual)
    B = len(residual) // length
    e = residual - residual.mean()
    sums = e.reshape(B, length).sum(1)
    return np.sqrt((sums**2).sum() / (1 - 1 / B)) / N


@pytest.mark.parametrize("rho", [0.0, 0.99])
def test_the_scatter_of_scores_is_that_of_sums_over_stretches(rho):
    """Of slow noise a column that alternates sees next to nothing, and a constant one much."""
    residual = ar1(default_rng(7), rho, 960)[:, 0]
    for column in (1.0, np.tile([1.0, -1.0], 480)):
        found = scatter_scores(*single(residual, 8, column), time=8.0)
        assert_allclose(found.sd, [by_hand(column * residual, 40)], rtol=1e-6)


def test_a_stretch_is_five_memories_long_while_twelve_are_left():
    residual = default_rng(0).normal(size=960)
    for time, stretches in ((1.6, 120), (8.0, 24), (16.0, 12), (1e4, 12)):
        assert len(merge_stretches(single(residual, 8)[0], time).counts) == stretches
    # Eleven say nothing.
    assert scatter_scores(*single(residual, 960 // 12), 1.0) is not None
    assert scatter_scores(*single(residual[:880], 880 // 11), 1.0) is None


def test_intervals_of_few_stretches_are_students():
    residual = default_rng(0).normal(size=960)
    found = scatter_scores(*single(residual, 8), 16.0)
    factor = t.ppf(0.975, 11) / norm.ppf(0.975)
    assert factor == pytest.approx(1.123, abs=1e-3)
    assert_allclose(found.widened, found.sd * factor)


def test_scores_weigh_actuators_as_the_fit_does():
    """With the noisy actuator's weight next to none, the other's rows alone say how far off."""
    W, tau = rows(960, noise=(0.1, 100.0))
    both = gather(W, tau, size=8)
    one = gather(W[:, :1], tau[:, :1], size=8)
    many, few = (scatter_scores(i, estimate(i), 1.0) for i in (both, one))
    # The white variance that both are compared with is known to √(2/960) = 4.6 %.
    assert_allclose(many.sd, few.sd, rtol=0.05)


def test_scores_of_what_is_not_determined_are_infinitely_uncertain():
    W, tau = rows()
    information = gather(np.concatenate([W, W[:, :, :1]], axis=2), tau, size=8)
    found = scatter_scores(information, estimate(information), 1.0)
    assert_array_equal(np.isfinite(found.sd), [False, True, True, False])
