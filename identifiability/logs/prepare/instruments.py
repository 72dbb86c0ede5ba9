"""Samples with instruments: a second record of their motion, with errors of its own.

The motion that was commanded, or repetitions of it in its own log and in others, on one clock;
along it the robot's loops close again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import scipy

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare.plan import (
    Smoothing,
    joint_log,
    lowest_cutoff,
    noise_level,
    resolution,
)
from identifiability.logs.prepare.preparation import SHORT
from identifiability.logs.prepare.samples import Record, Samples
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import bandwidth_of_windows
from identifiability.robot import Motion, Robot, complete_motion

# Another motion of the actuated joints at the samples of a measured one, with all loops closed.


#: Passive joints of two records are far apart at a sample if they are so many times as far as
#: usual: noise makes them so where it brings a mechanism near a singular configuration.
THROWN: Tolerance = 30.0

#: While the lag of a repetition is looked for, positions may differ by this share of how much
#: they vary (rms).
FAR: Tolerance = 0.2

#: A repetition overlaps with at least this share of the motion.
OVERLAP: Tolerance = 0.05

#: Noise may have so many times the power that differences see.
LOUDER: Tolerance = 1.5

#: A smoothed motion may reach up to this share of the sampling rate: it shares the noise of its
#: band.
SHARED: Tolerance = 0.15


def complete_along(
    robot: Robot, measured: Motion, other: Sequence[Array], instead: Motion | None = None
) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    Parameters
    ----------
    robot : Robot
    measured : Motion
    other : sequence of (N, n)
        Position, velocity and acceleration of the actuated joints at all N rows of the log.
    instead : Motion, optional
        What stands for it where a loop stays open; by default the measured motion.
    """
    try:
        q, dq, ddq = (x[measured.kept] for x in other)
        found = complete_motion(robot, measured.t, q, dq, ddq, measured.touch)
    except ClosureError:
        return None
    if len(found) < (1.0 - RULES.loops_open) * len(measured):
        return None
    if len(found) == len(measured):
        return replace(found, kept=measured.kept, start=measured.start)
    return put(measured if instead is None else instead, found.kept, found)


def put(motion: Motion, rows: np.ndarray, other: Motion) -> Motion:
    """Return a motion with another one at some samples."""
    same = ("t", "kept", "smooth_v")
    mixed: dict[str, Any] = {k: x.copy() for k, x in motion.each.items() if k not in same}
    for name, values in mixed.items():
        values[rows] = getattr(other, name)
    return replace(motion, **mixed)


# Repetitions of a motion, in its own log and in others, on one clock.
#
# A motion that was made again has the noise of its own measurement: what is the same in both is
# the motion. Clocks are aligned by the lag at which positions agree, to a fraction of a sample.


#: Samples of a log in which repetitions are looked for, of how many other logs, and how many of
#: them are used.
ENOUGH_SHIFTED, LOGS, MOST = 16_384, 8, 24

#: Order of the differences that leave noise alone.
ORDER = 8


#: Rounds in which a lag is improved, on so many samples.
ROUNDS, FEW = 4, 4096


@frozen
class Repetition:
    """The mean of all repetitions of a motion, at its samples.

    Attributes
    ----------
    motion : tuple of (K, n)
        Position, velocity and acceleration at the K samples of a motion.
    count : float
        How many there are, in the mean over the samples.
    """

    motion: tuple[Array, Array, Array]
    count: float


