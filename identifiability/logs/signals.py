"""Filter, differentiate and decimate sampled motion (arrays in, arrays out).

What to use when: `fit_fourier` for periodic motion (derivatives are then analytic); `differentiate`
for all other motion, after a zero-phase Butterworth filter; `Decimation` if torque is low-passed.
`differentiate` is exact up to a fifth of the sampling rate and amplifies higher frequencies.
`Decimation` must act alike on torque and on every column of the regressor (parallel filtering
[Gautier 1997]). Else sharp friction steps are smoothed on one side of the equation only.
"""

from functools import cache, cached_property

import numpy as np
import scipy
from scipy.special import binom

from identifiability.foundation.linalg import ROUNDOFF, filter_from_rest
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

from .rules import RULES


def sampling_step(t: Array) -> float:
    """Return the sampling step of uniform times, their median difference [s]."""
    return float(np.median(np.diff(t)))


def held_since(t: Array, changes: Array) -> Array:
    """Return the time since which the values of each row are held, (N,) [s].

    A value on another clock appears in the rows late, by a varying part of a row. If values arrive
    regularly, their arrival times lie on a line over their numbers. The line is the latest one that
    no row precedes. If values arrive with rows, the times are those of the rows. Slow values repeat
    by rounding, and only those of a slower clock where they change fast.

    Parameters
    ----------
    t : (N,) [s]
        Times of rows, evenly spaced.
    changes : (N,)
        By how much the value of each row differs from the previous one.
    """
    (rows,) = np.nonzero(changes)
    if len(rows) < RULES.fewest:
        return t
    dt = sampling_step(t)
    seen = t[rows]
    apart = np.diff(seen)
    uneven = 2 * float(np.quantile(np.abs(np.diff(t) - dt), 0.99)) + ROUNDOFF
    # A row sees a value late by up to a row, so two successive values may seem far apart.
    usual = apart[apart <= np.median(apart) + dt + uneven].mean()
    for _ in range(3):  # with lost values the usual step is too long to count those of a long pause
        # A hundredth of a row is the error of the step.
        is_next = apart <= usual + 1.01 * dt + uneven
        counts = np.where(is_next, 1.0, np.rint(apart / usual))
        number = np.append(0.0, np.cumsum(counts))
        usual = np.polyfit(number, seen, 1)[0]
    behind = seen - usual * number
    if np.ptp(behind) > dt + uneven:
        # The strip about the line is narrowest for a clock that rows share.
        drift = usual * number / number[-1]
        behind -= drift * _flatten(behind, drift)
    behind -= behind.min()
    out = t.copy()
    late = usual > dt + uneven >= behind.max()
    if late and _repeats_in_motion(changes[rows], apart > dt + uneven):
        waited = np.where(behind > uneven, behind, 0.0)
        out[rows] = np.maximum(seen - waited, t[rows - 1])
    return out


def _repeats_in_motion(sizes: Array, repeats: np.ndarray) -> bool:
    """Return whether a value repeats, (k - 1,) bool, between two large changes, of sizes (k,)."""
    is_large = sizes >= np.median(sizes)
    found = repeats & is_large[1:] & is_large[:-1]
    return bool(found.any())


def _flatten(x: Array, drift: Array) -> float:
    """Return the multiple of a drift (m,), up to once, without which x (m,) has the least range."""
    least = scipy.optimize.minimize_scalar(
        lambda by: np.ptp(x - by * drift), bounds=(-1, 1), options={"xatol": ROUNDOFF}
    )
    return float(least.x)


def has_gap(t: Array) -> Array:
    """Return after which samples at times t (N,) others are missing, (N - 1,) bool."""
    steps = np.diff(t)
    return steps > RULES.gap * np.median(steps)


def is_constant(low: Array, high: Array, size: float = 0.0) -> Array:
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
    larger = np.maximum(np.abs(low), np.abs(high))
    return high - low <= ROUNDOFF * (size + larger)


def never_moves(low: Array, high: Array) -> Array:
    """Return a mask of joints that never move, by the range of positions [rad or m], (n,) bool."""
    return is_constant(low, high, 1.0)


