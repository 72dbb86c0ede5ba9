"""Autoregressive noise against dense covariance matrices."""

import numpy as np
import pytest
from scipy.linalg import block_diag, toeplitz
from scipy.signal import lfilter

from identifiability.estimation.noise import (
    BOUND,
    ARNoise,
    JointNoise,
    RestrictedLikelihood,
    autocovariance,
    durbin,
    fit_joint,
    fit_noise,
    levinson,
    span_columns,
    whiten,
)

PACF = np.array([0.6, -0.3])
RUNS = [(0, 25), (25, 27), (27, 70)]


def covariance(pacf, runs, floor=0.0):
    """Dense covariance (N, N) of unit innovations: runs know nothing of each other."""
    return block_diag(*(toeplitz(autocovariance(pacf, b - a - 1)) for a, b in runs))


def test_autocovariances_are_those_of_the_recursion_written_out():
    """AR(2): φ1 = r1(1 − r2), φ2 = r2; γ0 = 1/((1 − r1²)(1 − r2²))."""
    r1, r2 = PACF
    phi = [r1 * (1 - r2), r2]
    np.testing.assert_allclose(levinson(PACF)[0][2], phi)
    gamma = [1 / ((1 - r1**2) * (1 - r2**2))]
    gamma.append(r1 * gamma[0])
    for _ in range(4):
        gamma.append(phi[0] * gamma[-1] + phi[1] * gamma[-2])
    np.testing.assert_allclose(autocovariance(PACF, 5), gamma)
    pacf, sigma = durbin(4.0 * np.array(gamma))
    np.testing.assert_allclose(pacf, [r1, r2, 0, 0, 0], atol=1e-12)
    assert sigma == pytest.approx(2.0)


def test_whitened_rows_have_unit_covariance():
    V = covariance(PACF, RUNS)
    A = whiten(np.eye(70), RUNS, PACF)
    np.testing.assert_allclose(A @ V @ A.T, np.eye(70), atol=1e-10)


def test_the_restricted_likelihood_is_that_of_what_no_column_can_explain():
    """−2 log of the density of contrasts Kᵀy, σ profiled out, up to a constant [Harville 1977]."""
    rng = np.random.default_rng(0)
    basis = np.linalg.qr(rng.standard_normal((70, 5)))[0]
    K = np.linalg.svd(basis, full_matrices=True)[0][:, 5:]
    y = np.cumsum(rng.standard_normal(70))
    problem = RestrictedLikelihood.of(y, basis, RUNS, floor=0.0)
    assert problem.dof == 65

    def exact(pacf):
        V = K.T @ covariance(pacf, RUNS) @ K
        x = K.T @ y
        square = x @ np.linalg.solve(V, x)
        return 65 * np.log(square) + np.linalg.slogdet(V)[1], np.sqrt(square / 65)

    points = [PACF, np.array([0.9, 0.1]), np.array([-0.5, 0.7])]
    found = [problem.deviance(np.arctanh(p)) for p in points]
    wanted, sigmas = zip(*(exact(p) for p in points), strict=True)
    np.testing.assert_allclose(np.diff(found), np.diff(wanted), rtol=1e-6)
    sizes = [problem.sigma(np.arctanh(p)) for p in points]
    np.testing.assert_allclose(sizes, sigmas, rtol=1e-6)
    # Of white noise: the residual's variance.
    left = K.T @ y
    assert problem.sigma(np.empty(0)) == pytest.approx(np.sqrt(left @ left / 65))
    assert problem.left == pytest.approx(left @ left / 65)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1.0, 1e9])
def test_rounding_has_no_order(size):
    rng, t = np.random.default_rng(4), np.linspace(0, 1, 300)
    basis = np.linalg.qr(np.sin(np.outer(t, 2 * np.arange(1, 9)) + rng.uniform(0, 6, 8)))[0]
    y = size * basis @ rng.standard_normal(8)
    problem = RestrictedLikelihood.of(y, basis, [(0, 100), (105, 300)])
    assert problem.silent
    assert len(problem.maximise()) == 0
    problem = RestrictedLikelihood.of(y + 1e-6 * (size + 1) * rng.standard_normal(300), basis, RUNS)
    assert not problem.silent


def test_the_order_and_the_coefficients_of_a_long_series_are_found():
    rng = np.random.default_rng(2)
    n = 6000
    x = lfilter([2.0], [1, -levinson(PACF)[0][2][0], -levinson(PACF)[0][2][1]],
                rng.standard_normal(n + 200))[200:]  # fmt: skip
    noise = fit_joint(x, [np.ones((n, 1))], [(0, n)])
    # White noise of 5 % of the variance is taken to be there as well: a bias towards zero.
    assert noise.pacf[0] == pytest.approx(0.6 / 1.05, abs=0.03)
    assert noise.pacf[1] < -0.15
    sd = np.sqrt(np.diag(noise.covariance))
    assert sd[0] == pytest.approx(1 / np.sqrt(n), rel=0.3)  # Fisher's z
    assert noise.dof == n - 1
    plain = fit_joint(rng.standard_normal(n), [np.ones((n, 1))], [(0, n)])
    assert len(plain.theta) == 0
    assert plain.sigma == pytest.approx(1.0, rel=0.05)


def test_slow_drifts_are_held_to_the_slowest_noise_that_there_is():
    y = np.linspace(-1, 1, 400) ** 3
    noise = fit_joint(y, [np.ones((400, 1))], [(0, 400)])
    assert np.abs(noise.theta).max() <= BOUND
    rng = np.random.default_rng(0)
    wild = JointNoise(theta=np.array([3.4]), covariance=np.array([[4.0]]), sigma=1.0, dof=50.0,
                      left=1.0)  # fmt: skip
    drawn = np.array([wild.draw(rng)[0][0] for _ in range(50)])
    assert np.abs(drawn).max() <= np.tanh(BOUND)


