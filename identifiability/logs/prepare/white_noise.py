"""White noise, gaps and steps of measured signals, told from differences between their samples.

Differences of high order leave nothing of a smooth motion and all of white noise. `smooth_speed` is
what such noise leaves of velocities: signs of speed are taken of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from scipy.special import binom

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.spectrum import Spectrum

#: Order of the differences that leave noise alone.
ORDER = 8

#: Shares of the samples in the variance of a difference, and the quantile above which it is cut.
WEIGHTS = binom(ORDER, np.arange(ORDER + 1)) ** 2 / binom(2 * ORDER, ORDER)
CUT = 0.995

#: Rounds of the fit of variances, and the least of them over the largest when they weigh.
STEPS, FLOOR = 6, 1e-4

#: Noise below this share of a signal moves no value by what could be seen.
NEGLIGIBLE = 1e-3

#: Cut-offs of the smoothed velocity that are tried, and in how many times the best one smoothing
#: ends: what it takes from the motion is the same in every period, and no data average it out. It
#: falls with the eighth power of the cut-off, the noise rises with its root.
TRIED, WIDER = 48, 1.5

#: Noise at rest of less than this share of that in motion (rms) cannot be told from none.
RESOLVED = 0.3

#: Changes are whole multiples of a step up to this share of it.
WHOLE = 1e-3


def noise_level(x: Array, t: Array | None = None) -> Array:
    """Return the standard deviation of white noise on smooth signals (N, n), (n,).

    No difference reaches across a gap in the times t (N,) [s], if they are given.
    """
    if len(x) <= ORDER:
        return np.zeros(x.shape[1])
    differences = np.diff(x, ORDER, axis=0)
    if t is not None:
        gaps = np.concatenate([[0], np.cumsum(signals.has_gap(t))])
        whole = gaps[ORDER:] == gaps[:-ORDER]
        differences = differences[whole] if whole.any() and not whole.all() else differences
    level: Array = np.sqrt(np.mean(differences**2, axis=0) / binom(2 * ORDER, ORDER))
    return level


def resolution(x: Array) -> Array:
    """Return the step of which signals (N, n) are whole multiples, (n,); 0 where none is seen."""
    steps = np.abs(np.diff(x, axis=0))
    found = np.zeros(x.shape[1])
    for k, own in enumerate(steps.T):
        own = own[own > 1e-9 * np.ptp(x[:, k])]  # noqa: PLW2901 - what moved
        least = own.min(initial=np.inf)
        if len(own) and np.all(np.abs(own / least - np.rint(own / least)) < WHOLE):
            found[k] = least
    return found


def lowest_cutoff(
    is_noise: Callable[[float], bool], low: float, high: float, within: float
) -> float:
    """Return the lowest cut-off between two [Hz], within a factor, that leaves out noise alone.

    Parameters
    ----------
    is_noise : callable(float)
        Whether what a cut-off leaves out is no more than noise; the highest need not be asked.
    low, high : float [Hz]
    within : float
    """
    while high > within * low:
        middle = float(np.sqrt(low * high))
        if is_noise(middle):
            high = middle
        else:
            low = middle
    return high


def noise_parts(x: Array) -> tuple[Array, Array]:
    """Return what white noise on smooth signals x (N, n) has at zero and with them, (n,) each.

    Its variance is a constant and a share of the signal's square, both by weighted least
    squares on squared differences; the largest of these, at jumps and glitches, are cut.
    """
    constant, share = np.zeros((2, x.shape[1]))
    if len(x) <= ORDER:
        return constant, share
    squares = np.diff(x, ORDER, axis=0) ** 2 / binom(2 * ORDER, ORDER)
    squares = np.minimum(squares, np.quantile(squares, CUT, axis=0))
    near = scipy.signal.lfilter(WEIGHTS, [1.0], x**2, axis=0)[ORDER:]
    for j in np.flatnonzero(~signals.never_moves(x.min(0), x.max(0))):
        scale = max(float(near[:, j].mean()), 1e-300)
        A = np.column_stack([np.ones(len(near)), near[:, j] / scale])
        fitted = np.full(len(near), 1.0)
        for _ in range(STEPS):  # squares scatter by their own mean: they weigh by one over it
            weight = 1.0 / np.maximum(fitted, FLOOR * fitted.max())
            found = scipy.optimize.nnls(A * weight[:, None], squares[:, j] * weight)[0]
            fitted = A @ found if found.any() else fitted
        constant[j], share[j] = found / [1.0, scale]
    return constant, share


def noise_size(x: Array) -> Array:
    """Return the standard deviation of independent noise on smooth signals x (N, n), (N, n)."""
    constant, share = noise_parts(x)
    size: Array = np.sqrt(constant + share * x**2)
    return size


@frozen
class Smoothing:
    """How velocities that were measured with noise are smoothed, for their signs.

    Attributes
    ----------
    cutoff : float [Hz]
        Of the low-pass.
    sd : (n,) [rad/s or m/s]
        Standard deviation of what is smoothed.
    raw : (n,) bool
        Velocities that are left as they are: near rest they have less noise than the smoothed
        ones, as where noise is a share of the speed.
    """

    cutoff: float
    sd: Array
    raw: np.ndarray

    @staticmethod
    def choose(windows: Sequence[Array], dt: float) -> Smoothing | None:
        """Return what smooths velocities with the least error; None where noise is negligible.

        The cut-off has the least unbiased estimate of the mean square error, of what it takes from
        the motion and what it leaves of the noise [Mallows 1973].

        Parameters
        ----------
        windows : sequence of (N, n)
            Velocities, of equal length.
        dt : float [s]
        """
        level = np.sqrt(np.mean([noise_level(x) ** 2 for x in windows], axis=0))
        size = np.sqrt(np.mean([x.var(0) for x in windows], axis=0))
        noisy = level > NEGLIGIBLE * size
        if not noisy.any():
            return None
        spectrum = Spectrum.of(windows, dt, 1)
        f, power = spectrum.f[1:], spectrum.power[1:, noisy]
        tried = np.geomspace(f[0], 0.45 / dt, TRIED)
        ratio = np.tan(np.pi * f * dt) / np.tan(np.pi * tried * dt)[:, None]
        passed = 1.0 / (1.0 + ratio**8)  # fourth order, there and back
        share = (passed**2).mean(1) * (f[-1] * 2 * dt)
        density = 2 * dt * level[noisy] ** 2
        taken = ((1 - passed) ** 2) @ ((power - density) / density) * f[0]
        best = int(np.argmin(taken.sum(1) + noisy.sum() * 0.5 * share / dt))
        cutoff = min(WIDER * float(tried[best]), float(tried[-1]))
        sd = np.sqrt(np.interp(cutoff, tried, share)) * level
        at_rest = np.sqrt(np.mean([noise_parts(x)[0] for x in windows], axis=0))
        at_rest[~noisy | (at_rest < RESOLVED * level)] = 0.0
        raw = at_rest <= sd
        return None if not at_rest.any() else Smoothing(cutoff, np.minimum(at_rest, sd), raw)

    def apply(self, x: Array, dt: float) -> Array:
        """Return velocities x (N, n) smoothed, and their standard deviation, (N, 2, n)."""
        smooth = np.where(self.raw, x, signals.lowpass(x, dt, self.cutoff))
        return np.stack([smooth, np.broadcast_to(self.sd, x.shape)], axis=1)