def cubic(at: Array, t: Array, x: Array) -> Array:
    """Return values (M, …) at some times by Lagrange's cubic through the four samples around."""
    start = np.clip(np.searchsorted(t, at) - 2, 0, len(t) - 4)
    nodes = start[:, None] + np.arange(4)
    out = np.zeros((len(at), *x.shape[1:]))
    for k in range(4):
        others = t[np.delete(nodes, k, axis=1)]
        lengths = t[nodes[:, [k]]] - others
        weight = np.prod((at[:, None] - others) / lengths, axis=1)
        factors = weight.reshape(-1, *(1,) * (x.ndim - 1))
        values = x[nodes[:, k]]
        out += factors * values
    return out


#: Order of the Butterworth low-pass, one way.
BUTTERWORTH_ORDER = 4


def butterworth_poles(share: float) -> Array:
    """Return the poles (BUTTERWORTH_ORDER,) of a digital Butterworth low-pass.

    Poles of the analog filter lie on a circle in the left half-plane. The bilinear transform maps
    them into the unit circle [Oppenheim & Schafer 2010].

    Parameters
    ----------
    share : float
        Cut-off frequency as a share of the Nyquist frequency, between 0 and 1.

    Returns
    -------
    (BUTTERWORTH_ORDER,) complex
        In conjugate pairs.
    """
    radius = np.tan(np.pi * share / 2)
    count = BUTTERWORTH_ORDER
    odd_numbers = 2 * np.arange(count) + 1
    angles = np.pi * (odd_numbers + count) / (2 * count)
    analog = radius * np.exp(1j * angles)
    return (1 + analog) / (1 - analog)


def lowpass(x: Array, dt: float, cutoff: float) -> Array:
    """Return x (N, …) filtered forwards and backwards by a Butterworth low-pass (no phase).

    It is of fourth order each way. Beyond its ends, x is extended by point reflection, and beyond
    that by a constant.
    """
    poles = butterworth_poles(2 * cutoff * dt)
    pad = min(len(x) - 1, int(3 / (cutoff * dt)))
    before = 2 * x[0] - x[pad:0:-1]
    after = 2 * x[-1] - x[-2 : -pad - 2 : -1]
    padded = np.concatenate([before, x, after])
    forwards = _filter_once(padded.reshape(len(padded), -1), poles)
    backwards = _filter_once(forwards[::-1], poles)
    filtered = backwards[::-1].reshape(padded.shape)
    return filtered[pad : pad + len(x)]


def _filter_once(x: Array, poles: Array) -> Array:
    """Return x (N, m) filtered once, as if it had always been as its first sample.

    Each pair of conjugate poles is a section of second order. A constant is not subtracted first:
    rounding would then depend on where a piece of a log begins, and so would the sign of a speed
    that is zero but for rounding.
    """
    y = x
    for pole in poles[poles.imag > 0]:
        denominator = np.array([1.0, -2 * pole.real, abs(pole) ** 2])
        gain = denominator.sum() / 4
        first = y[:1]
        past = np.concatenate([first, first, y])
        driven = gain * (past[2:] + 2 * past[1:-1] + past[:-2])
        # What the recursion would have kept of its past.
        driven[:1] -= (denominator[1] + denominator[2]) * first
        driven[1:2] -= denominator[2] * first
        y = filter_from_rest(denominator, driven)
    return y


def settling_rows(dt: float, cutoff: float) -> int:
    """Return the number of samples after which `lowpass` has forgotten the start of its input.

    Its slowest pole has decayed to 1e-14 by then. Differentiated twice, this is small compared with
    1e-8.
    """
    slowest = np.abs(butterworth_poles(2 * cutoff * dt)).max()
    return int(np.ceil(np.log(1e-14) / np.log(slowest)))


#: Samples on each side that a difference uses, and the weights of those ahead.
REACH = 8
AHEAD = [-((-1) ** k) / k * binom(16, 8 - k) / binom(16, 8) for k in range(1, REACH + 1)]


def differentiate(x: Array, dt: float) -> Array:
    """Return the time derivative of x (N, …) by central differences of order 16 [Fornberg 1988].

    Its error is 1e-13 of the derivative at a twentieth of the sampling rate, 1e-6 at a seventh and
    7e-5 at a fifth; that of second order is 1.6, 13 and 24 %, and twice as much after two of them.
    The first and last `REACH` samples are those of a spline of fifth degree.
    """
    x = np.asarray(x, float)
    end = 4 * REACH
    if len(x) < 2 * end:
        return _spline_slope(x) / dt
    kernel = [*np.negative(AHEAD[::-1]), 0.0, *AHEAD]
    slope = scipy.ndimage.correlate1d(
        x,
        kernel,
        axis=0,
    )
    slope[:REACH] = _spline_slope(x[:end])[:REACH]
    slope[-REACH:] = _spline_slope(x[-end:])[-REACH:]
    return slope / dt