def find_repetition(samples: Samples, others: Sequence[Samples] = ()) -> Repetition | None:
    """Return the mean of the repetitions of a motion; None where there are too few.

    Parameters
    ----------
    samples : Samples
    others : sequence of Samples
        Other logs in which the same motion may have been made.
    """
    own = samples.motion
    step, moves, start, near = _moving(own)
    if not moves.any():
        return None
    total = np.zeros((3, *own.actuated_q.shape))
    count = np.zeros(len(own.t))
    for other in (samples, *others[:LOGS]):
        begin, far = _on_grid(other.motion.t, other.motion.actuated_q[:, moves], step)
        curves: list[Curve] = []
        used = [0.0] if other is samples else []
        for lag in _find_lags(near, far)[:MOST]:
            later = _improve(own, other.motion, begin - start + lag * step)
            if any(abs(later - known) < ORDER * step for known in used):
                continue
            used.append(later)
            curves = curves or _curves(other.motion)  # most motions are not repeated
            record, good = _follow(own.t + later, curves)
            x, y = own.actuated_q[good][:, moves], record[0, good][:, moves]
            if (
                good.sum() < OVERLAP * len(good)
                or not agrees(x, y, RULES.again_near)
                or shares_noise(x, y)
            ):
                continue
            total[:, good] += record[:, good]
            count += good
    there = count > 0
    if there.mean() < RULES.nearly_all:
        return None
    measured = np.stack([own.actuated_q, own.actuated_v, own.actuated_a])
    mean = total / np.maximum(count, 1)[:, None]
    q, dq, ddq = np.where(there[:, None], mean, measured)
    return Repetition((q, dq, ddq), float(count.mean()))


def find_lag(own: Motion, other: Motion) -> float | None:
    """Return how much later another log makes the motion of `own` [s]; None where it does not.

    Parameters
    ----------
    own, other : Motion
        The other must be where nearly all samples of `own` were.
    """
    step, moves, start, near = _moving(own)
    if not moves.any():
        return None
    begin, far = _on_grid(other.t, other.actuated_q[:, moves], step)
    curves = _curves(other)
    for lag in _find_lags(near, far)[:MOST]:
        later = _improve(own, other, begin - start + lag * step)
        record, good = _follow(own.t + later, curves)
        if good.mean() >= RULES.nearly_all and agrees(
            own.actuated_q[good], record[0, good], RULES.again_near
        ):
            return later
    return None


def agrees(x: Array, y: Array, share: float) -> bool:
    """Return whether positions (K, n) differ by little beside how much they vary, and noise."""
    allowed = (share * x.std(0)) ** 2 + LOUDER * (_noise(x) + _noise(y))
    return bool(np.all(np.mean((x - y) ** 2, axis=0) <= allowed))


#: Sum of the squared coefficients of a difference of that order.
_SQUARES = float((np.diff(np.eye(2 * ORDER + 1), ORDER, axis=0)[0] ** 2).sum())


def _noise(x: Array) -> Array:
    """Return the variance of white noise on positions (K, n), (n,)."""
    found: Array = (np.diff(x, ORDER, axis=0) ** 2).mean(0) / _SQUARES
    return found


def shares_noise(x: Array, y: Array) -> bool:
    """Return whether the noise of positions (K, n) and (K, n) is in part the same."""
    a, b = (np.diff(one, ORDER, axis=0) for one in (x, y))
    size = np.sqrt((a**2).sum(0) * (b**2).sum(0))
    # Correlation from which on two records share their noise, as rounding at the same places.
    return bool(np.any(np.abs((a * b).sum(0)) > 0.3 * size))


def align(own: Array, speed: Array, other: Array) -> float:
    """Return how much later `other` is than `own` [s], to first order: both (K, n)."""
    weight = 1.0 / np.maximum(own.var(0), 1e-300)
    return float((weight * speed * (own - other)).sum() / (weight * speed**2).sum().clip(1e-300))


def _moving(own: Motion) -> tuple[float, np.ndarray, float, Array]:
    """Return the step [s], which joints move, and their positions on a grid from a start on."""
    step = signals.sampling_step(own.t)
    moves = ~signals.never_moves(own.actuated_q.min(0), own.actuated_q.max(0))
    return step, moves, *_on_grid(own.t, own.actuated_q[:, moves], step)


def _on_grid(t: Array, q: Array, step: float) -> tuple[float, Array]:
    """Return the first time, and positions at even steps from there on; rests are bridged."""
    at = np.arange(t[0], t[-1] + 0.5 * step, step)
    even = [np.interp(at, t, x) for x in q.T]
    return float(t[0]), np.reshape(even, (len(even), len(at))).T


