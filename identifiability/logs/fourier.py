"""Finite Fourier series of periodic motion: their fit, their derivatives, and their period.

What to use when: `fit_fourier` for positions, and rates that were measured; `fit_fourier_pieces`
for logs that do not fit in memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

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

    Measured velocities and accelerations, if they are given after the rest, (N, n) or None each,
    and the noise are as of `fit_fourier_pieces`.
    """
    return fit_fourier_pieces([(t, q, *rates)], period, harmonics, noise)[0]


def fit_fourier_pieces(
    pieces: Iterable[tuple[Array | None, ...]],
    period: float,
    harmonics: int,
    noise: Sequence[Array] | None = None,
) -> tuple[FourierFit, float]:
    """Fit a finite Fourier series to a log that comes in pieces; return also its rms residual.

    Parameters
    ----------
    pieces : iterable of (t (N,), q (N, n), dq (N, n) or None, ddq (N, n) or None)
        The last two may be left out. Used once; sums of products are kept, which the nearly
        orthogonal functions allow.
    period : float [s]
    harmonics : int
    noise : sequence of (n,), optional
        Standard deviations by which channels are weighed, joint by joint; by default they are what
        a series of its own leaves of each: one of positions alone knows little of accelerations
        that were measured.

    Returns
    -------
    FourierFit, float
        And the rms residual of the positions.
    """
    grams: dict[int, Array] = {}
    rights: dict[int, Array] = {}
    squares: dict[int, Array] = {}
    count, origin = 0, np.zeros(0)
    for t, *channels in pieces:
        assert t is not None
        assert channels[0] is not None
        origin = origin if count else channels[0].mean(0)  # small numbers, small rounding
        count += len(t)
        for order, x in enumerate(channels):
            if x is not None:
                basis = _fourier_basis(t, period, harmonics, order)
                y = x if order else x - origin
                grams[order] = grams.get(order, 0.0) + basis.T @ basis
                rights[order] = rights.get(order, 0.0) + basis.T @ y
                squares[order] = squares.get(order, 0.0) + (y**2).sum(0)
    weights = {}
    for order, gram in grams.items():
        if noise is None:
            own = np.linalg.lstsq(gram, rights[order], rcond=None)[0]
            left = np.maximum(squares[order] - (own * rights[order]).sum(0), 0.0)
        else:
            left = count * noise[order] ** 2
        weights[order] = 1.0 / np.maximum(left, ROUNDOFF**2 * squares[order] + 1e-300)
    values = np.empty_like(rights[0])
    for j in range(values.shape[1]):
        size = sum(w[j] for w in weights.values())
        gram = sum((weights[k][j] / size * g for k, g in grams.items()), np.zeros(()))
        right = sum((weights[k][j] / size * r[:, j] for k, r in rights.items()), np.zeros(()))
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        found = np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=None)[0]
        values[:, j] = found / scale
    gone = 2 * values * rights[0] - values * (grams[0] @ values)
    rest = max(float((squares[0] - gone.sum(0)).sum()), 0.0)
    values[0] += origin
    return FourierFit(period, values), float(np.sqrt(rest / (count * len(origin))))


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
    even = np.abs(t - t[0] - step * np.arange(N)).max() < RULES.even * step
    power = 2.0 / N * (np.abs(np.fft.rfft(q - q.mean(0), axis=0)) ** 2).sum(1) if even else None
    for k in range(1, most + 1):
        if RULES.series_samples * harmonics * k > N:
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
