"""Band of a motion, the noise under it, and the low-pass that suits both.

Derivatives multiply noise by the frequency. The cut-off of their low-pass has two limits. It must
leave the motion alone, which takes 5 to 10 times the bandwidth of the motion [Gautier 1997]. And
the noise that passes into the acceleration must be small compared with the acceleration.

What to use when: `Spectrum.of` for a log; `choose_band` for all logs that share a cut-off;
`bandwidth_of_windows` for the bandwidth alone. The band of `choose_band` is the widest one: torque
may need a narrower one (`identifiability.estimation.cutoff`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.special import binom

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen

from . import signals
from .rules import RULES

#: Samples of encoders so coarse that they change more slowly are averaged until they change every
#: time, but no longer than this.
COARSE: Tolerance = 0.02

#: The noise at a frequency is the median over these multiples of it. A motion falls there by orders
#: of magnitude, and white noise does not. Rounding of coarse encoders has a flat spectrum only up
#: to the rate of its steps.
ABOVE: tuple[Tolerance, Tolerance] = (2.0, 8.0)

#: Fewest averages of the samples of a coarse encoder.
LEFT = 256


@frozen
class Spectrum:
    """Power spectrum of the signal to differentiate, and its noise.

    Attributes
    ----------
    rate : float [Hz]
        Sampling rate.
    f : (K,) [Hz]
        Frequencies, evenly spaced from zero to half the rate, or less for a coarse encoder.
    power : (K, n) [(rad or m)²/Hz, or of a velocity]
        One-sided density of each joint.
    order : int
        Number of differentiations to acceleration: 2 for positions, 1 for velocities.
    """

    rate: float
    f: Array
    power: Array
    order: int

    @staticmethod
    def of(windows: Sequence[Array], dt: float, order: int = 2) -> Spectrum:
        """Return the spectrum of windows of equal length, each (N, n); they are averaged."""
        rate = 1.0 / dt
        windows, dt = _average_steps(windows, dt)
        length = len(windows[0])
        wave = np.cos(2 * np.pi * np.arange(length) / length)
        taper = (0.5 - 0.5 * wave)[:, None]  # Hann
        power = [np.abs(np.fft.rfft(taper * (x - x.mean(0)), axis=0)) ** 2 for x in windows]
        scale = 2 * dt / max(float((taper**2).sum()), 1e-300)
        frequencies = np.fft.rfftfreq(length, dt)
        mean_power = scale * np.mean(power, axis=0)
        return Spectrum(rate, frequencies, mean_power, order)

    @cached_property
    def smooth(self) -> Array:
        """The power averaged over a third of an octave, (K, n): repeated motion makes lines."""
        k = np.arange(len(self.f))
        low = (k / 2 ** (1 / 6)).astype(int)
        high = np.ceil(k * 2 ** (1 / 6)).astype(int) + 1
        high = np.minimum(high, len(k))
        none = np.zeros((1, self.power.shape[1]))
        total = np.concatenate([none, np.cumsum(self.power, 0)])
        return (total[high] - total[low]) / (high - low)[:, None]

    @cached_property
    def noise(self) -> Array:
        """Density of the noise, (K, n)."""
        last = len(self.f) - 1
        # Some sixteen frequencies a decade.
        at = np.unique(np.geomspace(1, max(last, 1), 80).astype(int))
        low = np.minimum((ABOVE[0] * at).astype(int), int(0.9 * last))
        high = np.maximum((ABOVE[1] * at).astype(int), low + 2)
        bands = zip(low, high, strict=True)
        found = np.array([np.median(self.smooth[a:b], axis=0) for a, b in bands])
        found_at = np.searchsorted(at, np.arange(last + 1), "right") - 1
        nearest = np.clip(
            found_at,
            0,
            len(at) - 1,
        )
        return found[nearest]

    @cached_property
    def motion(self) -> Array:
        """Density of the motion above the noise, (K, n)."""
        above = np.where(self.smooth > RULES.motion_seen * self.noise, self.power - self.noise, 0.0)
        return np.maximum(above, 0.0)

    def bandwidths(self) -> Array:
        """Return below which frequency 99 % of each velocity's energy lies, (n,) [Hz]."""
        energy = np.cumsum(self.motion * self._slope(self.order - 1), axis=0)
        reach = []
        for e in energy.T:
            at = np.searchsorted(e, 0.99 * e[-1])
            reach.append(self.f[at] if e[-1] > 0 else 0.0)
        return np.array(reach)

    def acceleration(self, below: float) -> Array:
        """Return the mean square of each joint's acceleration up to a frequency, (n,)."""
        inside = self.f <= below
        density = self.motion * self._slope(self.order)
        return self.f[1] * density[inside].sum(0)

    def noise_in_acceleration(self, cutoff: float) -> Array:
        """Return the mean square that noise has in each acceleration below a cut-off, (n,)."""
        at = min(int(np.searchsorted(self.f, cutoff)), len(self.f) - 1)
        slope = (2 * np.pi * cutoff) ** (2 * self.order)
        return self.noise[at] * slope * cutoff / (2 * self.order + 1)

    def _slope(self, order: int) -> Array:
        return (2 * np.pi * self.f[:, None]) ** (2 * order)


