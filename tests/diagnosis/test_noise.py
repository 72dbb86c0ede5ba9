"""The noise model: laws of its filters, and no bias beside many columns."""

import numpy as np

from identifiability.estimation.noise import (
    JointRuns,
    autocovariance,
    colour,
    fit_residual_noise,
    levinson,
    whiten,
)
from identifiability.simulation.simulator import ar1

PACF = np.array([0.7, -0.4, 0.2])
RUNS = [(0, 40), (40, 90), (90, 92)]


def test_whitening_undoes_colouring_on_every_stretch():
    e = np.random.default_rng(0).standard_normal(92)
    x = np.concatenate([colour(e[a:b], PACF) for a, b in RUNS])
    np.testing.assert_allclose(whiten(x, RUNS, PACF), e, atol=1e-12)


def test_whitening_treats_columns_as_it_treats_the_torque():
    x = np.random.default_rng(0).standard_normal((92, 2))
    both = whiten(x, RUNS, PACF)
    np.testing.assert_allclose(both[:, 1], whiten(x[:, 1], RUNS, PACF))


def test_one_step_predictors_satisfy_the_yule_walker_equations():
    covariance = autocovariance(PACF, 6)
    a = levinson(PACF)[0][-1]
    np.testing.assert_allclose(covariance[4], a @ covariance[[3, 2, 1]])


def test_coloured_noise_is_stationary_from_its_first_sample():
    rng = np.random.default_rng(0)
    x = np.stack([colour(rng.standard_normal(20), np.array([0.95])) for _ in range(4000)])
    variance = 1 / (1 - 0.95**2)
    error = variance * np.sqrt(2 / 4000)
    assert abs(x[:, 0].var() - variance) < 4 * error
    assert abs(x[:, -1].var() - variance) < 4 * error


def test_slow_noise_is_not_taken_for_fast_noise_beside_many_smooth_columns():
    """Least squares swallows slow noise; the restricted likelihood knows that it did."""
    rng = np.random.default_rng(1)
    runs = [(90 * k, 90 * (k + 1)) for k in range(4)]
    t = np.arange(360)
    columns = np.column_stack([np.cos(np.pi * k * (t + 0.5) / 360) for k in range(60)])
    naive, fitted = [], []
    for _ in range(20):
        y = np.concatenate([ar1((90,), 0.8, rng) for _ in range(4)])
        left = y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]
        naive.append(left[1:] @ left[:-1] / (left @ left))
        noise = fit_residual_noise(y[:, None], columns[:, None], JointRuns((tuple(runs),)))
        covariance = autocovariance(noise.pacf[0], 1)
        fitted.append(covariance[1] / covariance[0])
    assert np.mean(naive) < 0.6
    assert abs(np.mean(fitted) - 0.8) < 0.06
