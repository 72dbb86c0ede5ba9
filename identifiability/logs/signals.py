"""Filter, differentiate and decimate sampled motion (arrays in, arrays out).

What to use when: `fourier.fit_fourier` for periodic motion (derivatives are then analytic);
`differentiate` for everything else (zero-phase Butterworth before it: it is exact in the band that
is kept, up to a fifth of the sampling rate, and amplifies what lies above);
`Decimation` whenever torque is low-passed: it must act on every column of the regressor as it
acts on the torque (parallel filtering [Gautier 1997]), or sharp friction steps are smoothed on
one side of the equation only.
"""

from __future__ import annotations

import math
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg.lapack import dtbtrs

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES

#: Decisions about a long log are made on this many windows of so many samples.
WINDOWS, WINDOW = 8, 16_384

#: The first so many changes of a value tell the period at which it comes, and fewer than so many in
#: all tell none.
FIRST, UPDATES = 16, 64

#: What is left of a filter's transient where it is called over; twice differentiated it must
#: still be small beside 1e-8.
FORGOTTEN: Tolerance = 1e-14


def sampling_step(t: Array) -> float:
    """Return the sampling step of uniform times, their median difference [s]."""
    return float(np.median(np.diff(t)))


def held_since(t: Array, changes: np.ndarray) -> Array:
    """Return since when the values of each row are held, (N,) [s].

    Rows show a value that comes on another clock late, by up to a row, and by another part of a row
    each time. Where values come regularly their numbers tell when they came: at the latest times on
    a line over them that no row precedes. Where they come with rows, these are those of rows.

    Parameters
    ----------
    t : (N,) [s]
        Of rows, evenly.
    changes : (N,) bool
        Which rows hold another value than the one before.
    """
    (rows,) = np.nonzero(changes)
    if len(rows) < UPDATES:
        return t
    dt, seen = sampling_step(t), t[rows] - t[rows[0]]
    most = dt + 2 * float(np.quantile(np.abs(np.diff(t) - dt), 0.99)) + ROUNDOFF
    few = seen[:FIRST]
    periods = np.diff(few).min() + dt * np.linspace(-1, 1, FIRST * UPDATES)
    periods = periods[periods > most]  # others come with every row
    late = np.array([_fold(few, period)[1] for period in periods])
    (fits,) = np.nonzero(late <= most)
    runs = np.split(fits, np.flatnonzero(np.diff(fits) > 1) + 1)
    for run in reversed(runs if len(fits) else []):  # parts of a period fit as well
        behind = _behind(seen, float(periods[run[np.argmin(late[run])]]), dt, most)
        if behind is not None:
            out = t.copy()
            out[rows] = np.maximum(t[rows] - behind, t[rows - 1])
            return out
    return t


