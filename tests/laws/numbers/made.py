"""Regressions, estimates and prediction errors made of numbers: no robot, no log."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.least_squares import OrdinaryLeastSquares
from identifiability.foundation.linalg import triangular_factor
from identifiability.regression.information import Information


def gather(W, tau, size: int = 8, logs=(), columns=()) -> Information:
    """Return the information of a regressor (N, n, k) and torque (N, n).

    Blocks have `size` samples; `logs` are the numbers of samples of each log.
    """
    N, _, k = W.shape
    Z = np.concatenate([W, tau[:, :, None]], axis=2)
    flat = Z.reshape(-1, k + 1)
    # Columns that never act or lean on others must not spoil the basis.
    floor = 1e-6 * np.diag(np.maximum(np.linalg.norm(flat, axis=0), 1e-3))
    basis = triangular_factor(np.vstack([flat, floor]))
    Z = Z @ np.linalg.inv(basis)
    at, start = [], 0
    for log, count in enumerate(logs or (N,)):
        stop = start + count
        at += [(log, s, min(s + size, stop)) for s in range(start, stop, size)]
        start = stop
    return Information(
        tuple(columns) or tuple(f"p{j}" for j in range(k)),
        basis,
        np.array([np.einsum("tai,taj->aij", Z[a:b], Z[a:b]) for _, a, b in at]),
        np.array([b - a for _, a, b in at]),
        np.array([log for log, _, _ in at]),
    )


def fit_of(value, sigma, determined=None, weights=(1.0,), rss=(100.0,), columns=()) -> Estimate:
    """Return an estimate with these values and white-noise standard deviations."""
    value, sigma = np.asarray(value, float), np.asarray(sigma, float)
    k = len(value)
    known = np.ones(k, bool) if determined is None else np.asarray(determined, bool)
    rss = np.asarray(rss, float)
    return Estimate(
        columns=tuple(columns) or tuple(f"p{j}" for j in range(k)),
        value=value,
        covariance=np.diag(np.where(known, sigma**2, np.inf)),
        determined=known,
        kept=tuple(np.flatnonzero(known).tolist()),
        variance=rss / 100,
        rss=rss,
        dof=100,
        condition=1.0,
        singular_values=np.ones(k),
        weights=np.asarray(weights, float),
        estimator=OrdinaryLeastSquares(),
    )


def ar1(rng, rho: float, samples: int, columns: int = 1):
    """Return first-order autoregressive noise of unit variance, (samples, columns)."""
    noise = rng.standard_normal((samples, columns))
    for k in range(1, samples):
        noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho**2) * noise[k]
    return noise