def test_noise_is_drawn_as_uncertain_as_it_is_known():
    """θ normal about its estimate; σ² like dof / χ²."""
    rng = np.random.default_rng(1)
    noise = JointNoise(theta=np.array([0.5]), covariance=np.array([[0.04]]), sigma=3.0, dof=8.0,
                       left=9.0)  # fmt: skip
    drawn = [noise.draw(rng) for _ in range(4000)]
    theta, sigma = np.arctanh([p[0] for p, _ in drawn]), np.array([s for _, s in drawn])
    assert np.mean(theta) == pytest.approx(0.5, abs=0.02)
    assert np.std(theta) == pytest.approx(0.2, rel=0.05)
    assert np.mean(9.0 / sigma**2) == pytest.approx(1.0, abs=0.04)  # mean of χ²/dof
    assert np.var(9.0 / sigma**2) == pytest.approx(2 / 8, rel=0.15)


@pytest.mark.parametrize("misfit", [0.0, 5.0])
def test_a_misfit_is_white_noise_on_top(misfit):
    noise = JointNoise(theta=np.arctanh(PACF), covariance=np.eye(2), sigma=2.0, dof=9.0, left=1.0)
    pacf, sigma = noise.beside(misfit)
    total = sigma**2 * autocovariance(pacf, 8)
    expected = 4.0 * autocovariance(PACF, 8)
    expected[0] += misfit
    np.testing.assert_allclose(total, expected, atol=1e-10)
    alone = ARNoise((noise,)).whiten(np.eye(70)[:, None], RUNS, np.array([misfit]))[:, 0]
    V = 4.0 * covariance(PACF, RUNS) + misfit * np.eye(70)
    # The filter has eight coefficients: all but what it cuts off is white.
    np.testing.assert_allclose(alone @ V @ alone.T, np.eye(70), atol=1e-2)


def test_what_is_no_more_than_twice_what_noise_leaves_is_no_misfit():
    noise = JointNoise(theta=np.zeros(1), covariance=np.eye(1), sigma=2.0, dof=9.0, left=4.0)
    residual = np.full((50, 2), [np.sqrt(7.9), 5.0])
    np.testing.assert_allclose(ARNoise((noise, noise)).misfit(residual), [0.0, 25.0 - 8.0])
    half = np.array([25, 50])  # rows that are data
    np.testing.assert_allclose(ARNoise((noise, noise)).misfit(residual, half), [7.8, 17.0])


def test_simulated_noise_starts_anew_at_every_gap_and_in_every_joint():
    joints = tuple(
        JointNoise(theta=np.arctanh([0.95]), covariance=np.array([[1e-6]]), sigma=s, dof=1e6,
                   left=s**2)
        for s in (1.0, 10.0)
    )  # fmt: skip
    x = ARNoise(joints).simulate(40, 3000, np.random.default_rng(0), [(0, 20), (20, 40)])
    assert x.shape == (40, 2, 3000)
    correlation = np.corrcoef(x[[18, 19, 20, 21], 0])
    assert correlation[0, 1] == pytest.approx(0.95, abs=0.02)
    assert correlation[2, 3] == pytest.approx(0.95, abs=0.02)
    assert abs(correlation[1, 2]) < 0.08  # across the gap
    assert abs(np.corrcoef(x[5, 0], x[5, 1])[0, 1]) < 0.08  # across joints
    stationary = 1 / np.sqrt(1 - 0.95**2)
    for j, s in enumerate((1.0, 10.0)):
        for row in (0, 20, 39):
            assert np.std(x[row, j]) == pytest.approx(s * stationary, rel=0.06)


def test_a_dictionary_may_take_at_most_45_per_cent_of_a_joints_rows():
    rng = np.random.default_rng(0)
    y, n = rng.standard_normal((60, 1)), 60
    first, second = rng.standard_normal((n, 1, 20)), rng.standard_normal((n, 1, 30))
    found = fit_noise(y, lambda j: [first[:, j], second[:, j]], [(0, n)]).joints[0]
    assert found.dof == n - 27
    assert fit_noise(y, lambda j: [first[:, j]], [(0, n)]).joints[0].dof == n - 20
    # What is in the columns is not noise: a large effect of the dictionary is not taken for it.
    big = y[:, 0] + 100 * first[:, 0, 0]
    left = fit_noise(big[:, None], lambda j: [first[:, j]], [(0, n)]).joints[0].left
    assert left == pytest.approx(fit_noise(y, lambda j: [first[:, j]], [(0, n)]).joints[0].left)
    twice = np.concatenate([first, first], axis=2)  # the same columns again take nothing more
    assert fit_noise(y, lambda j: [first[:, j], twice[:, j]], [(0, n)]).joints[0].dof == n - 20


@pytest.mark.parametrize("samples", [50, 426])
def test_what_columns_span_is_orthonormal_however_alike_they_are(samples):
    """And directions below what is told from rounding are left to the noise."""
    rng = np.random.default_rng(3)
    four = rng.standard_normal((samples, 4))
    alike = four @ rng.standard_normal((4, 66))
    noisy = alike + 1e-6 * rng.standard_normal(alike.shape)
    basis = span_columns(
        [four[:, :1], noisy, rng.standard_normal((samples, 5))], int(0.45 * samples)
    )
    assert basis.shape[1] == 9
    np.testing.assert_allclose(basis.T @ basis, np.eye(9), atol=1e-8)
    np.testing.assert_allclose(basis @ (basis.T @ alike), alike, atol=1e-4)