def _behind(t: Array, period: float, dt: float, most: float) -> Array | None:
    """Return how far times (m,) are behind a line over their numbers; None if some by too much.

    Parameters
    ----------
    t : (m,) [s]
    period : float [s]
        Nearly that between numbers.
    dt, most : float [s]
        By which times may be late, without and with what rows are uneven by.
    """
    first, count, left = _fold(t[:FIRST], period)[0], FIRST, t
    while count < len(t):
        count = min(count + count // 2, len(t))
        number = np.floor((t[:count] - first + 0.5 * (period - most)) / period)
        period = float(np.polyfit(number, t[:count], 1)[0])
        left = t[:count] - period * number
        first = float(left.min())
        if np.ptp(left) > most:
            return None
    behind = left - first
    return np.where(behind > most - dt, behind, 0.0)


def _fold(t: Array, period: float) -> tuple[float, float]:
    """Return where times begin on a circle of some period, and over how much of it they spread."""
    on = np.sort(t % period)
    gaps = np.diff(on, append=on[0] + period)
    k = int(np.argmax(gaps))
    return float(on[(k + 1) % len(on)]), float(period - gaps[k])


def has_gap(t: Array) -> np.ndarray:
    """Return after which samples at times t (N,) others are missing, (N - 1,) bool."""
    steps = np.diff(t)
    found: np.ndarray = steps > RULES.gap * np.median(steps)
    return found


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
    never: np.ndarray = high - low <= ROUNDOFF * (size + np.maximum(np.abs(low), np.abs(high)))
    return never


def never_moves(low: Array, high: Array) -> np.ndarray:
    """Return which joints stand still, from the range of their positions [rad or m], (n,) bool."""
    return is_constant(low, high, 1.0)


def cubic(at: Array, t: Array, x: Array) -> Array:
    """Return values (M, …) at some times by Lagrange's cubic through the four samples around."""
    start = np.clip(np.searchsorted(t, at) - 2, 0, len(t) - 4)
    nodes = start[:, None] + np.arange(4)
    out = np.zeros((len(at), *x.shape[1:]))
    for k in range(4):
        others = t[np.delete(nodes, k, axis=1)]
        weight = np.prod((at[:, None] - others) / (t[nodes[:, [k]]] - others), axis=1)
        out += weight.reshape(-1, *(1,) * (x.ndim - 1)) * x[nodes[:, k]]
    return out


def spread_windows(samples: int) -> list[tuple[int, int]]:
    """Return the rows (start, stop) that decisions about a whole log are made on.

    All of them in logs of up to `WINDOWS` times `WINDOW` samples, else so many windows, evenly
    spaced from the first sample to the last.
    """
    if samples <= WINDOWS * WINDOW:
        return [(0, samples)]
    starts = np.linspace(0, samples - WINDOW, WINDOWS).astype(int)
    return [(int(s), int(s) + WINDOW) for s in starts]


def lowpass(x: Array, dt: float, cutoff: float) -> Array:
    """Return x (N, …) filtered forwards and backwards by a Butterworth low-pass (no phase).

    It is of fourth order each way; beyond its ends x goes on point-symmetrically, and before that
    it is as if it had always been as there.
    """
    pad = min(len(x) - 1, int(3 / (cutoff * dt)))
    y = np.concatenate([2 * x[0] - x[pad:0:-1], x, 2 * x[-1] - x[-2 : -pad - 2 : -1]])
    y = np.asfortranarray(y.reshape(len(y), -1))
    for _ in "there", "back":
        start = y[0].copy()
        y = y - start
        for pole in _poles(dt, cutoff):
            y *= abs(1 - pole) ** 2 / 4
            y[1:] += y[:-1]
            y[1:] += y[:-1]
            # What recurs is a triangular system of three bands.
            bands = np.repeat([[abs(pole) ** 2, -2 * pole.real, 1.0]], len(y), axis=0).T
            y, _ = dtbtrs(bands, y, uplo="U", trans="T", diag="U", overwrite_b=True)
        y = (y + start)[::-1]
    return np.ascontiguousarray(y[pad : pad + len(x)]).reshape(x.shape)


def _poles(dt: float, cutoff: float) -> Array:
    """Return the poles above the real axis of a Butterworth low-pass of fourth order, (2,)."""
    if not 0 < cutoff * dt < 0.5:
        raise ValueError(f"a low-pass is below half of the sampling rate, not at {cutoff * dt:g}")
    analogue = np.tan(np.pi * cutoff * dt) * np.exp(1j * np.pi * np.array([5, 7]) / 8)
    found: Array = (1 + analogue) / (1 - analogue)
    return found


def settling_rows(dt: float, cutoff: float) -> int:
    """Return after how many samples `lowpass` has forgotten where its input began.

    The slowest pole has decayed to `FORGOTTEN` of what it was.
    """
    return int(np.ceil(np.log(FORGOTTEN) / np.log(np.abs(_poles(dt, cutoff)).max())))


#: Samples on each side that a difference draws on, and as many times that at the ends of a signal.
REACH, ENDS = 8, 4


def differentiate(x: Array, dt: float) -> Array:
    """Return the time derivative of x (N, …) by central differences of order 16 [Fornberg 1988].

    Its error is 1e-13 of the derivative at a twentieth of the sampling rate, 1e-6 at a seventh and
    7e-5 at a fifth; that of second order is 1.6, 13 and 24 %, and twice as much after two of them.
    The first and last `REACH` samples are those of a spline of fifth degree.
    """
    if len(x) < 2 * ENDS * REACH:
        return _end_slope(x, dt)
    m = len(x) - 2 * REACH
    slope, end = np.zeros_like(x, float), ENDS * REACH
    for k, share in enumerate(_difference(), 1):
        ahead, behind = x[REACH + k : REACH + k + m], x[REACH - k : REACH - k + m]
        slope[REACH:-REACH] += (share / dt) * (ahead - behind)
    slope[:REACH] = _end_slope(x[:end], dt)[:REACH]
    slope[-REACH:] = _end_slope(x[-end:], dt)[-REACH:]
    return slope


def _difference() -> list[float]:
    """Return what the differences over 2, 4, … 2 REACH steps count for."""
    whole = math.comb(2 * REACH, REACH)
    return [
        (-1) ** (k + 1) / k * math.comb(2 * REACH, REACH - k) / whole for k in range(1, REACH + 1)
    ]


def _end_slope(x: Array, dt: float) -> Array:
    """Return the derivative of the spline through few samples."""
    return np.tensordot(_spline_slope(len(x)), x, 1) / dt


@lru_cache(maxsize=4)
def _spline_slope(n: int) -> Array:
    """Return the slopes (n, n) at samples 0, 1, … of the spline through any values of these.

    It is of fifth degree, or less where there are few, and has its knots at samples, but for those
    next to the ends ("not a knot"). Its B-splines follow from those of degree zero [de Boor 1978].
    It is a matrix here, as the ends of all logs are alike; SciPy's splines import its optimisers.
    """
    degree, at = min(5, n - 1), np.arange(n, dtype=float)
    inner = at[degree // 2 + 1 : n - degree // 2 - 1]
    knots = np.concatenate([np.zeros(degree + 1), inner, np.full(degree + 1, n - 1.0)])
    value = ((knots[:-1] <= at[:, None]) & (at[:, None] < knots[1:])).astype(float)
    value[-1, n - 1] = 1.0  # the last sample belongs to what ends there
    slope = np.zeros((n, n))
    for d in range(1, degree + 1):
        width = knots[d:] - knots[:-d]
        share = value / np.where(width > 0, width, np.inf)
        slope = d * (share[:, :-1] - share[:, 1:])
        value = (at[:, None] - knots[: -d - 1]) * share[:, :-1]
        value += (knots[d + 1 :] - at[:, None]) * share[:, 1:]
    found: Array = np.linalg.solve(value.T, slope.T).T
    return found


#: Outputs of a decimation that are made by one product: of more, most of its terms are zeros.
TOGETHER = 16


#: Samples for each output that columns are computed of, at least, where there are so many.
DENSE = 32


@frozen
class Decimation:
    """Zero-phase FIR low-pass and decimation that torque and regressor columns share.

    Attributes
    ----------
    factor : int
        Every `factor`-th sample is kept.
    spare : int
        Of every so many samples the motion is known well enough: it was low-passed.
    """

    factor: int
    spare: int = 1

    @cached_property
    def every(self) -> int:
        """Columns are computed of every so many samples."""
        most = max(1, min(self.factor // DENSE, self.spare))
        return next(e for e in range(most, 0, -1) if self.factor % e == 0)

    @property
    def coarse(self) -> Decimation:
        """The same filter, of every so many samples."""
        return self if self.every == 1 else self._coarse

    @cached_property
    def _coarse(self) -> Decimation:
        return Decimation(self.factor // self.every)

    @cached_property
    def taps(self) -> Array:
        """The symmetric filter, 20 taps a kept sample, cut-off at the new Nyquist frequency."""
        at = np.arange(-self.reach, self.reach + 1)
        h: Array = np.sinc(at / self.factor) * np.hamming(len(at))
        h /= h.sum()
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
        count, flat = self.outputs(len(x)), x.reshape(len(x), -1)
        out, length = np.empty((count, flat.shape[1])), len(self.taps)
        for at in range(0, count, TOGETHER):
            few = min(TOGETHER, count - at)
            end = (few - 1) * self.factor + length
            np.matmul(
                self._band[:few, :end],
                flat[at * self.factor : at * self.factor + end],
                out=out[at : at + few],
            )
        return out.reshape(count, *x.shape[1:])

    @cached_property
    def _band(self) -> Array:
        """The taps of consecutive outputs, (TOGETHER, …): one product is quicker than many."""
        band = np.zeros((TOGETHER, (TOGETHER - 1) * self.factor + len(self.taps)))
        for k in range(TOGETHER):
            band[k, k * self.factor : k * self.factor + len(self.taps)] = self.taps
        return band
