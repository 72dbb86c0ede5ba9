"""Filter, differentiate, fit and decimate sampled motion (arrays in, arrays out).

What to use when: `fit_fourier` for periodic motion (derivatives are then analytic);
`differentiate` for everything else (zero-phase Butterworth, then central differences);
`Decimation` whenever torque is low-passed: it must act on every column of the regressor as it
acts on the torque (parallel filtering [Gautier 1997]), or sharp friction steps are smoothed on
one side of the equation only.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
import scipy

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Decisions about a long log are made on this many windows of so many samples.
WINDOWS, WINDOW = 8, 16_384

#: What is left of a filter's transient where it is called over; twice differentiated it must
#: still be small beside 1e-8.
FORGOTTEN = 1e-14

#: What spans less than this share of its size is constant: sensors resolve nothing below it, and
#: conversions of units leave less.
CONSTANT = 1e-9


def sampling_step(t: Array) -> float:
    """Return the sampling step of uniform times, their median difference [s]."""
    return float(np.median(np.diff(t)))


def is_constant(low: Array, high: Array, size: float = 0.0) -> np.ndarray:
    """Return which columns never change, from their ranges.

    Parameters
    ----------
    low, high : (n,)
    size : float
        Added to the size that the range is compared with: 1 for positions, whose zero is anywhere.

    Returns
    -------
    (n,) bool
    """
    never: np.ndarray = high - low <= CONSTANT * (size + np.maximum(np.abs(low), np.abs(high)))
    return never


def never_moves(low: Array, high: Array) -> np.ndarray:
    """Return which joints stand still, from the range of their positions [rad or m], (n,) bool."""
    return is_constant(low, high, 1.0)


def spread_windows(samples: int) -> list[tuple[int, int]]:
    """Return the rows (start, stop) that decisions about a whole log are made on.

    All of them in logs of up to `WINDOWS` times `WINDOW` samples, else so many windows, evenly
    spaced from the first sample to the last.
    """
    if samples <= WINDOWS * WINDOW:
        return [(0, samples)]
    starts = np.linspace(0, samples - WINDOW, WINDOWS).astype(int)
    return [(int(s), int(s) + WINDOW) for s in starts]


def lowpass(x: Array, dt: float, cutoff: float, order: int = 4) -> Array:
    """Return x (N, …) filtered forwards and backwards by a Butterworth low-pass (no phase)."""
    sos = scipy.signal.butter(order, cutoff, fs=1.0 / dt, output="sos")
    pad = min(len(x) - 1, int(3 / (cutoff * dt)))
    filtered: Array = scipy.signal.sosfiltfilt(sos, x, axis=0, padlen=pad)
    return filtered


def settling_rows(dt: float, cutoff: float, order: int = 4) -> int:
    """Return after how many samples `lowpass` has forgotten where its input began.

    The slowest pole has decayed to `FORGOTTEN` of what it was.
    """
    poles = scipy.signal.butter(order, cutoff, fs=1.0 / dt, output="zpk")[1]
    return int(np.ceil(np.log(FORGOTTEN) / np.log(np.abs(poles).max())))


def differentiate(x: Array, dt: float) -> Array:
    """Return the time derivative of x (N, …) by central differences of second order."""
    slope: Array = np.gradient(x, dt, axis=0, edge_order=2)
    return slope


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
        H = self.harmonics
        w = 2 * np.pi / self.period * np.arange(1, H + 1)
        S, C = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        c0, a, b = np.split(self.coefficients, [1, H + 1])
        q = c0 + S @ a + C @ b
        dq = (C * w) @ a - (S * w) @ b
        ddq = -(S * w**2) @ a - (C * w**2) @ b
        return q, dq, ddq


def _fourier_basis(t: Array, period: float, harmonics: int, order: int = 0) -> Array:
    """Return the functions of the series, or their first or second derivatives, (N, 2 H + 1)."""
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    S, C = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    one = np.full((len(t), 1), 1.0 if order == 0 else 0.0)
    return np.hstack([one, *((S, C), (C * w, -S * w), (-S * w**2, -C * w**2))[order]])


def fit_fourier(
    t: Array, q: Array, period: float, harmonics: int, *rates: Array | None
) -> FourierFit:
    """Fit a finite Fourier series to q (N, n) by least squares [Swevers 1997].

    Measured velocities and accelerations, if they are given after the rest, (N, n) or None each,
    are fitted together with the positions, as `fit_fourier_pieces` does.
    """
    if any(x is not None for x in rates):
        return fit_fourier_pieces([(t, q, *rates)], period, harmonics)[0]
    basis = _fourier_basis(t, period, harmonics)
    return FourierFit(period, np.linalg.lstsq(basis, q, rcond=None)[0])


def fit_fourier_jointly(
    t: Array, channels: Sequence[Array], noise: Sequence[Array], period: float, harmonics: int
) -> FourierFit:
    """Fit a finite Fourier series to positions and what was measured of their derivatives.

    Parameters
    ----------
    t : (N,) [s]
    channels : q (N, n), then dq and ddq where they were measured
    noise : (n,) for each channel
        Standard deviations, which weigh the channels.
    period : float [s]
    harmonics : int
    """
    basis = _fourier_basis(t, period, harmonics)
    H, w = harmonics, 2 * np.pi / period * np.arange(1, harmonics + 1)
    S, C = basis[:, 1 : H + 1], basis[:, H + 1 :]
    zero = np.zeros((len(t), 1))
    bases = [basis, np.hstack([zero, C * w, -S * w]), np.hstack([zero, -S * w**2, -C * w**2])]
    used = list(zip(bases, channels, noise, strict=False))
    grams = [b.T @ b for b, _, _ in used]
    rights = [b.T @ x for b, x, _ in used]
    values = np.empty((2 * H + 1, channels[0].shape[1]))
    scale = np.concatenate([[1.0], 1.0 / w, 1.0 / w])  # columns of velocity at unit length
    for k in range(values.shape[1]):
        # What has no noise is weighed as if it had a millionth of its size.
        level = [max(float(n[k]), 1e-6 * float(x[:, k].std()), 1e-12) for _, x, n in used]
        gram = sum(G / s**2 for G, s in zip(grams, level, strict=True)) * np.outer(scale, scale)
        right = sum(r[:, k] / s**2 for r, s in zip(rights, level, strict=True)) * scale
        values[:, k] = scale * np.linalg.lstsq(gram, right, rcond=None)[0]
    return FourierFit(period, values)


def fit_fourier_pieces(
    pieces: Iterable[tuple[Array | None, ...]], period: float, harmonics: int
) -> tuple[FourierFit, float]:
    """Fit a finite Fourier series to a log that comes in pieces; return also its rms residual.

    Channels are weighted, joint by joint, by the variance of what a series of their own leaves of
    them: a series of positions alone knows little of accelerations that were measured.

    Parameters
    ----------
    pieces : iterable of (t (N,), q (N, n), dq (N, n) or None, ddq (N, n) or None)
        The last two may be left out. Used once; sums of products are kept, which the nearly
        orthogonal functions allow.
    period : float [s]
    harmonics : int

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
    values = np.linalg.lstsq(grams[0], rights[0], rcond=None)[0]
    if len(grams) > 1:
        values = _fit_together(grams, rights, squares)
    gone = 2 * values * rights[0] - values * (grams[0] @ values)
    rest = max(float((squares[0] - gone.sum(0)).sum()), 0.0)
    values[0] += origin
    return FourierFit(period, values), float(np.sqrt(rest / (count * len(origin))))


