"""The motion of a log as a finite series, fitted to all its channels to reduce noise.

Noise in the motion biases least squares, and more data do not help. A series with few coefficients
is fitted to all measured channels together (positions, velocities, accelerations), so it averages
the noise of many samples. There are two kinds. Splines suit any motion. Fourier series suit
periodic motion and also average over its periods. Akaike's criterion [Akaike 1974], with the number
of independent samples, selects the number of coefficients.

What to use when: `smooth_log` replaces the motion of a log; `find_series` returns the series;
`resample` draws noise that resembles the residuals of a series.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
import scipy

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import ROUNDOFF, TINY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Fields, frozen
from identifiability.logs import signals

from .log import Log
from .spectrum import autocorrelation_time, noise_level, resolution

#: The kinds of series, as `Preparation.derivatives` names them.
Kind = Literal["fourier", "spline"]
KINDS: tuple[Kind, ...] = ("fourier", "spline")

#: Degree of splines: their second derivative has two continuous derivatives itself.
DEGREE = 5

#: Fewest coefficients of a spline, and fewest samples for each.
FEWEST_COEFFICIENTS, SAMPLES_A_COEFFICIENT = 12, 4

#: Harmonics that are tried.
HARMONICS = (3, 5, 7, 10, 14, 20, 28, 40)

#: A period this close to a whole number of samples is that number [samples].
WHOLE: Tolerance = 0.05

#: Largest ratio of the residual power of a requested series to that of splines.
UNLIKE: Tolerance = 2.0


@frozen
class MotionSeries:
    """A series that was fitted to the motion of a log.

    Attributes
    ----------
    kind : {"fourier", "spline"}
    q, dq, ddq : (N, n) [rad or m, a second, a second squared]
        At the times of the log.
    coefficients : int
        Of each joint.
    period : float or None [s]
        Of a Fourier series.
    score : float
        Akaike's criterion; less is better.
    """

    kind: Kind
    q: Array
    dq: Array
    ddq: Array
    coefficients: int
    period: float | None
    score: float

    @property
    def motion(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration, (N, n) each."""
        return self.q, self.dq, self.ddq

    @property
    def note(self) -> str:
        """Return the report's description of the series."""
        told = "the motion is a spline through all that was measured of it, of "
        if self.period is not None:
            told = (
                f"the motion is a Fourier series of all that was measured of it, with period "
                f"{self.period:.6g} s and "
            )
        return f"{told}{self.coefficients} coefficients a joint"

    def left_of(self, log: Log) -> dict[str, Array]:
        """Return the residuals of each measured channel, (N, n) each."""
        pairs = zip(("q", "dq", "ddq"), self.motion, strict=True)
        channels = ((name, getattr(log, name), own) for name, own in pairs)
        return {name: x - own for name, x, own in channels if x is not None}


def smooth_log(log: Log, kind: Kind, *, strict: bool = True) -> Log:
    """Return a log whose motion is a series, with velocities and accelerations.

    Parameters
    ----------
    log : Log
        In memory.
    kind : {"fourier", "spline"}
    strict : bool
        Whether a log is refused whose motion does not repeat; else a spline is used.

    Raises
    ------
    LogError
        If the motion does not repeat and a Fourier series must be used.
    """
    found = find_series(log)
    # A series of few rows has no more information than these.
    if "spline" not in found:
        return log
    series = found.get(kind, found["spline"])
    spline = found["spline"]
    if kind == "fourier" and not _repeats(log, series, spline):
        if strict:
            raise LogError(Finding("series.none", log.name))
        series = spline
    return with_series(log, series)


def _repeats(log: Log, fourier: MotionSeries, spline: MotionSeries) -> bool:
    """Return whether a Fourier series leaves hardly more of any channel than a spline."""
    left, least = (
        [float(np.sum(x**2)) for x in own.left_of(log).values()] for own in (fourier, spline)
    )
    floor = TINY * len(log)
    return fourier is not spline and all(
        a <= UNLIKE * b + floor for a, b in zip(left, least, strict=True)
    )


