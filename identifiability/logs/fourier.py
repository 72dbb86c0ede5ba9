"""Finite Fourier series of periodic motion: their fit, their derivatives, and their period."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES
from identifiability.logs.signals import sampling_step


@frozen
class FourierFit:
    """A finite Fourier series per joint: ``q = c0 + Σ a_k sin(kωt) + b_k cos(kωt)``.

    Attributes
    ----------
    period : float [s]
    coefficients : (2 H + 1, n)
        Constant, sines, cosines.
    """

    period: float
    coefficients: Array

    @property
    def harmonics(self) -> int:
        """Number of harmonics H."""
        return (len(self.coefficients) - 1) // 2

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (N, n) at times t, differentiated analytically."""
        bases = (_fourier_basis(t, self.period, self.harmonics, order) for order in range(3))
        q, dq, ddq = (basis @ self.coefficients for basis in bases)
        return q, dq, ddq


def _fourier_basis(t: Array, period: float, harmonics: int, order: int = 0) -> Array:
    """Return the functions of the series, or their first or second derivatives, (N, 2 H + 1)."""
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    S, C = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    one = np.full((len(t), 1), 1.0 if order == 0 else 0.0)
    return np.hstack([one, *((S, C), (C * w, -S * w), (-S * w**2, -C * w**2))[order]])


def fit_fourier(
    t: Array,
    q: Array,
    period: float,
    harmonics: int,
    *rates: Array | None,
    noise: Sequence[Array] | None = None,
) -> FourierFit:
    """Fit a finite Fourier series to q (N, n) by least squares [Swevers 1997].

    Parameters
    ----------
    t : (N,) [s]
    q : (N, n)
    period : float [s]
    harmonics : int
    rates : (N, n) or None
        Measured velocities and accelerations.
    noise : sequence of (n,), optional
        Standard deviations by which channels are weighed, joint by joint; by default they are what
        a series of its own leaves of each: one of positions alone knows little of accelerations
        that were measured.
    """
    origin = q.mean(0)  # small numbers, small rounding
    channels = {k: x for k, x in enumerate((q - origin, *rates)) if x is not None}
    bases = {k: _fourier_basis(t, period, harmonics, k) for k in channels}
    weights = {}
    for k, y in channels.items():
        if noise is None:
            left = ((y - bases[k] @ np.linalg.lstsq(bases[k], y, rcond=None)[0]) ** 2).sum(0)
        else:
            left = len(t) * noise[k] ** 2
        weights[k] = 1.0 / np.sqrt(np.maximum(left, ROUNDOFF**2 * (y**2).sum(0) + 1e-300))
    values = np.empty((2 * harmonics + 1, q.shape[1]))
    for j in range(q.shape[1]):
        size = max(w[j] for w in weights.values())
        rows = np.concatenate([w[j] / size * bases[k] for k, w in weights.items()])
        right = np.concatenate([w[j] / size * channels[k][:, j] for k, w in weights.items()])
        values[:, j] = np.linalg.lstsq(rows, right, rcond=None)[0]
    values[0] += origin
    return FourierFit(period, values)


def find_period(t: Array, q: Array, harmonics: int, most: int = 40) -> float:
    """Return the period, a whole fraction of the duration, whose Fourier series fits q best [s].

    Of evenly spaced samples these series are bins of one discrete Fourier transform, and what they
    leave is the power of all others.
    """
    N = len(t)
    step = sampling_step(t)
    duration = t[-1] - t[0] + step
    best, chosen = np.inf, duration
    spread = max(float(np.sum((q - q.mean(0)) ** 2)), 1e-300)
    even = np.abs(t - t[0] - step * np.arange(N)).max() < RULES.small * step
    power = 2.0 / N * (np.abs(np.fft.rfft(q - q.mean(0), axis=0)) ** 2).sum(1) if even else None
    for k in range(1, most + 1):
        # Its shortest period has four samples.
        if 4 * harmonics * k > N:
            break
        if power is None:
            fitted = fit_fourier(t, q, duration / k, harmonics).motion(t)[0]
            error = np.sum((q - fitted) ** 2) / spread
        else:
            left = np.ones(len(power), bool)
            left[: harmonics * k + 1 : k] = False
            error = power[left].sum() / spread
        if error < 0.5 * best:  # a longer period with k× the harmonics always fits a little better
            best, chosen = error, duration / k
    return float(chosen)