def _find_lags(near: Array, far: Array) -> list[int]:
    """Return the lags at which ``near[i]`` agrees with ``far[i + lag]`` [samples].

    Long overlaps come first. The squared difference at all lags follows from correlations.
    """
    stride = -(-max(len(near), len(far)) // ENOUGH_SHIFTED)
    a, b = near[::stride], far[::stride]
    a, b = a - a.mean(0), b - a.mean(0)
    lags = np.arange(-len(a) + 1, len(b))
    start, stop = np.maximum(0, -lags), np.minimum(len(a), len(b) - lags)
    size = 1 << (len(a) + len(b)).bit_length()  # zeros beyond both cost less than scipy.fft
    product = np.conj(np.fft.rfft(a, size, axis=0)) * np.fft.rfft(b, size, axis=0)
    cross = np.fft.irfft(product, size, axis=0)[lags]
    count = np.maximum(stop - start, 1)[:, None]

    def sums(x: Array, shift: int | Array, power: int) -> Array:
        total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x**power, axis=0)])
        found: Array = (total[stop + shift] - total[start + shift]) / count
        return found

    varies = sums(a, 0, 2) - sums(a, 0, 1) ** 2
    apart = sums(a, 0, 2) + sums(b, lags, 2) - 2 * cross / count
    apart = apart - LOUDER * (_noise(near) + _noise(far))
    share = (apart / np.maximum(varies, 1e-9 * a.var(0))).max(1)
    share[count[:, 0] < OVERLAP * len(a)] = np.inf
    # Lags are told apart where the squared difference rises to so many times `again_far`
    # squared.
    edges = np.flatnonzero(np.diff(np.concatenate([[0], share < 4.0 * FAR**2, [0]])))
    found = []
    for first, last in edges.reshape(-1, 2).tolist():
        best = first + int(np.argmin(share[first:last]))
        if share[best] < FAR**2:
            found.append((-int(count[best, 0]), int(lags[best]) * stride))
    return [lag for _, lag in sorted(found)]


