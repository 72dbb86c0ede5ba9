"""Autoregressive series by their partial autocorrelations: predict, whiten, colour.

Any partial autocorrelations inside (-1, 1) make a stationary series [Monahan 1984]; innovations
have unit variance throughout.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

Runs = Sequence[tuple[int, int]]


@frozen
class JointRuns:
    """Stretches of samples by joint, as (start, stop): between them its torque is no data.

    Attributes
    ----------
    each : tuple of Runs, (n,)
    """

    each: tuple[Runs, ...]

    @staticmethod
    def of(runs: Runs, data: np.ndarray) -> JointRuns:
        """Return the parts of stretches at which torque of each joint is `data` (N, n)."""
        if data.all():
            return JointRuns((runs,) * data.shape[1])
        return JointRuns(tuple(_data_runs(runs, own) for own in data.T))


def _data_runs(runs: Runs, data: np.ndarray) -> Runs:
    out: list[tuple[int, int]] = []
    for start, stop in runs:
        edges = start + np.flatnonzero(np.diff(data[start:stop], prepend=False, append=False))
        out += zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return out


def take_data(runs: Runs, y: Array, *others: Array) -> tuple[Runs, list[Array]]:
    """Return rows (N, …) that lie in stretches, and the stretches among them."""
    if sum(stop - start for start, stop in runs) == len(y):
        return runs, [y, *others]
    inside = np.concatenate([np.arange(0), *(np.arange(a, b) for a, b in runs)])
    ends = np.cumsum([0, *(b - a for a, b in runs)]).tolist()
    return list(pairwise(ends)), [x[inside] for x in (y, *others)]


def runs_of(runs: Runs | JointRuns, joint: int) -> Runs:
    """Return the stretches of a joint."""
    return runs.each[joint] if isinstance(runs, JointRuns) else runs


def levinson(pacf: Array) -> tuple[list[Array], Array]:
    """Return predictors of order 0 … p and their error variances, the last one 1.

    Parameters
    ----------
    pacf : (p,) or (p, B)
        Partial autocorrelations, of several series side by side.
    """
    predictors = [np.empty((0, *pacf.shape[1:]))]
    for r in pacf:
        before = predictors[-1]
        longer = np.empty((len(before) + 1, *pacf.shape[1:]))
        longer[:-1], longer[-1] = before - r * before[::-1], r
        predictors.append(longer)
    ones = np.ones((1, *pacf.shape[1:]))
    shrink = np.concatenate([ones, np.cumprod(1 - pacf**2, axis=0)])
    return predictors, shrink / shrink[-1]


def innovation_filter(predictor: Array) -> Array:
    """Return the filter (m + 1,) that leaves of a series what m samples before do not predict."""
    out = np.ones(len(predictor) + 1)
    np.negative(predictor, out=out[1:])
    return out


def colour(e: Array, pacf: Array) -> Array:
    """Return stationary autoregressive noise with innovations e (N,)."""
    predictors, variances = levinson(pacf)
    p = min(len(pacf), len(e))
    x = np.array(e, float)
    for m in range(p):
        x[m] *= np.sqrt(variances[m])
        x[m] += predictors[m] @ x[:m][::-1]
    if len(e) > p > 0:
        a = innovation_filter(predictors[-1])
        start = scipy.signal.lfiltic([1.0], a, x[:p][::-1])
        x[p:] = scipy.signal.lfilter([1.0], a, e[p:], zi=start)[0]
    return x


def colour_many(e: Array, pacf: Array) -> Array:
    """Return series (N, B) with innovations e (N, B), each with partials of its own, (p, B)."""
    predictors, variances = levinson(pacf)
    p = len(pacf)
    x = np.array(e, float)
    for k in range(len(e)):
        m = min(k, p)
        if k < p:
            x[k] *= np.sqrt(variances[k])
        if m:
            x[k] += np.einsum("kb,kb->b", predictors[m], x[k - m : k][::-1])
    return x


def autocovariance(pacf: Array, most: int) -> Array:
    """Return autocovariances at lags 0 … most for unit innovations, (most + 1,)."""
    predictors, variances = levinson(pacf)
    p = len(pacf)
    out = np.zeros(most + 1)
    out[0] = variances[0]
    for k in range(1, most + 1):
        if k > p:
            out[k] = predictors[p] @ out[k - p : k][::-1]
        else:  # the last partial autocorrelation of an order gives the next lag [Levinson 1947]
            out[k] = pacf[k - 1] * variances[k - 1] + predictors[k - 1] @ out[1:k][::-1]
    return out


def durbin(covariance: Array) -> tuple[Array, float]:
    """Return partial autocorrelations and innovation sd of autocovariances [Durbin 1960]."""
    a = np.empty(0)
    variance = float(covariance[0])
    pacf = []
    for k in range(1, len(covariance)):
        r = float(covariance[k] - a @ covariance[1:k][::-1]) / variance
        pacf.append(r)
        a = np.append(a - r * a[::-1], r)
        variance *= 1 - r * r
    return np.array(pacf), float(np.sqrt(variance))


def whiten(x: Array, runs: Runs, pacf: Array) -> Array:
    """Return one-step prediction errors of x (N, …) in units of their standard deviation.

    They are zero between the stretches.
    """
    predictors, variances = levinson(pacf)
    p = len(pacf)
    out = np.zeros(x.shape)
    for start, stop in runs:
        part = x[start:stop]
        out[start:stop] = part
        for k, a in enumerate(predictors[-1], start=1):
            out[start + k : stop] -= a * part[:-k] if k < len(part) else 0.0
        for m in range(min(p, len(part))):
            past = part[:m][::-1]
            error = part[m] - np.tensordot(predictors[m], past, 1) if m else part[0]
            out[start + m] = error / np.sqrt(variances[m])
    return out
