"""Repetitions of a motion, in its own log and in others, on one clock.

A motion that was made again has the noise of its own measurement: what is the same in both is the
motion. Clocks are aligned by the lag at which positions agree, to a fraction of a sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy
from scipy.fft import next_fast_len

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare.samples import Samples
from identifiability.robot import Motion

#: Positions of a repetition differ by no more than this share of how much they vary (rms), and
#: noise; while its lag is looked for, they may differ by `FAR`.
NEAR, FAR = 0.05, 0.2

#: A repetition overlaps with at least this share of the motion.
OVERLAP = 0.05

#: Samples of a log in which repetitions are looked for, of how many other logs, and how many of
#: them are used.
ENOUGH, LOGS, MOST = 16_384, 8, 24

#: Share of the samples at which there must be a repetition; along the others the motion itself
#: stands for it.
COVERED = 0.9

#: Order of the differences that leave noise alone, and the correlation from which on two records
#: are said to share it: rounding is the same where an encoder passes the same places.
ORDER, SHARES = 8, 0.3

#: Noise may have so many times the power that differences see.
LOUDER = 1.5

#: Lags are told apart where the squared difference rises to so many times `FAR` squared.
WIDER = 4.0

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
    step = signals.sampling_step(own.t)
    moves = ~signals.never_moves(own.actuated_q.min(0), own.actuated_q.max(0))
    if not moves.any():
        return None
    start, near = _on_grid(own.t, own.actuated_q[:, moves], step)
    total = np.zeros((3, *own.actuated_q.shape))
    count = np.zeros(len(own.t))
    for other in (samples, *others[:LOGS]):
        begin, far = _on_grid(other.motion.t, other.motion.actuated_q[:, moves], step)
        curves = _curves(other.motion)
        used = [0.0] if other is samples else []
        for lag in _find_lags(near, far)[:MOST]:
            later = _improve(own, other.motion, begin - start + lag * step)
            if any(abs(later - known) < ORDER * step for known in used):
                continue
            used.append(later)
            record, good = _follow(own.t + later, curves)
            x, y = own.actuated_q[good][:, moves], record[0, good][:, moves]
            if good.sum() < OVERLAP * len(good) or not agrees(x, y) or shares_noise(x, y):
                continue
            total[:, good] += record[:, good]
            count += good
    there = count > 0
    if there.mean() < COVERED:
        return None
    measured = np.stack([own.actuated_q, own.actuated_v, own.actuated_a])
    mean = total / np.maximum(count, 1)[:, None]
    q, dq, ddq = np.where(there[:, None], mean, measured)
    return Repetition((q, dq, ddq), float(count.mean()))


def find_lag(own: Motion, other: Motion, covered: float = COVERED) -> float | None:
    """Return how much later another log makes the motion of `own` [s]; None where it does not.

    Parameters
    ----------
    own, other : Motion
    covered : float
        Share of the samples of `own` at which the other must be where it was.
    """
    step = signals.sampling_step(own.t)
    moves = ~signals.never_moves(own.actuated_q.min(0), own.actuated_q.max(0))
    if not moves.any():
        return None
    start, near = _on_grid(own.t, own.actuated_q[:, moves], step)
    begin, far = _on_grid(other.t, other.actuated_q[:, moves], step)
    curves = _curves(other)
    for lag in _find_lags(near, far)[:MOST]:
        later = _improve(own, other, begin - start + lag * step)
        record, good = _follow(own.t + later, curves)
        if good.mean() >= covered and agrees(own.actuated_q[good], record[0, good]):
            return later
    return None


def agrees(x: Array, y: Array, share: float = NEAR) -> bool:
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
    return bool(np.any(np.abs((a * b).sum(0)) > SHARES * size))


def align(own: Array, speed: Array, other: Array) -> float:
    """Return how much later `other` is than `own` [s], to first order: both (K, n)."""
    weight = 1.0 / np.maximum(own.var(0), 1e-300)
    return float((weight * speed * (own - other)).sum() / (weight * speed**2).sum().clip(1e-300))


def _on_grid(t: Array, q: Array, step: float) -> tuple[float, Array]:
    """Return the first time, and positions at even steps from there on; rests are bridged."""
    at = np.arange(t[0], t[-1] + 0.5 * step, step)
    return float(t[0]), np.stack([np.interp(at, t, x) for x in q.T], 1)


def _find_lags(near: Array, far: Array) -> list[int]:
    """Return the lags at which ``near[i]`` agrees with ``far[i + lag]`` [samples].

    Long overlaps come first. The squared difference at all lags follows from correlations.
    """
    stride = -(-max(len(near), len(far)) // ENOUGH)
    a, b = near[::stride], far[::stride]
    a, b = a - a.mean(0), b - a.mean(0)
    lags = np.arange(-len(a) + 1, len(b))
    start, stop = np.maximum(0, -lags), np.minimum(len(a), len(b) - lags)
    size = next_fast_len(len(a) + len(b))
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
    edges = np.flatnonzero(np.diff(np.concatenate([[0], share < WIDER * FAR**2, [0]])))
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


def _curves(there: Motion) -> list[tuple[float, float, scipy.interpolate.CubicSpline]]:
    """Return first and last time of each stretch of a motion without a gap, and the motion."""
    known = np.stack([there.actuated_q, there.actuated_v, there.actuated_a], 1)
    ends = [0, *(np.flatnonzero(np.diff(there.kept) > 1) + 1).tolist(), len(there.t)]
    return [
        (there.t[a], there.t[b - 1], scipy.interpolate.CubicSpline(there.t[a:b], known[a:b]))
        for a, b in pairwise(ends)
        if b - a > ORDER
    ]


def _follow(
    t: Array, curves: list[tuple[float, float, scipy.interpolate.CubicSpline]]
) -> tuple[Array, np.ndarray]:
    """Return a motion at other times (3, K, n), and at which of them it is known, (K,) bool."""
    n = curves[0][2].c.shape[-1] if curves else 0
    out, good = np.zeros((len(t), 3, n)), np.zeros(len(t), bool)
    for first, last, curve in curves:
        inside = (t >= first) & (t <= last)
        out[inside] = curve(t[inside])
        good |= inside
    return out.transpose(1, 0, 2), good