def with_series(log: Log, series: MotionSeries) -> Log:
    """Return a log with the motion of a series, how well it knows speeds, and a note."""
    q, dq, ddq = series.motion
    again = refit(series, plant(log, series, np.random.default_rng(0)))
    error = np.sqrt(np.mean((again.dq - dq) ** 2, axis=0))
    notes = (*log.notes, series.note)
    return replace(log, q=q, dq=dq, ddq=ddq, notes=notes, speed_error=error)


def plant(log: Log, series: MotionSeries, rng: np.random.Generator) -> Log:
    """Return a log that moves as a series, with noise that resembles its residuals."""
    true = dict(zip(("q", "dq", "ddq"), series.motion, strict=True))
    left = series.left_of(log)
    noisy: Fields = {name: true[name] + resample(x, rng) for name, x in left.items()}
    return replace(log, **noisy)


@frozen
class SplineFit:
    """The best spline of a log, and the memory of its noise.

    Attributes
    ----------
    best : MotionSeries
    memory : tuple of (n,) [samples]
        Autocorrelation times of the noise of each measured channel, behind the richest spline.
    """

    best: MotionSeries
    memory: tuple[Array, ...]


def find_series(log: Log) -> dict[Kind, MotionSeries]:
    """Return the best series of each kind; without a Fourier series of a motion never repeated."""
    spline = find_spline(log)
    if spline is None:
        return {}
    return add_fourier(log, spline)


def _measured(log: Log) -> tuple[Array, list[Array], list[Array]]:
    """Return times from zero on (N,), the measured channels (N, n), and their noise (n,)."""
    channels = [x for x in (log.q, log.dq, log.ddq) if x is not None]
    return log.t - log.t[0], channels, [measured_noise(x, log.t) for x in channels]


def find_spline(log: Log) -> SplineFit | None:
    """Return the best spline of a log; None for one of too few rows."""
    t, channels, noise = _measured(log)
    splines = [
        _solve("spline", _spline_bases(t, count), channels, noise) for count in _counts(len(t))
    ]
    if not splines:
        return None
    # How long the noise remembers is seen behind the richest spline.
    richest = splines[-1].motion
    left = [x - own for x, own in zip(channels, richest, strict=False)]
    memory = tuple(autocorrelation_time(x) for x in left)
    return SplineFit(_best(splines, channels, memory), memory)


def add_fourier(log: Log, spline: SplineFit) -> dict[Kind, MotionSeries]:
    """Return the best series of each kind, given the spline."""
    t, channels, noise = _measured(log)
    found: dict[Kind, MotionSeries] = {"spline": spline.best}
    fourier = list(_fourier_series(t, channels, noise, spline.best))
    if fourier:
        found["fourier"] = _best(fourier, channels, spline.memory)
    return found