def _average_steps(windows: Sequence[Array], dt: float) -> tuple[Sequence[Array], float]:
    """Return averages in which a coarse encoder changes nearly every time, and their step.

    Steps of the encoder that last many samples are not white noise. Averages over these steps are a
    smooth motion with noise.
    """
    changes = [np.flatnonzero(x) for w in windows for x in np.diff(w, axis=0).T]
    # The median does not see rests.
    lengths = [float(np.median(np.diff(at))) for at in changes if len(at) > 1]
    block = int(min(max(lengths, default=1.0), COARSE / dt, len(windows[0]) / LEFT))
    if block < 2:
        return windows, dt
    rows = len(windows[0]) // block
    blocks = (x[: rows * block].reshape(rows, block, -1) for x in windows)
    return [x.mean(1) for x in blocks], dt * block


def spectra_of(windows: Sequence[Array], dt: float, order: int = 2) -> list[Spectrum]:
    """Return one spectrum of windows of equal length; for unequal ones, one for each length.

    Windows below half the longest length are left out, because they show no slow motion.
    """
    lengths = sorted({len(x) for x in windows}, reverse=True)
    used = [n for n in lengths if 2 * n > lengths[0]]
    return [Spectrum.of([x for x in windows if len(x) == n], dt, order) for n in used]


def bandwidth_of_windows(windows: Sequence[Array], dt: float) -> float:
    """Return the bandwidth of a motion [Hz], with 99 % of the velocity's energy of every joint.

    Parameters
    ----------
    windows : sequence of (N, n) [rad or m]
        Positions; windows below half the longest length are ignored.
    dt : float [s]
    """
    return _widest(spectra_of(windows, dt))


def _widest(spectra: Sequence[Spectrum]) -> float:
    """Return the largest bandwidth of a joint [Hz]."""
    bands = (s.bandwidths().max(initial=0.0) for s in spectra)
    return float(max(bands))


@frozen
class BandAdvice:
    """The cut-off with the best prediction of unseen torque, compared with one set by hand.

    Attributes
    ----------
    cutoff : float [Hz]
        Cut-off of the motion.
    outputs : float [Hz]
        Upper limit of the kept band of torque and columns.
    error : float
        Relative error of the torque of unseen blocks with this cut-off.
    given : float
        The same with the cut-off that was set.
    """

    cutoff: float
    outputs: float
    error: float
    given: float


