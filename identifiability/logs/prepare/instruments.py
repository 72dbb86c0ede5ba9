"""A second record of a log's motion, with errors of its own.

Noise in the motion biases least squares. Instruments are the same columns along a second record of
the motion, the first that exists of: a Fourier series that explains all that was measured of it but
its noise; repetitions of it, in its own log or in others; the smoothed motion, where velocity and
acceleration were measured with noise of their own; the motion that was commanded. Positions
alone that are none of these have none. No simulator and no data sheet is asked: noise is what
remains of differences of high order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import scipy

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import joint_log
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import lowest_cutoff, noise_level, resolution
from identifiability.robot import Motion, Robot, complete_motion

#: Position, velocity and acceleration of the actuated joints at all N rows of a log, each (N, n),
#: and which record it is.
SecondRecord: TypeAlias = "tuple[Sequence[Array] | Array, str]"

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

#: The cut-off of the smoothed motion is found within this factor.
WIDER: Tolerance = 1.1

#: Samples of a log in which repetitions are looked for, of how many other logs, and how many of
#: them are used; and samples in which its period is looked for.
ENOUGH_SHIFTED, LOGS, MOST, ENOUGH = 16_384, 8, 24, 4096

#: Order of the differences that leave noise alone.
ORDER = 8

#: Rounds in which a lag is improved, on so many samples.
ROUNDS, FEW = 4, 4096


def add_instrument(
    robot: Robot,
    log: Log,
    samples: Dataset,
    others: Sequence[Dataset] = (),
    *,
    always: bool = False,
) -> Dataset | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Dataset
    others : sequence of Dataset
        Other logs, which may have the same motion.
    always : bool
        Also where noise is negligible, and so is what it does to least squares.
    """
    found = _find_record(joint_log(robot, log), samples, others, always=always)
    if found is None:
        return None
    record, note = found
    motion = complete_along(robot, samples.motion, record)
    if motion is None:
        return None
    # Both have one sign: what is left of an expected sign depends on neither.
    motion = replace(motion, smooth_v=samples.motion.smooth_v)
    return replace(samples, instrument=motion, notes=(*samples.notes, note))


def _find_record(
    log: Log, samples: Dataset, others: Sequence[Dataset], *, always: bool
) -> SecondRecord | None:
    """Return a second record of the motion of a log on the joint side; None where there is none."""
    if log.rollout is not None:
        motion = _derive(log.rollout, log, samples.cutoff)
        return motion, "the instruments' motion is that of the robot rolled out from commands"
    channels = [x for x in (log.q, log.dq, log.ddq) if x is not None]
    # While a coarse encoder stands still, its noise does so too: differences do not see it.
    noise = [np.maximum(noise_level(x, log.t), resolution(x) / np.sqrt(12)) for x in channels]
    if len(channels) == 3 and all(map(_negligible, noise, channels)) and not always:
        return None
    found = None
    if samples.cutoff is not None or len(channels) == 3:
        found = _fit_series(log, channels, noise)
    found = found or _find_repetitions(log, samples, others)
    if found is None and samples.cutoff is None and len(channels) == 3:
        found = _smooth(log, channels, noise)
    return found or _follow_command(log, samples.cutoff)


def _negligible(noise: Array, x: Array) -> bool:
    return bool(np.all(noise <= RULES.noise_negligible * x.std(0)))