def refit(series: MotionSeries, log: Log) -> MotionSeries:
    """Return a series with as many coefficients, and the same period, through another log."""
    t, channels, noise = _measured(log)
    if series.period is None:
        return _solve("spline", _spline_bases(t, series.coefficients), channels, noise)
    bases = signals.fourier_bases(t, series.period, (series.coefficients - 1) // 2)
    return _solve("fourier", bases, channels, noise, series.period)


def resample(left: Array, rng: np.random.Generator) -> Array:
    """Return noise that resembles residuals, (N, n): their segments with random signs.

    A segment is several autocorrelation times long, so the noise keeps its autocorrelation. The
    noise also keeps its size along the motion, for example in proportion to the speed.
    """
    # A stretch of five correlation times loses a tenth of the correlation at its ends.
    times = autocorrelation_time(left)
    length = max(1, int(np.ceil(5 * np.median(times - 1.0))))
    stretch = np.arange(len(left)) // length
    last = int(stretch[-1])
    signs = rng.choice([-1.0, 1.0], (last + 1, left.shape[1]))
    return left * signs[stretch]


def measured_noise(x: Array, t: Array) -> Array:
    """Return the standard deviation of white noise in signals (N, n), (n,)."""
    # While a coarse encoder stands still, its noise is constant, so differences do not show it.
    return np.maximum(noise_level(x, t), resolution(x) / np.sqrt(12))


def _counts(samples: int) -> list[int]:
    """Return the numbers of coefficients that are tried for splines."""
    most = samples / SAMPLES_A_COEFFICIENT
    if most < FEWEST_COEFFICIENTS:
        return []
    # Every second one has twice as many.
    tries = int(2 * np.log2(most / FEWEST_COEFFICIENTS)) + 1
    return [int(FEWEST_COEFFICIENTS * 2 ** (k / 2)) for k in range(tries)]


# Bases: the columns of position, velocity and acceleration, (N, K) each.


def _spline_bases(t: Array, count: int) -> list[Any]:
    """Return sparse bases of splines with evenly spaced knots."""
    inner = np.linspace(t[0], t[-1], count - DEGREE + 1)
    knots = np.concatenate([[t[0]] * DEGREE, inner, [t[-1]] * DEGREE])
    design = scipy.interpolate.BSpline.design_matrix
    bases = [design(t, knots, DEGREE)]
    slopes = scipy.sparse.eye_array(count, format="csr")
    for order in (1, 2):
        degree = DEGREE - order + 1
        # The slope of a B-spline is a difference of two of one degree less [de Boor 1978].
        width = knots[degree + 1 : -1] - knots[1 : -degree - 1]
        rate = degree / np.where(width > 0, width, np.inf)
        shape = (len(rate), len(rate) + 1)
        step = scipy.sparse.diags_array([-rate, rate], offsets=[0, 1], shape=shape)
        slopes = step @ slopes
        knots = knots[1:-1]
        bases.append(design(t, knots, degree - 1) @ slopes)
    return [scipy.sparse.csr_array(x) for x in bases]


def _solve(
    kind: Kind,
    bases: Sequence[Any],
    channels: Sequence[Array],
    noise: Sequence[Array],
    period: float | None = None,
) -> MotionSeries:
    """Return the series that fits all channels best, each joint weighted by the channels' noise."""
    squares = [_gram(B) for B, _ in zip(bases, channels, strict=False)]
    motion = np.empty((3, *channels[0].shape))
    for joint in range(channels[0].shape[1]):
        own = [x[:, joint] for x in channels]
        origin = own[0].mean()  # small numbers, small rounding
        own[0] = own[0] - origin
        weights = _channel_weights(own, [s[joint] for s in noise])
        bands = sum(w * G for w, G in zip(weights, squares, strict=True))
        right = sum(w * (B.T @ x) for w, B, x in zip(weights, bases, own, strict=False))
        # A spline may have coefficients in a gap, which no sample determines.
        bands[-1] += TINY * bands[-1].mean()
        values = scipy.linalg.solveh_banded(bands, right)
        for order, basis in enumerate(bases):
            motion[order, :, joint] = basis @ values
        motion[0, :, joint] += origin
    q, dq, ddq = motion
    return MotionSeries(kind, q, dq, ddq, bases[0].shape[1], period, np.inf)


def _gram(basis: Any) -> Array:
    """Return the products of a basis with itself by diagonals, the main one last, (b, K)."""
    product = basis.T @ basis
    K = product.shape[0]
    width = DEGREE if scipy.sparse.issparse(product) else K - 1
    bands = np.zeros((width + 1, K))
    for offset in range(width + 1):
        bands[width - offset, offset:] = product.diagonal(offset)
    return bands


def _channel_weights(channels: Sequence[Array], noise: Sequence[float]) -> Array:
    """Return one over the variance of each channel's noise, the largest being one."""
    floor = [ROUNDOFF * x.std() for x in channels]
    variance = np.maximum(np.maximum(noise, floor), 1e-150) ** 2
    return variance.min() / variance


def _best(
    tried: Sequence[MotionSeries], channels: Sequence[Array], memory: Sequence[Array]
) -> MotionSeries:
    """Return the series with the least criterion of Akaike, with its score."""
    scored = [replace(x, score=_score(x, channels, memory)) for x in tried]
    return min(scored, key=lambda x: x.score)


def _score(series: MotionSeries, channels: Sequence[Array], memory: Sequence[Array]) -> float:
    """Return Akaike's criterion; it uses the number of independent samples."""
    N, joints = channels[0].shape
    score = 2.0 * series.coefficients * joints
    for x, own, times in zip(channels, series.motion, memory, strict=False):
        power = np.mean((x - own) ** 2, axis=0)
        least = (ROUNDOFF * x.std(0)) ** 2 + 1e-300  # rounding is no noise
        score += float(np.sum(N / times * np.log(np.maximum(power, least))))
    return score


# Fourier series: the period is found from the spline, which has little noise.


def _fourier_series(
    t: Array, channels: Sequence[Array], noise: Sequence[Array], spline: MotionSeries
) -> Iterator[MotionSeries]:
    """Yield Fourier series of the motion's period, with more and more harmonics."""
    step = signals.sampling_step(t)
    for found in _periods(t, spline):
        period = _refine(t, channels, noise, found)
        for harmonics in HARMONICS:
            # The shortest period of a harmonic has four samples, and samples must outnumber them.
            if 4 * harmonics * step > period or 8 * harmonics > len(t):
                break
            bases = signals.fourier_bases(t, period, harmonics)
            yield _solve("fourier", bases, channels, noise, period)


def _periods(t: Array, spline: MotionSeries) -> list[float]:
    """Return periods that are tried: the whole log, and that after which the motion repeats."""
    step = signals.sampling_step(t)
    tried = [float(t[-1] + step)]
    if signals.has_gap(t).any():
        return tried
    moving = ~signals.never_moves(spline.q.min(0), spline.q.max(0))
    if not moving.any():
        return tried
    state = np.hstack([spline.q[:, moving], spline.dq[:, moving]])
    apart = _differences((state - state.mean(0)) / state.std(0))
    # Behind the first lag at which the motion is another one.
    elsewhere = np.flatnonzero(apart > 0.5)
    if not len(elsewhere):
        return tried
    first = int(elsewhere[0])
    least = apart[first:].min(initial=np.inf)
    # The first lag that is nearly as good as the best: multiples of a period are as good.
    near = first + np.flatnonzero(apart[first:] <= 2.0 * least + 1e-3)
    stop = near[0]
    while stop + 1 < len(apart) and apart[stop + 1] < apart[stop]:
        stop += 1
    return [*tried, float(stop * step)]


def _differences(state: Array) -> Array:
    """Return how far a motion is from itself k samples later, over its variance, (N / 2,)."""
    N = len(state)
    size = 1 << (2 * N - 1).bit_length()
    spectrum = np.fft.rfft(state, size, axis=0)
    periodogram = np.abs(spectrum) ** 2
    products = np.fft.irfft(periodogram, size, axis=0)[:N].sum(1)
    power = np.concatenate([[0.0], np.cumsum((state**2).sum(1))])
    lags = np.arange(N // 2 + 1)
    both = power[N - lags] + (power[N] - power[lags])
    mean = (both - 2.0 * products[lags]) / (N - lags)
    return mean / (2.0 * power[N] / N)


def _refine(t: Array, channels: Sequence[Array], noise: Sequence[Array], period: float) -> float:
    """Return the period near one that was found whose series leaves least [s]."""
    step = signals.sampling_step(t)
    harmonics = min(HARMONICS[1], int(period / (4 * step)))
    if period > t[-1] or not harmonics:  # the whole log
        return period
    # Two thousand samples are enough; the fastest harmonic has four samples per period.
    spare = min(-(-len(t) // 2000), int(period / (4 * harmonics * step)))
    every = slice(None, None, max(spare, 1))
    few = t[every], [x[every] for x in channels], noise, harmonics
    bounds = (period - step, period + step)
    found = scipy.optimize.minimize_scalar(
        partial(_misfit, *few),
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-4 * step},
    )
    # A controller repeats its motion after a whole number of samples.
    samples = float(found.x) / step
    whole = abs(samples - round(samples)) < WHOLE
    if whole:
        return step * round(samples)
    return float(found.x)


def _misfit(
    t: Array, channels: Sequence[Array], noise: Sequence[Array], harmonics: int, period: float
) -> float:
    """Return the sum of squared residuals of a Fourier series, in units of the noise."""
    bases = signals.fourier_bases(t, period, harmonics)
    motion = _solve("fourier", bases, channels, noise, period).motion
    total = 0.0
    for x, own, level in zip(channels, motion, noise, strict=False):
        least = ROUNDOFF * x.std(0) + 1e-150
        total += float(np.sum(((x - own) / np.maximum(level, least)) ** 2))
    return total