@frozen
class Band:
    """The low-pass of computed derivatives, the band of torque, and the band of the motion.

    Torque and columns pass the same decimation filter; the motion passes one more. If both filters
    end in the same band, sharp events such as reversals of dry friction differ. The second filter
    removes part of the inertia torque, and the sign of a smoothed speed changes at another time. So
    the motion is low-passed where its noise begins to matter, and the kept band ends well below.

    Attributes
    ----------
    cutoff : float [Hz]
        Of the motion.
    outputs : float [Hz]
        Upper limit of the kept band of torque and columns.
    bandwidth : float [Hz]
        Bandwidth of the motion, for the fastest joint and log.
    limit : float [Hz]
        Largest frequency at which noise has at most `noise_share` of the power of every
        acceleration.
    noise : float
        Share of noise in the power of an acceleration at the cut-off, for the worst joint.
    reason : str
        Reason of the limit of outputs, for the report; empty if the cut-off was given.
    rate : float [Hz]
        Sampling rate of the slowest log.
    advice : BandAdvice or None
        A better cut-off than the one set by hand; None if none was set, or tried.
    """

    cutoff: float
    outputs: float
    bandwidth: float
    limit: float
    noise: float
    reason: str
    rate: float = np.inf
    advice: BandAdvice | None = None

    @property
    def sampled_slowly(self) -> bool:
        """Return whether slow sampling makes the cut-off so low that it cuts into the motion."""
        limited = self.cutoff >= RULES.nearly_all * RULES.cutoff_highest * self.rate
        return limited and self.cutoff < 2.0 * self.bandwidth


def choose_band(
    spectra: Sequence[Spectrum],
    sliding: Sequence[bool] = (),
    cutoff: float | None = None,
) -> Band:
    """Return the low-pass for all logs that share a cut-off.

    Torque and columns are kept up to ten times the bandwidth of the motion, and at least up to
    `cutoff_lowest`. The limit is lower if noise would have more than `small` of the power of an
    acceleration. It is never below twice the bandwidth, and at most a fifth of the sampling rate.
    The motion is low-passed at this limit, or above it as far as noise and the sampling rate of
    computed columns allow.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Spectrum of each log, with the same joints.
    sliding : (n,) bool
        Mask of prismatic joints: accelerations are compared within a kind.
    cutoff : float or None [Hz]
        A given cut-off; None chooses it.
    """
    band = _widest(spectra)
    rate = min(s.rate for s in spectra)
    highest = RULES.cutoff_highest * rate
    most = max(RULES.cutoff_wide * band, RULES.cutoff_lowest)
    signal = np.sum([s.acceleration(most) for s in spectra], axis=0)
    kinds = np.array(sliding or [False] * len(signal), bool)
    largest = [signal[kinds == kind].max(initial=0.0) for kind in kinds]
    # Joints that accelerate less than this share of the most do not lower the cut-off.
    counts = (signal > 0) & (signal >= 0.1**2 * np.array(largest))

    def noise(at: float) -> float:
        power = np.sum([s.noise_in_acceleration(at) for s in spectra], axis=0)
        return float((power[counts] / signal[counts]).max(initial=0.0))

    tried = np.geomspace(2.0 * max(band, 0.1), 0.5 * highest / RULES.cutoff_highest, 129)
    loud = np.flatnonzero([noise(at) > RULES.small for at in tried])
    limit = float(tried[max(loud[0] - 1, 0)] if len(loud) else tried[-1])
    if cutoff is not None:
        return Band(cutoff, cutoff, band, limit, noise(cutoff), "", rate)
    chosen = most
    reason = f"{RULES.cutoff_wide:g} × the motion's band of {band:.3g} Hz"
    if most == RULES.cutoff_lowest:
        reason = f"the least there is, the motion's band is {band:.2g} Hz"
    if limit < chosen:
        chosen = limit
        own = noise(limit)
        which = "above, noise has more than" if own <= RULES.small else "although noise has"
        reason = (
            f"{chosen / max(band, 1e-3):.2g} × the motion's band of {band:.3g} Hz, {which} "
            f"{percent(max(own, RULES.small), 2)} of the acceleration's power"
        )
    if highest < chosen:
        chosen = highest
        reason = f"{RULES.cutoff_highest:g} × the sampling rate, the motion reaches {band:.3g} Hz"
    wide = max(chosen, min(limit, highest))
    return Band(wide, chosen, band, limit, noise(wide), reason, rate)