def _spline_slope(x: Array) -> Array:
    """Return the slope of the spline of fifth degree through samples, or of less through few."""
    if len(x) < 2:
        return np.zeros_like(x)
    return np.tensordot(_slope_weights(len(x)), x, 1)


@cache
def _slope_weights(count: int) -> Array:
    """Return the slopes of the splines through one at a sample and zero at the others, (N, N)."""
    at = np.arange(count, dtype=float)
    spline = scipy.interpolate.make_interp_spline(at, np.eye(count), min(5, count - 1))
    return spline(at, 1)


#: Outputs of a decimation that are made by one product: of more, most of its terms are zeros.
TOGETHER = 16


@frozen
class Decimation:
    """Zero-phase FIR low-pass and decimation that torque and regressor columns share.

    Attributes
    ----------
    factor : int
        Every `factor`-th sample is kept.
    every : int
        Samples from one at which columns are computed to the next, because the motion was
        low-passed: an odd divisor of the factor.
    """

    factor: int
    every: int = 1

    @cached_property
    def taps(self) -> Array:
        """The symmetric filter, 20 taps a kept sample, cut-off at the new Nyquist frequency."""
        at = np.arange(-self.reach, self.reach + 1)
        h = np.sinc(at / self.factor) * np.hamming(len(at))
        h /= h.sum()
        return h

    @property
    def reach(self) -> int:
        """Samples on each side that an output draws on."""
        return 10 * self.factor

    def outputs(self, samples: int) -> int:
        """Return the number of outputs of a run of samples; its ends are not extrapolated."""
        inner = samples - (2 * self.reach + 1)
        return max(0, inner // self.factor + 1)

    def apply(self, x: Array) -> Array:
        """Return x (N, …) low-passed and decimated, (outputs, …)."""
        count = self.outputs(len(x))
        flat = x.reshape(len(x), -1)
        out = np.empty((count, flat.shape[1]))
        length = len(self.taps)
        for at in range(0, count, TOGETHER):
            few = min(TOGETHER, count - at)
            end = (few - 1) * self.factor + length
            band = self._band[:few, :end]
            piece = flat[at * self.factor : at * self.factor + end]
            room = out[at : at + few]
            np.matmul(
                band,
                piece,
                out=room,
            )
        return out.reshape(count, *x.shape[1:])

    @cached_property
    def _band(self) -> Array:
        """The taps of consecutive outputs, (TOGETHER, …): one product is quicker than many."""
        band = np.zeros((TOGETHER, (TOGETHER - 1) * self.factor + len(self.taps)))
        for k in range(TOGETHER):
            band[k, k * self.factor : k * self.factor + len(self.taps)] = self.taps
        return band


# Finite Fourier series of periodic motion: their fit, their derivatives, and their period.


def fourier_motion(t: Array, period: float, series: Array) -> tuple[Array, Array, Array]:
    """Return q, dq, ddq (N, n) at times t of ``q = c0 + Σ a_k sin(kωt) + b_k cos(kωt)``.

    Parameters
    ----------
    t : (N,) [s]
    period : float [s]
    series : (2 H + 1, n)
        Constant, sines, cosines.
    """
    harmonics = (len(series) - 1) // 2
    q, dq, ddq = (basis @ series for basis in fourier_bases(t, period, harmonics))
    return q, dq, ddq


def fourier_bases(t: Array, period: float, harmonics: int) -> tuple[Array, Array, Array]:
    """Return the functions of the series, their first and second derivatives, (N, 2 H + 1) each."""
    w = 2 * np.pi / period * np.arange(1, harmonics + 1)
    S = np.sin(np.outer(t, w))
    C = np.cos(np.outer(t, w))
    one = np.ones((len(t), 1))
    zero = np.zeros((len(t), 1))
    values = np.hstack([one, S, C])
    slopes = np.hstack([zero, C * w, -S * w])
    bends = np.hstack([zero, -S * w**2, -C * w**2])
    return values, slopes, bends