def complete_along(robot: Robot, measured: Motion, other: Sequence[Array] | Array) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    Where a loop stays open the measured motion stands for it.

    Parameters
    ----------
    robot : Robot
    measured : Motion
    other : sequence of (N, n)
        Position, velocity and acceleration of the actuated joints at all N rows of the log.
    """
    try:
        q, dq, ddq = (x[measured.kept] for x in other)
        found = complete_motion(robot, measured.t, q, dq, ddq, measured.touch)
    except ClosureError:
        return None
    if len(found) < (1.0 - RULES.loops_open) * len(measured):
        return None
    same = ("t", "kept", "smooth_v")
    mixed: dict[str, Any] = {k: x.copy() for k, x in measured.each.items() if k not in same}
    for name, values in mixed.items():
        values[found.kept] = getattr(found, name)
    return replace(measured, **mixed)


# Repetitions of a motion, in its own log and in others, on one clock.
#
# A motion that was made again has the noise of its own measurement: what is the same in both is
# the motion. Clocks are aligned by the lag at which positions agree, to a fraction of a sample.


def _find_repetitions(log: Log, samples: Dataset, others: Sequence[Dataset]) -> SecondRecord | None:
    """Return the mean of the repetitions of a motion; None where there are too few."""
    own, dt = samples.motion, signals.sampling_step(log.t)
    total, count = np.zeros((3, *own.actuated_q.shape)), np.zeros(len(own))
    for other in (samples, *others[:LOGS]):
        for later, record, good in _find_again(own, other.motion):
            itself = other is samples and abs(later) < ORDER * dt
            if not itself and not shares_noise(own.actuated_q[good], record[0, good]):
                total[:, good] += record[:, good]
                count += good
    if np.mean(count > 0) < RULES.nearly_all:
        return None
    measured, full = (own.actuated_q, own.actuated_v, own.actuated_a), np.zeros((3, *log.q.shape))
    mean = total / np.maximum(count, 1)[:, None]
    full[:, own.kept] = np.where(count[:, None] > 0, mean, measured)
    note = (
        f"the instruments' motion is the mean of its repetitions, on average of {count.mean():.3g}"
    )
    return full, note


def find_lag(own: Motion, other: Motion) -> float | None:
    """Return how much later another log makes the motion of `own` [s]; None where it does not.

    Parameters
    ----------
    own, other : Motion
        The other must be where nearly all samples of `own` were.
    """
    found = _find_again(own, other)
    return next((later for later, _, at in found if at.mean() >= RULES.nearly_all), None)


def _find_again(own: Motion, other: Motion) -> Iterator[tuple[float, Array, np.ndarray]]:
    """Yield how much later another log makes a motion [s], its motion then, and where it does.

    The motion is (3, K, n) at the K samples of `own`, known at some of them, (K,) bool.
    """
    moves, there = (
        ~signals.never_moves(x.actuated_q.min(0), x.actuated_q.max(0)) for x in (own, other)
    )
    if not moves.any() or (there & ~moves).any():
        return
    step = signals.sampling_step(own.t)
    start, near = _on_grid(own.t, own.actuated_q[:, moves], step)
    begin, far = _on_grid(other.t, other.actuated_q[:, moves], step)
    curves: list[Curve] = []
    for lag in _find_lags(near, far)[:MOST]:
        later = _improve(own, other, begin - start + lag * step)
        curves = curves or _curves(other)  # most motions are not repeated
        record, good = _follow(own.t + later, curves)
        if good.sum() >= OVERLAP * len(good) and agrees(
            own.actuated_q[good][:, moves], record[0, good][:, moves], RULES.again_near
        ):
            yield later, record, good


def agrees(x: Array, y: Array, share: float) -> bool:
    """Return whether positions (K, n) differ by little beside how much they vary, and noise."""
    allowed = (share * x.std(0)) ** 2 + LOUDER * (noise_level(x) ** 2 + noise_level(y) ** 2)
    return bool(np.all(np.mean((x - y) ** 2, axis=0) <= allowed))


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
    apart = apart - LOUDER * (noise_level(near) ** 2 + noise_level(far) ** 2)
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


# A Fourier series of all that was measured, the smoothed motion, and the commanded one.


def _fit_series(log: Log, channels: Sequence[Array], noise: Sequence[Array]) -> SecondRecord | None:
    """Return the series that explains all channels up to their noise; None if none does."""
    t = log.t - log.t[0]
    step = -(-len(t) // ENOUGH)
    shares = [
        float(np.mean(level / np.maximum(x.std(0), 1e-300)))
        for x, level in zip(channels, noise, strict=True)
    ]
    clearest = channels[int(np.argmin(shares))][::step]
    # Harmonics that are tried.
    for harmonics in (5, 10, 20, 40):
        if 2 * RULES.series_samples * harmonics > len(t):
            break
        period = fourier.find_period(t[::step], clearest, harmonics)
        if RULES.series_samples * harmonics * signals.sampling_step(t) > period:
            continue
        fit = fourier.fit_fourier(t, channels[0], period, harmonics, *channels[1:], noise=noise)
        motion = fit.motion(t)
        pairs = zip(channels, motion, noise, strict=False)
        if not all(_explained(x - y, x, level) for x, y, level in pairs):
            continue
        note = (
            "the instruments' motion is a Fourier series of all that was measured of it, of "
            f"{harmonics} harmonics with period {period:.6g} s"
        )
        return motion, note
    return None


def _explained(rest: Array, x: Array, noise: Array) -> bool:
    """Return whether what is left of signals is no more than their noise."""
    allowed = RULES.noise_explained * noise + NEARLY * x.std(0)
    return bool(np.all(np.sqrt(np.mean(rest**2, axis=0)) <= allowed))


def _smooth(log: Log, channels: Sequence[Array], noise: Sequence[Array]) -> SecondRecord | None:
    """Return the low-passed motion; None where its band would hold much of the noise too."""
    if signals.has_gap(log.t).any():  # a filter does not reach across
        return None
    dt, smooth = signals.sampling_step(log.t), list(channels)
    for k, (x, level) in enumerate(zip(channels, noise, strict=True)):
        if not _negligible(level, x):
            cutoff = _smoothest(x, level, dt, 2.0 * SHARED / dt)
            if cutoff * dt > SHARED:
                return None
            smooth[k] = signals.lowpass(x, dt, cutoff)
    return smooth, "the instruments' motion is the measured one smoothed"


def _smoothest(x: Array, noise: Array, dt: float, highest: float) -> float:
    """Return the lowest cut-off up to some [Hz] that takes no more than noise from signals."""

    def is_noise(cutoff: float) -> bool:
        share = np.sqrt(max(1.0 - 2.0 * cutoff * dt, 0.0))
        return _explained(x - signals.lowpass(x, dt, cutoff), x, share * noise)

    return lowest_cutoff(is_noise, 1.0 / (dt * len(x)), highest, WIDER)


def _follow_command(log: Log, cutoff: float | None) -> SecondRecord | None:
    """Return the commanded motion, delayed as the robot follows; None where it is of no use.

    A command that the robot does not follow, or that shares noise with the measured positions, is
    of no use, nor is one with gaps.
    """
    if log.q_ref is None or cutoff is None or signals.has_gap(log.t).any():
        return None
    q, dq, ddq = _derive(log.q_ref, log, cutoff)
    later = 0.0
    for _ in range(ROUNDS):
        later += align(_delay(log.t, q, later), _delay(log.t, dq, later), log.q)
    motion = [_delay(log.t, x, later) for x in (q, dq, ddq)]
    # An instrument differs from the motion by no more of how much it varies (rms), and comes no
    # earlier or later than this [s].
    if abs(later) > 0.2 or not agrees(log.q, motion[0], 0.3) or shares_noise(log.q, log.q_ref):
        return None
    note = (
        f"the instruments' motion is the commanded one, "
        f"{'delayed' if later >= 0 else 'advanced'} by {1e3 * abs(later):.3g} ms"
    )
    return motion, note


def _derive(q: Array, log: Log, cutoff: float | None) -> tuple[Array, Array, Array]:
    """Return positions, low-passed and differentiated as those of a log."""
    dt = signals.sampling_step(log.t)
    q = q if cutoff is None else signals.lowpass(q, dt, cutoff)
    dq = signals.differentiate(q, dt)
    return q, dq, signals.differentiate(dq, dt)


def _delay(t: Array, x: Array, later: float) -> Array:
    """Return signals x (N, n) as they were so much earlier [s]."""
    return np.stack([np.interp(t - later, t, column) for column in x.T], 1)


# The noise of a motion once more.


def noise_again(log: Log, rng: np.random.Generator) -> Log:
    """Return a log with as much noise once more on positions, and on velocities if measured."""
    dq = None if log.dq is None else log.dq + _white_as(log.dq, log.t, rng)
    return replace(log, q=log.q + _white_as(log.q, log.t, rng), dq=dq)


def _white_as(x: Array, t: Array, rng: np.random.Generator) -> Array:
    """Return white noise of the size of that in signals (N, n)."""
    level = np.maximum(noise_level(x, t), resolution(x) / np.sqrt(12))
    return np.asarray(level * rng.standard_normal(x.shape))
