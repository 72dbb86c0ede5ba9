"""A second record of a log's motion, with errors of its own: what instruments are made of.

The first that exists of: the mean of some repetitions of the motion, in its own log or in others; a
Fourier series that explains all that was measured of the motion but its noise; one repetition or
two; the smoothed motion, where velocity and acceleration were measured with noise of their own; the
motion that was commanded. A motion whose derivatives were computed from the same noisy positions,
and that is none of these, has none. No simulator and no data sheet is asked: noise is what remains
of differences of high order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare.command import follow_command, follow_rollout
from identifiability.logs.prepare.preparation import SHORT
from identifiability.logs.prepare.repetition import Repetition, find_repetition
from identifiability.logs.prepare.samples import Record, Samples
from identifiability.logs.prepare.white_noise import (
    NEGLIGIBLE,
    Smoothing,
    lowest_cutoff,
    noise_level,
    resolution,
)

#: A series explains a motion if what is left is at most so many times the noise.
EXPLAINED = 1.15

#: Harmonics that are tried.
HARMONICS = (5, 10, 20, 40)

#: Samples of a log in which its period is looked for.
ENOUGH = 4096

#: A smoothed motion may reach up to this share of the sampling rate: it shares the noise of its
#: band. The cut-off is found within this factor.
SHARED, WIDER = 0.15, 1.2

#: The mean of so many repetitions has a third of the noise's power or less, and none of the log's
#: own; of fewer, a series that explains the motion has less noise.
MANY = 3


@frozen
class SecondRecord:
    """A second record of the motion of the actuated joints.

    Attributes
    ----------
    motion : tuple of (N, n)
        Position, velocity and acceleration.
    note : str
        Which one it is.
    kind : {"measured", "smoothed", "command"}
    noise : tuple of (n,)
        Of each channel that was measured.
    series : FourierFit or None
        What the motion is of.
    cutoffs : tuple of float [Hz]
        Low-pass of each channel, where the motion is the smoothed one; infinite for none.
    speed : (N, 2, n) or None
        Velocity and its standard deviation of all that was measured of it, the log's own included:
        what signs are taken of. None where nothing is better than the log's own, smoothed.
    """

    motion: tuple[Array, Array, Array]
    note: str
    kind: Record = "measured"
    noise: tuple[Array, ...] = ()
    series: fourier.FourierFit | None = None
    cutoffs: tuple[float, ...] = ()
    speed: Array | None = None

    def again(self, log: Log) -> SecondRecord | None:
        """Return the record of another log of this motion; None where it must be looked for."""
        channels, t = _channels(log), log.t - log.t[0]
        if self.cutoffs:
            return replace(self, motion=_filter(channels, t, self.cutoffs))
        if self.series is None:
            return None
        period, harmonics = self.series.period, self.series.harmonics
        series = fourier.fit_fourier_jointly(t, channels, self.noise, period, harmonics)
        return _of_series(series, log, self.noise)


def find_record(
    log: Log, samples: Samples, others: Sequence[Samples] = (), *, always: bool = False
) -> SecondRecord | None:
    """Return a second record of the motion of a log on the joint side; None where there is none."""
    if log.rollout is not None:
        return SecondRecord(*follow_rollout(log, samples.cutoff), "command")
    channels = _channels(log)
    # While a coarse encoder stands still, its noise does so too: differences do not see it.
    noise = [np.maximum(noise_level(x, log.t), resolution(x) / np.sqrt(12)) for x in channels]
    size = [x.std(0) for x in channels]
    worst = max(_share(s, v) for s, v in zip(noise, size, strict=True))
    if worst < NEGLIGIBLE and len(channels) == 3 and not always:
        return None
    again, series = find_repetition(samples, others), None
    if samples.cutoff is not None or len(channels) == 3:
        series = _fit_series(log, channels, noise)
    of_series = None if series is None else _of_series(series, log, noise)
    if again is not None and (again.count >= MANY or of_series is None):
        repeat = _repeat(again, samples, log)
        return repeat if of_series is None else replace(repeat, speed=of_series.speed)
    if of_series is not None:
        return of_series
    if samples.cutoff is None and len(channels) == 3:
        smooth = _smooth(log, channels, noise)
        if smooth is not None:
            return smooth
    followed = follow_command(log, samples.cutoff)
    return None if followed is None else SecondRecord(*followed, "command")


def _share(noise: Array, size: Array) -> float:
    """Return the largest share of noise (n,) in the size (n,) of signals that vary."""
    return float(np.max(noise / np.maximum(size, 1e-300), where=size > 0, initial=0.0))


def _repeat(again: Repetition, samples: Samples, log: Log) -> SecondRecord:
    """Return repetitions at the prepared samples as a record at all rows of the log."""
    kept = samples.motion.kept
    full = np.zeros((3, *log.q.shape))
    full[:, kept] = again.motion
    q, dq, ddq = full
    note = (
        f"the instruments' motion is the mean of its repetitions, on average of {again.count:.3g}"
    )
    speed = None
    if log.dq is not None and samples.cutoff is None and len(kept) > SHORT:
        mean, dt = log.dq.copy(), signals.sampling_step(log.t)
        mean[kept] = (again.count * dq[kept] + log.dq[kept]) / (again.count + 1)
        smoothing = Smoothing.choose([mean], dt)
        speed = None if smoothing is None else smoothing.apply(mean, dt)
    return SecondRecord((q, dq, ddq), note, speed=speed)


def _of_series(series: fourier.FourierFit, log: Log, noise: Sequence[Array]) -> SecondRecord:
    """Return the motion of a series that was fitted to all that was measured."""
    note = (
        "the instruments' motion is a Fourier series of all that was measured of it, of "
        f"{series.harmonics} harmonics with period {series.period:.6g} s"
    )
    motion, speed = series.motion(log.t - log.t[0]), None
    if log.dq is not None:
        sd = noise[1] * np.sqrt((2 * series.harmonics + 1) / len(log))
        speed = np.stack([motion[1], np.broadcast_to(sd, motion[1].shape)], axis=1)
    return SecondRecord(motion, note, noise=tuple(noise), series=series, speed=speed)


def _channels(log: Log) -> list[Array]:
    """Return what was measured of the motion."""
    return [x for x in (log.q, log.dq, log.ddq) if x is not None]


def _fit_series(
    log: Log, channels: Sequence[Array], noise: Sequence[Array]
) -> fourier.FourierFit | None:
    """Return the series that explains all channels up to their noise; None if none does."""
    t = log.t - log.t[0]
    step = -(-len(t) // ENOUGH)
    shares = [
        float(np.mean(s / np.maximum(x.std(0), 1e-300)))
        for x, s in zip(channels, noise, strict=True)
    ]
    clearest = channels[int(np.argmin(shares))][::step]
    for harmonics in HARMONICS:
        if 8 * harmonics > len(t):
            break
        period = fourier.find_period(t[::step], clearest, harmonics)
        if 4 * harmonics * signals.sampling_step(t) > period:
            continue
        fit = fourier.fit_fourier_jointly(t, channels, noise, period, harmonics)
        left = [x - y for x, y in zip(channels, fit.motion(t), strict=False)]
        pairs = zip(left, channels, noise, strict=True)
        if all(_explained(rest, x, level) for rest, x, level in pairs):
            return fit
    return None


def _explained(rest: Array, x: Array, noise: Array) -> bool:
    floor = 1e-6 * x.std(0)
    return bool(np.all(np.sqrt(np.mean(rest**2, 0)) <= EXPLAINED * noise + floor))


def _smooth(log: Log, channels: Sequence[Array], noise: Sequence[Array]) -> SecondRecord | None:
    """Return the low-passed motion; None where its band would hold much of the noise too."""
    if signals.has_gap(log.t).any():  # a filter does not reach across
        return None
    dt = signals.sampling_step(log.t)
    cutoffs = tuple(_smoothing(x, level, dt) for x, level in zip(channels, noise, strict=True))
    if any(f * dt > SHARED for f in cutoffs if np.isfinite(f)):
        return None
    used = ", ".join(f"{f:.3g} Hz" if np.isfinite(f) else "not at all" for f in cutoffs)
    note = (
        "the instruments' motion is the measured one smoothed, position, velocity and acceleration "
        f"low-passed at {used}"
    )
    return SecondRecord(
        _filter(channels, log.t, cutoffs), note, "smoothed", tuple(noise), cutoffs=cutoffs
    )


def _filter(
    channels: Sequence[Array], t: Array, cutoffs: Sequence[float]
) -> tuple[Array, Array, Array]:
    dt = signals.sampling_step(t)
    q, dq, ddq = (
        signals.lowpass(x, dt, f) if np.isfinite(f) else x
        for x, f in zip(channels, cutoffs, strict=True)
    )
    return q, dq, ddq


def _smoothing(x: Array, noise: Array, dt: float) -> float:
    """Return the lowest cut-off [Hz] that leaves out no more than noise; ∞ where there is none."""
    if np.all(noise <= NEGLIGIBLE * x.std(0)):
        return np.inf

    def is_noise(cutoff: float) -> bool:
        return _explained(x - signals.lowpass(x, dt, cutoff), x, noise)

    high = SHARED / dt
    if not is_noise(high):
        return 2.0 * high
    return lowest_cutoff(is_noise, 1.0 / (dt * len(x)), high, WIDER)