def _improve(own: Motion, there: Motion, later: float) -> float:
    """Return a lag [s] improved until positions agree best."""
    own = own[slice(None, None, -(-len(own) // FEW))]
    for _ in range(ROUNDS):
        at = own.t + later
        good = (at >= there.t[0]) & (at <= there.t[-1])
        if good.sum() < ORDER:
            break
        record = np.stack([np.interp(at[good], there.t, x) for x in there.actuated_q.T], 1)
        later += align(own.actuated_q[good], own.actuated_v[good], record)
    return later


Curve: TypeAlias = "tuple[float, float, scipy.interpolate.CubicSpline]"


def _curves(there: Motion) -> list[Curve]:
    """Return first and last time of each stretch of a motion without a gap, and the motion."""
    known = np.stack([there.actuated_q, there.actuated_v, there.actuated_a], 1)
    ends = [0, *(np.flatnonzero(np.diff(there.kept) > 1) + 1).tolist(), len(there.t)]
    return [
        (there.t[a], there.t[b - 1], scipy.interpolate.CubicSpline(there.t[a:b], known[a:b]))
        for a, b in pairwise(ends)
        if b - a > ORDER
    ]


def _follow(t: Array, curves: list[Curve]) -> tuple[Array, np.ndarray]:
    """Return a motion at other times (3, K, n), and at which of them it is known, (K,) bool."""
    n = curves[0][2].c.shape[-1] if curves else 0
    out, good = np.zeros((len(t), 3, n)), np.zeros(len(t), bool)
    for first, last, curve in curves:
        inside = (t >= first) & (t <= last)
        out[inside] = curve(t[inside])
        good |= inside
    return out.transpose(1, 0, 2), good


# The motion that was commanded: no sensor was asked, so it has none of their noise.


def follow_command(log: Log, cutoff: float | None) -> tuple[tuple[Array, Array, Array], str] | None:
    """Return the commanded motion at the times of a log, and a note; None where it is of no use.

    It goes the way of the log, low-pass and differences, and is delayed as the robot
    follows. A command that the robot does not follow, or that shares noise with the measured
    positions, is of no use, nor is one with gaps.

    Parameters
    ----------
    log : Log
        On the joint side.
    cutoff : float or None [Hz]
        Of the low-pass of the log; None chooses one for the command.
    """
    dt = signals.sampling_step(log.t)
    if log.q_ref is None or signals.has_gap(log.t).any():  # no differences across one
        return None
    if cutoff is None:
        wide = max(RULES.cutoff_wide * bandwidth_of_windows([log.q_ref], dt), RULES.cutoff_lowest)
        cutoff = min(wide, RULES.cutoff_highest / dt)
    q = signals.lowpass(log.q_ref, dt, cutoff)
    dq = signals.differentiate(q, dt)
    ddq = signals.differentiate(dq, dt)
    later = 0.0
    for _ in range(ROUNDS):
        later += align(_delay(log.t, q, later), _delay(log.t, dq, later), log.q)
    motion = _delay(log.t, q, later), _delay(log.t, dq, later), _delay(log.t, ddq, later)
    # An instrument differs from the motion by no more of how much it varies (rms).
    # An instrument comes no earlier or later than this [s].
    if abs(later) > 0.2 or not agrees(log.q, motion[0], 0.3):
        return None
    if shares_noise(log.q, log.q_ref):
        return None
    note = (
        f"the instruments' motion is the commanded one, low-passed at {cutoff:.3g} Hz and "
        f"{'delayed' if later >= 0 else 'advanced'} by {1e3 * abs(later):.3g} ms"
    )
    return motion, note


def follow_rollout(log: Log, cutoff: float | None) -> tuple[tuple[Array, Array, Array], str]:
    """Return the motion of a log's rollout, low-passed and differentiated as the log, and a note.

    Parameters
    ----------
    log : Log
        With a rollout.
    cutoff : float or None [Hz]
    """
    assert log.rollout is not None
    dt = signals.sampling_step(log.t)
    q = log.rollout if cutoff is None else signals.lowpass(log.rollout, dt, cutoff)
    dq = signals.differentiate(q, dt)
    note = "the instruments' motion is that of the robot rolled out from the commands"
    return (q, dq, signals.differentiate(dq, dt)), note


def _delay(t: Array, x: Array, later: float) -> Array:
    """Return signals x (N, n) as they were so much earlier [s]."""
    return np.stack([np.interp(t - later, t, column) for column in x.T], 1)


# A second record of a log's motion, with errors of its own: what instruments are made of.
#
# The first that exists of: the mean of some repetitions of the motion, in its own log or in
# others; a Fourier series that explains all that was measured of the motion but its noise; one
# repetition or two; the smoothed motion, where velocity and acceleration were measured with noise
# of their own; the motion that was commanded. A motion whose derivatives were computed from the
# same noisy positions, and that is none of these, has none. No simulator and no data sheet is
# asked: noise is what remains of differences of high order.


#: Samples of a log in which its period is looked for.
ENOUGH = 4096


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
    if worst < RULES.noise_negligible and len(channels) == 3 and not always:
        return None
    again, series = find_repetition(samples, others), None
    if samples.cutoff is not None or len(channels) == 3:
        series = _fit_series(log, channels, noise)
    of_series = None if series is None else _of_series(series, log, noise)
    # The mean of so many repetitions has a third of the noise's power or less, and none of
    # the log's own; of fewer, a series that explains the motion has less noise.
    if again is not None and (again.count >= 3 or of_series is None):
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
    # Harmonics that are tried.
    for harmonics in (5, 10, 20, 40):
        if 2 * RULES.series_samples * harmonics > len(t):
            break
        period = fourier.find_period(t[::step], clearest, harmonics)
        if RULES.series_samples * harmonics * signals.sampling_step(t) > period:
            continue
        fit = fourier.fit_fourier_jointly(t, channels, noise, period, harmonics)
        left = [x - y for x, y in zip(channels, fit.motion(t), strict=False)]
        pairs = zip(left, channels, noise, strict=True)
        if all(_explained(rest, x, level) for rest, x, level in pairs):
            return fit
    return None


def _explained(rest: Array, x: Array, noise: Array) -> bool:
    floor = 1e-6 * x.std(0)
    # A series explains a motion if what is left is at most so many times the noise.
    return bool(np.all(np.sqrt(np.mean(rest**2, 0)) <= 1.15 * noise + floor))


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
    if np.all(noise <= RULES.noise_negligible * x.std(0)):
        return np.inf

    def is_noise(cutoff: float) -> bool:
        return _explained(x - signals.lowpass(x, dt, cutoff), x, noise)

    high = SHARED / dt
    if not is_noise(high):
        return 2.0 * high
    # The cut-off of the smoothed motion is found within this factor.
    return lowest_cutoff(is_noise, 1.0 / (dt * len(x)), high, 1.2)


# Samples with instruments: a second record of their motion, along which the robot's loops close.
#
# Where noise throws passive joints of the measured motion far off, the record stands for it.


#: What a note says of samples at which the record stands for the measured motion.
STANDS = "there the instruments' motion stands for it"


def add_instrument(
    robot: Robot,
    log: Log,
    samples: Samples,
    others: Sequence[Samples] = (),
    *,
    always: bool = False,
    like: SecondRecord | None = None,
) -> Samples | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Samples
    others : sequence of Samples
        Other logs, which may have the same motion.
    always : bool
        Also where noise is negligible, and so is what it does to least squares.
    like : SecondRecord, optional
        Of another log of the same motion, found in the same way where that can be.
    """
    own = joint_log(robot, log)
    record = None if like is None else like.again(own)
    record = record or find_record(own, samples, others, always=always)
    return None if record is None else attach_record(robot, samples, record)


def attach_record(robot: Robot, samples: Samples, record: SecondRecord) -> Samples | None:
    """Return the samples with a second record of their motion; None if too few loops close."""
    motion = complete_along(robot, samples.motion, record.motion)
    if motion is None:
        return None
    notes = (*samples.notes, record.note)
    own = samples.motion
    if record.speed is not None and own.smooth_v is not None:
        other = record.speed[own.kept]
        less = other[:, 1:] < own.smooth_v[:, 1:]  # noise in proportion to speed turns no sign
        own = replace(own, smooth_v=np.where(less, other, own.smooth_v))
    # Both have one sign: what is left of an expected sign depends on neither.
    motion = replace(motion, smooth_v=own.smooth_v)
    samples = replace(samples, motion=own, record=record.kind)
    far = _thrown(robot, samples.motion, motion)
    if not len(far):
        return replace(samples, instrument=motion, notes=notes)
    text = (
        f"at {len(far)} of {len(motion)} samples noise throws the measured motion far off, as it "
        f"does near a singular configuration: {STANDS}"
    )
    mended = put(samples.motion, far, motion[far])
    return replace(samples, motion=mended, instrument=motion, notes=(*notes, text))


def _thrown(robot: Robot, measured: Motion, other: Motion) -> np.ndarray:
    """Return the few samples at which passive joints alone are far apart, (F,) int."""
    passive = np.isin(np.arange(robot.nv), robot.dependent)
    far = np.zeros((2, len(measured)), bool)
    for x, y in ((measured.v, other.v), (measured.a, other.a)):
        apart = np.abs(x - y)
        beyond = apart > THROWN * np.median(apart, axis=0)
        far |= beyond[:, ~passive].any(1), beyond[:, passive].any(1)
    far = far[1] & ~far[0]  # where actuated joints are far too, one of the records is wrong
    return np.flatnonzero(far) if far.mean() < RULES.loops_open else np.empty(0, int)
