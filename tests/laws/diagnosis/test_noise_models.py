"""Autoregressive noise against dense covariance matrices."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.linalg import block_diag, toeplitz
from scipy.optimize import minimize
from scipy.signal import lfilter

from identifiability.estimation.noise import (
    BOUND,
    JointRuns,
    RestrictedLikelihood,
    levinson,
    rich_noise,
    span_columns,
    whiten,
)
from identifiability.workflows.calibrate.world import fit_residual_noise

PACF = np.array([0.6, -0.3])
RUNS = [(0, 25), (25, 29), (29, 70)]


def autocovariance(pacf, most):
    """Return autocovariances at lags 0 … most for unit innovations, by the recursion."""
    predictors, variances = levinson(pacf)
    out = [variances[0]]
    for k in range(1, most + 1):
        if k > len(pacf):
            out.append(predictors[-1] @ out[: -len(pacf) - 1 : -1] if len(pacf) else 0.0)
        else:  # the last partial autocorrelation of an order gives the next lag [Levinson 1947]
            out.append(pacf[k - 1] * variances[k - 1] + predictors[k - 1] @ out[:0:-1])
    return np.array(out)


def covariance(pacf, runs):
    """Dense covariance (N, N) of unit innovations: runs know nothing of each other."""
    return block_diag(*(toeplitz(autocovariance(pacf, b - a - 1)) for a, b in runs))


def test_autocovariances_are_those_of_the_recursion_written_out():
    """AR(2): φ1 = r1(1 − r2), φ2 = r2; γ0 = 1/((1 − r1²)(1 − r2²))."""
    r1, r2 = PACF
    phi = [r1 * (1 - r2), r2]
    assert_allclose(levinson(PACF)[0][2], phi)
    gamma = [1 / ((1 - r1**2) * (1 - r2**2))]
    gamma.append(r1 * gamma[0])
    for _ in range(4):
        gamma.append(phi[0] * gamma[-1] + phi[1] * gamma[-2])
    assert_allclose(autocovariance(PACF, 5), gamma)


def test_whitened_rows_have_unit_covariance():
    V = covariance(PACF, RUNS)
    A = whiten(np.eye(70), RUNS, PACF)
    assert_allclose(A @ V @ A.T, np.eye(70), atol=1e-10)


def test_the_restricted_likelihood_is_that_of_what_no_column_can_explain(rng):
    """−2 log of the density of contrasts Kᵀy, σ profiled out, up to a constant [Harville 1977]."""
    basis = np.linalg.qr(rng.standard_normal((70, 5)))[0]
    K = np.linalg.svd(basis, full_matrices=True)[0][:, 5:]
    y = np.cumsum(rng.standard_normal(70))
    problem = RestrictedLikelihood(y, basis, RUNS, floor=0.0)
    of = problem.profile(np.empty(0))

    def exact(pacf):
        V = K.T @ covariance(pacf, RUNS) @ K
        x = K.T @ y
        square = x @ np.linalg.solve(V, x)
        return 65 * np.log(square) + np.linalg.slogdet(V)[1], np.sqrt(square / 65)

    points = [PACF, np.array([0.9, 0.1]), np.array([-0.5, 0.7])]
    found = [of(np.arctanh(p))[0] for p in points]
    wanted, sigmas = zip(*(exact(p) for p in points), strict=True)
    assert_allclose(np.diff(found), np.diff(wanted), rtol=1e-6)
    sizes = [of(np.arctanh(p))[2] for p in points]
    assert_allclose(sizes, sigmas, rtol=1e-6)
    # Its slope is that of its differences.
    steps = 1e-5 * np.eye(2)
    ways = [(of(np.arctanh(PACF) + h)[0] - of(np.arctanh(PACF) - h)[0]) / 2e-5 for h in steps]
    assert_allclose(of(np.arctanh(PACF))[1], ways, rtol=1e-4)
    # Of white noise: the residual's variance.
    left = K.T @ y
    assert of(np.empty(0))[2] == pytest.approx(np.sqrt(left @ left / 65))


@pytest.mark.parametrize("size", [0.0, 1e-12, 1.0, 1e9])
def test_rounding_has_no_order(size):
    rng = default_rng(4)
    t = np.linspace(0, 1, 300)
    basis = np.linalg.qr(np.sin(np.outer(t, 2 * np.arange(1, 9)) + rng.uniform(0, 6, 8)))[0]
    y = size * basis @ rng.standard_normal(8)
    problem = RestrictedLikelihood(y, basis, [(0, 100), (105, 300)])
    assert problem.rounding
    problem = RestrictedLikelihood(y + 1e-6 * (size + 1) * rng.standard_normal(300), basis, RUNS)
    assert not problem.rounding


def test_the_order_and_the_coefficients_of_a_long_series_are_found():
    rng = default_rng(2)
    n = 6000
    x = lfilter([2.0], [1, -levinson(PACF)[0][2][0], -levinson(PACF)[0][2][1]],
                rng.standard_normal(n + 200))[200:]  # fmt: skip
    noise = fit_residual_noise(x[:, None], np.ones((n, 1, 1)), JointRuns((((0, n),),)))
    assert_allclose(noise[0].pacf, PACF[:2], atol=0.03)
    plain = fit_residual_noise(
        rng.standard_normal((n, 1)), np.ones((n, 1, 1)), JointRuns((((0, n),),))
    )
    assert len(plain[0].pacf) == 0
    assert plain[0].sigma ** 2 == pytest.approx(1.0, rel=0.05)


def test_of_two_optima_the_better_one_counts_whatever_rounding_says():
    """Of few rows about a rich model, the path of rising orders alone missed it by 7."""
    rng = default_rng(28)
    waves = np.outer(np.linspace(0, 1, 60), 2 * np.arange(1, 26)) + rng.uniform(0, 6, 25)
    basis = np.linalg.qr(np.sin(waves))[0]
    a = levinson(np.array([0.95, -0.7, 0.7, -0.6]))[0][-1]
    y = lfilter([1.0], [1, *-a], rng.standard_normal(260))[200:]
    problem = RestrictedLikelihood(y, basis, [(0, 60)])
    of, found = problem.profile(np.empty(0)), problem.maximise(np.empty(0))
    assert of(found)[0] < 0.1 + minimize(lambda x: of(x)[0], np.zeros(len(found))).fun


def test_slow_drifts_are_held_to_the_slowest_noise_that_there_is():
    y = np.linspace(-1, 1, 400) ** 3
    noise = fit_residual_noise(y[:, None], np.ones((400, 1, 1)), JointRuns((((0, 400),),)))
    assert np.abs(noise[0].pacf).max() <= np.tanh(BOUND)


@pytest.mark.parametrize("samples", [50, 426])
def test_what_columns_span_is_orthonormal_however_alike_they_are(samples):
    """And directions below what is told from rounding are left to the noise."""
    rng = default_rng(3)
    four = rng.standard_normal((samples, 4))
    alike = four @ rng.standard_normal((4, 66))
    noisy = alike + 1e-6 * rng.standard_normal(alike.shape)
    basis = span_columns(
        np.hstack([four[:, :1], noisy, rng.standard_normal((samples, 5))]), int(0.45 * samples)
    )
    assert basis.shape[1] == 9
    assert_allclose(basis.T @ basis, np.eye(9), atol=1e-8)
    assert_allclose(basis @ (basis.T @ alike), alike, atol=1e-4)
    assert span_columns(rng.standard_normal((samples, samples)), 27).shape[1] == 27


def test_candidates_as_many_as_rows_are_left_out():
    rng = default_rng(5)
    y, *blocks = (rng.standard_normal((60, k)) for k in (1, 5, 50))
    few, many = (rich_noise(blocks[:k], y[:, 0], [(0, 60)]).sigma for k in (1, 2))
    assert many == few
