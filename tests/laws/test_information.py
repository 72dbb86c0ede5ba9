"""Compression loses nothing: the information gives what all rows give, however it was gathered."""

import tracemalloc

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    Information,
    Regression,
    estimate,
    find_base_parameters,
    gather_information,
    prepare_log,
)


@pytest.fixture
def base(rps, paper_model):
    return find_base_parameters(rps, paper_model)


@pytest.fixture
def regression(rps, paper_model, base, noisy_log):
    return Regression(rps, paper_model, (prepare_log(rps, noisy_log),), base.kept)


@pytest.fixture
def rows(regression):
    parts = list(regression.chunks())
    W = np.concatenate([part.W for part in parts])
    tau = np.concatenate([part.tau for part in parts])
    return W, tau


WEIGHTS = np.array([1.0, 0.1, 4.0])
M = np.array([[1, 0], [1, 0], [0, 1.0], [0, 0], [0, 1]])
HELD = np.array([0, 0, 0, 3.0, 0])


def test_values_are_least_squares_on_all_rows_and_sigma_is_that_of_khalil_and_dombre(
    regression, rows
):
    W, tau = rows
    flat = W.reshape(-1, W.shape[2])
    expected, rss, _, _ = np.linalg.lstsq(flat, tau.ravel(), rcond=None)
    fit = estimate(gather_information(regression), "ols")
    assert_allclose(fit.value, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert fit.rss.sum() == pytest.approx(rss[0], rel=1e-10)
    residual = tau.ravel() - flat @ fit.value
    assert fit.dof == gather_information(regression).rows - flat.shape[1]
    variance = residual @ residual / fit.dof
    sigma = np.sqrt(variance * np.diag(np.linalg.inv(flat.T @ flat)))
    assert_allclose(fit.sigma, sigma, rtol=1e-6)
    assert_allclose(fit.sigma_percent, 100 * sigma / np.abs(fit.value), rtol=1e-6)


def test_chunks_and_blocks_do_not_matter(regression):
    whole = gather_information(regression)
    few = gather_information(regression, blocks=7)
    assert len(few.counts) <= 7
    grams = [R.T @ R for R in (few.factor(), whole.factor())]
    assert_allclose(*grams, rtol=1e-10, atol=1e-10 * np.abs(grams[1]).max())
    # What is slow is seen from blocks, so weights may differ a little; not as much as matters.
    a = estimate(whole)
    b = estimate(gather_information(regression, blocks=75))
    assert (np.abs(a.value - b.value) < 0.1 * a.sigma).all()


def seen_rows():
    """Rows of three actuators: the second sees two columns of five, the third the last alone."""
    rng = default_rng(3)
    W = rng.normal(size=(600, 3, 5))
    W[:, 1, 2:] = 0.0
    W[:, 2, :4] = 0.0
    tau = W @ [1.0, -2.0, 0.5, 3.0, 0.1] + rng.normal(size=(600, 3)) * [0.1, 1.0, 0.3]
    return W, tau


def test_refits_of_joints_that_share_no_column_hold_the_equations_of_one_at_a_time():
    W = default_rng(0).normal(size=(400, 30, 150)) * np.tile(np.eye(30), 5)
    whole = Information.of_rows("c" * 150, W, W.sum(2), np.zeros(400), 20)
    fit = estimate(whole)
    tracemalloc.start()
    values = fit.estimator.refit(whole, fit, whole.counts[None])
    assert tracemalloc.get_traced_memory()[1] < 3.6e6  # bytes of 20 blocks
    tracemalloc.stop()
    assert_allclose(values[0], fit.value)


@pytest.mark.parametrize("instrumented", [False, True])
@pytest.mark.parametrize("size", [2, 50])  # few samples a block, and more than columns
def test_every_view_of_blocks_over_seen_columns_equals_the_rows(size, instrumented):
    """Whether a second record of the motion stands beside the columns or not."""
    W, tau = seen_rows()
    log = np.repeat([0, 1], 300)
    second = np.sin(W) if instrumented else None
    information = Information.of_rows("abcde", W, tau, log, size, second)
    own = [p.columns[p.columns < 5].tolist() for p in information.parts]
    assert own == [[0, 1, 2, 3, 4], [0, 1], [4]]
    reduced = information.reduce(M, "xy", HELD)
    assert [p.columns[p.columns < 2].tolist() for p in reduced.parts] == [[0, 1], [0], [1]]
    merged = information.merge(np.arange(0, 600 // size, 3))
    rows = np.concatenate([W, tau[:, :, None]], 2)
    fewer = np.concatenate([W @ M, (tau - W @ HELD)[:, :, None]], 2)
    for found, Z in (
        (information, rows),
        (reduced, fewer),
        (merged, rows),
    ):
        every = np.eye(Z.shape[2])
        expected = np.einsum("a,tai,taj->ij", WEIGHTS, Z, Z)
        scale = {"rtol": 1e-10, "atol": 1e-9 * np.abs(expected).max()}
        R = found.factor(WEIGHTS)
        assert_allclose(R.T @ R, expected, **scale)
        assert_array_equal(np.tril(R, -1), 0.0)
        blocks = found.products(WEIGHTS, every, every)
        ends = np.cumsum(found.counts)
        sums = [part.sums @ own for part, own in found.of_actuators(every)]
        for k, (stop, count) in enumerate(zip(ends, found.counts, strict=True)):
            own = Z[stop - count : stop]
            inside = np.einsum("a,tai,taj->ij", WEIGHTS, own, own)
            assert_allclose(blocks[k], inside, **scale)
            assert_allclose([x[k] for x in sums], own.sum(0), **scale)
        squares = np.einsum("tai,tai->ai", Z, Z)
        assert_allclose(found.squares(every), squares, **scale)