# White noise, gaps and steps of measured signals, from differences between their samples.
#
# Differences of high order remove a smooth motion and keep white noise.


#: Order of the differences that leave noise alone.
ORDER = 8


def noise_level(x: Array, t: Array | None = None) -> Array:
    """Return the standard deviation of white noise on smooth signals (N, n), (n,).

    No difference reaches across a gap in the times t (N,) [s], if they are given.
    """
    if len(x) <= ORDER:
        return np.zeros(x.shape[1])
    return np.sqrt(np.mean(_rough(x, t) ** 2, axis=0))


def _rough(x: Array, t: Array | None) -> Array:
    """Return differences that keep the size of noise and remove smooth signals."""
    differences = np.diff(x, ORDER, axis=0)
    if t is not None:
        gaps = np.concatenate([[0], np.cumsum(signals.has_gap(t))])
        whole = gaps[ORDER:] == gaps[:-ORDER]
        differences = differences[whole] if whole.any() and not whole.all() else differences
    return differences / np.sqrt(binom(2 * ORDER, ORDER))


def resolution(x: Array) -> Array:
    """Return the step of which signals (N, n) are integer multiples, (n,); 0 if there is none."""
    steps = np.abs(np.diff(x, axis=0))
    found = np.zeros(x.shape[1])
    for k, own in enumerate(steps.T):
        own = own[own > ROUNDOFF * np.ptp(x[:, k])]  # noqa: PLW2901 - what moved
        least = own.min(initial=np.inf)
        if len(own) and np.all(np.abs(own / least - np.rint(own / least)) < RULES.negligible):
            found[k] = least
    return found


def noise_at_rest(x: Array) -> Array:
    """Return the variance of white noise on smooth signals x (N, n) near zero, (n,).

    The fifth of the samples with the smallest values decides, because noise may be in proportion to
    the signal.
    """
    if len(x) <= ORDER:
        return np.zeros(x.shape[1])
    size = np.abs(x[ORDER // 2 : len(x) - ORDER // 2])
    # The share of samples near zero.
    slow = size <= np.quantile(size, 0.2, axis=0)
    squares = _rough(x, None) ** 2
    return (squares * slow).sum(0) / slow.sum(0)


# The autocorrelation time of a series.


#: Autocorrelations are summed over this many times their sum.
WINDOW: Tolerance = 5.0


def autocorrelation(residual: Array) -> Array:
    """Return the autocorrelation of each column of residuals (N, n) by FFT, (N, n); 1 at lag 0."""
    size = 1 << (2 * len(residual) - 1).bit_length()
    spectrum = np.fft.rfft(residual - residual.mean(0), size, axis=0)
    acf = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: len(residual)]
    variance = np.where(acf[0] > 0, acf[0], 1.0)
    return acf / variance


def autocorrelation_time(residual: Array) -> Array:
    """Return the integrated autocorrelation time of each column of (N, n), at least 1, (n,).

    ``1 + 2 Σ ρ_k`` up to the first lag beyond `WINDOW` times the sum so far [Sokal 1997].
    Variances of means grow by it; standard deviations of white-noise formulas by its root.
    """
    return np.maximum(integrate_correlation(autocorrelation(residual)), 1.0)


def integrate_correlation(acf: Array) -> Array:
    """Return the integrated autocorrelation time of correlations at lags 0, 1, … (N, n), (n,)."""
    times = 2.0 * np.cumsum(acf, axis=0) - 1.0
    beyond = np.arange(len(acf))[:, None] >= WINDOW * times
    window = np.where(beyond.any(0), beyond.argmax(0), len(acf) - 1)
    return times[window, np.arange(acf.shape[1])]