def _fit_together(
    grams: dict[int, Array], rights: dict[int, Array], squares: dict[int, Array]
) -> Array:
    """Return the series of all channels, each weighted by the variance of what is left of it."""
    values = np.empty_like(rights[0])
    weights = {}
    for order, gram in grams.items():
        own = np.linalg.lstsq(gram, rights[order], rcond=None)[0]
        left = np.maximum(squares[order] - (own * rights[order]).sum(0), 0.0)
        weights[order] = 1.0 / np.maximum(left, CONSTANT**2 * squares[order] + 1e-300)
    for j in range(values.shape[1]):
        size = sum(w[j] for w in weights.values())
        gram = sum((weights[k][j] / size * g for k, g in grams.items()), np.zeros(()))
        right = sum((weights[k][j] / size * r[:, j] for k, r in rights.items()), np.zeros(()))
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values[:, j] = (
            np.linalg.lstsq(gram / np.outer(scale, scale), right / scale, rcond=None)[0] / scale
        )
    return values


def find_period(t: Array, q: Array, harmonics: int, most: int = 40) -> float:
    """Return the period, a whole fraction of the duration, whose Fourier series fits q best [s]."""
    duration = t[-1] - t[0] + sampling_step(t)
    best, chosen = np.inf, duration
    spread = np.sum((q - q.mean(0)) ** 2)
    for k in range(1, most + 1):
        if 4 * harmonics * k > len(t):
            break
        fitted = fit_fourier(t, q, duration / k, harmonics).motion(t)[0]
        error = np.sum((q - fitted) ** 2) / max(spread, 1e-300)
        if error < 0.5 * best:  # a longer period with k× the harmonics always fits a little better
            best, chosen = error, duration / k
    return float(chosen)


@frozen
class Decimation:
    """Zero-phase FIR low-pass and decimation that torque and regressor columns share.

    Attributes
    ----------
    factor : int
        Every `factor`-th sample is kept.
    """

    factor: int

    @cached_property
    def taps(self) -> Array:
        """The symmetric filter, 20 taps a kept sample, cut-off at the new Nyquist frequency."""
        h: Array = scipy.signal.firwin(2 * self.reach + 1, 1.0 / self.factor, window="hamming")
        return h

    @property
    def reach(self) -> int:
        """Samples on each side that an output draws on."""
        return 10 * self.factor

    def outputs(self, samples: int) -> int:
        """Return the number of outputs of a run of samples; its ends are not extrapolated."""
        return max(0, (samples - (2 * self.reach + 1)) // self.factor + 1)

    def centres(self, start: int, stop: int) -> range:
        """Return the rows of a log at which a run of its rows [start, stop) has outputs.

        They are multiples of the factor, wherever the run begins, so that it does not matter in
        which parts a log is read.
        """
        first = -(-(start + self.reach) // self.factor) * self.factor
        return range(first, max(first, stop - self.reach), self.factor)

    def apply(self, x: Array) -> Array:
        """Return x (N, …) low-passed and decimated, (outputs, …)."""
        count = self.outputs(len(x))
        band = np.zeros((count, len(x)))
        for k in range(count):
            band[k, k * self.factor : k * self.factor + len(self.taps)] = self.taps
        out: Array = (band @ x.reshape(len(x), -1)).reshape(count, *x.shape[1:])
        return out
