"""Least squares from compressed numbers: values, spread, and what is not determined."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import estimate

from .made import gather


@pytest.fixture(scope="module")
def rows():
    """Three columns, two actuators of which the second is ten times noisier."""
    rng = default_rng(0)
    W = rng.normal(size=(160, 2, 3))
    return W, W @ [1.0, -2.0, 0.5] + rng.normal(size=(160, 2)) * [0.1, 1.0]


def weighted(W, tau, weights):
    root = np.sqrt(weights)
    flat = (W * root[:, None]).reshape(-1, W.shape[2])
    right = (tau * root).ravel()
    x = np.linalg.lstsq(flat, right, rcond=None)[0]
    return x, right - flat @ x, flat


def test_actuators_are_weighted_by_their_own_residual_variance(rows):
    information = gather(*rows)
    plain = estimate(information, "ols")
    fit = estimate(information, "wls")
    residual = rows[1] - rows[0] @ plain.value
    # Each of two actuators pays for half of three parameters.
    variance = (residual**2).sum(0) / (160 - 1.5)
    few = estimate(gather(*rows, size=40))  # of four blocks of time nobody knows what is slow
    assert_allclose(few.variance, variance, rtol=1e-9)
    assert_allclose(few.weights, variance.mean() / variance, rtol=1e-9)
    density = fit.variance * fit.times
    assert_allclose(fit.weights, density.mean() / density, rtol=1e-9)
    # Times that do not differ are one; of 20 blocks white noise's is known to 30 %.
    assert fit.times[0] == pytest.approx(fit.times[1])
    assert 1.0 <= fit.times[0] < 1.6
    assert_allclose(fit.variance, [0.01, 1.0], rtol=0.35)
    x, residual, flat = weighted(*rows, fit.weights)
    assert_allclose(fit.value, x, rtol=1e-9)
    sigma2 = residual @ residual / (320 - 3 * fit.times[0])
    assert_allclose(fit.covariance, sigma2 * np.linalg.inv(flat.T @ flat), rtol=1e-8)
    assert_allclose(fit.rss, ((rows[1] - rows[0] @ x) ** 2).sum(0), rtol=1e-9)
    assert abs(fit.value[0] - 1) < abs(plain.value[0] - 1)


def test_the_condition_is_that_of_columns_of_equal_length(rows):
    W, tau = rows
    for units in (np.ones(3), np.array([1e3, 1.0, 1e-3])):
        fit = estimate(gather(W * units, tau), "ols")
        flat = W.reshape(-1, 3)
        scaled = np.linalg.svd(flat / np.linalg.norm(flat, axis=0), compute_uv=False)
        assert fit.condition == pytest.approx(scaled[0] / scaled[-1], rel=1e-6)


def test_dependent_columns_are_dropped_and_have_no_variance_that_could_be_believed(rows):
    """p3 repeats p1, p4 never acts: p1 is known only together with p3, p0 and p2 by themselves."""
    W, tau = rows
    more = np.concatenate([W, 3 * W[:, :, 1:2], 0 * W[:, :, :1]], axis=2)
    fit = estimate(gather(more, tau), "ols")
    alone = estimate(gather(W, tau), "ols")
    assert fit.kept == (0, 1, 2)
    assert_array_equal(fit.determined, [True, False, True, False, False])
    assert_allclose(fit.value, [*alone.value, 0, 0], rtol=1e-7)
    assert_allclose(fit.sigma[[0, 2]], alone.sigma[[0, 2]], rtol=1e-7)
    assert np.isinf(fit.sigma[[1, 3, 4]]).all()
    assert np.isinf(fit.sigma_percent[[1, 3, 4]]).all()


@pytest.mark.parametrize("share", [0.2, 1e-3, 1e-5])
def test_a_column_that_enters_a_dropped_one_ever_so_little_is_not_told_apart(rows, share):
    W, tau = rows
    mixed = W[:, :, :1] + share * W[:, :, 1:2]
    fit = estimate(gather(np.concatenate([W, mixed], axis=2), tau), "ols")
    assert_array_equal(fit.determined, [False, False, True, False])


def test_dependence_is_counted_in_columns_of_unit_length(rows):
    W, tau = rows
    W = np.concatenate([W, 2 * W[:, :, :1] + 0 * W[:, :, 1:2], 0 * W[:, :, :1]], axis=2)
    W[:, :, 1] *= 1e3
    leans = estimate(gather(W, tau), "ols").open
    assert_allclose(leans, [[-1, 0], [0, 0], [0, 0], [1, 0], [0, 1]], atol=1e-7)


def test_columns_that_lean_on_each_other_to_the_eighth_digit_count_as_one(rows):
    W, tau = rows
    for apart, count in ((1e-6, 4), (1e-9, 3)):
        near = W[:, :, :1] + apart * default_rng(1).normal(size=(160, 2, 1))
        fit = estimate(gather(np.concatenate([W, near], axis=2), tau), "ols")
        assert len(fit.kept) == count
