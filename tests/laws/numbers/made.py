"""Regressions, estimates and prediction errors made of numbers: no robot, no log."""

import numpy as np
from scipy.signal import lfilter

from identifiability import Estimate, Information
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.fit import Fit


def gather(W, tau, size=8, logs=(), columns=()):
    """Return the information of a regressor (N, n, k) and torque (N, n).

    Blocks have `size` samples; `logs` are the numbers of samples of each log.
    """
    N, _, k = W.shape
    names = tuple(columns) or tuple(f"p{j}" for j in range(k))
    log = np.repeat(np.arange(len(logs) or 1), logs or (N,))
    return Information.of_rows(names, W, tau, log, size)


def fit_of(value, sigma, determined=None):
    """Return an estimate with these values and white-noise standard deviations."""
    value = np.asarray(value, float)
    sigma = np.asarray(sigma, float)
    k = len(value)
    known = np.ones(k, bool) if determined is None else np.asarray(determined, bool)
    return Estimate(
        columns=tuple(f"p{j}" for j in range(k)),
        value=value,
        covariance=np.diag(np.where(known, sigma**2, np.inf)),
        determined=known,
        kept=tuple(np.flatnonzero(known).tolist()),
        variance=np.ones(1),
        rss=np.full(1, 100.0),
        rows=np.full(1, 100 + known.sum()),
        open=np.eye(k)[:, ~known],
        condition=1.0,
        weights=np.ones(1),
        times=np.ones(1),
        estimator=Estimator(weighted=False),
    )


def fit_known(estimate, scores=None, *, noise=1.0, **terms):
    """Return what is known of an estimate, of columns of rms 3 and of so much of the residual."""
    k = len(estimate.columns)
    each = np.broadcast_to(noise, k).astype(float)
    return Fit(estimate=estimate, column_rms=np.full(k, 3.0), column_noise=each, scores=scores,
               **terms)  # fmt: skip


def score_of(held, fit, M=None):
    """Return what a model, fitted to each fold's rest, predicts of the folds."""
    return held.score(held.refit(fit, M), held.roots(fit, M))


def ar1(rng, rho, samples, columns=1):
    """Return first-order autoregressive noise of unit variance, (samples, columns)."""
    noise = rng.standard_normal((samples, columns))
    noise[1:] *= np.sqrt(1 - rho**2)
    return lfilter([1.0], [1.0, -rho], noise, axis=0)
