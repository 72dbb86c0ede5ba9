"""A joint whose torque is some samples late, or early, beside its motion.

The torque column of one joint, or of all, is moved against the unpruned model of the whole robot,
whose parameters are common to all joints; where a column is as it should be, it fits best unmoved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.structure import Structure
from identifiability.workflows.oddities.evidence import Evidence

#: Longest delay that is looked for [s], and how many on each side.
LONGEST, SIDES = 0.3, 40

#: Samples of a log that are looked at, and of which the regressor is made at a time.
ENOUGH, CHUNK = 1000, 256

#: The sum of squared errors must fall below this share of that of the columns where they are.
FAR = 0.5

#: Relative error of the log, unmoved, below which nothing is looked for; and the largest that may
#: be left of it, moved: a fit that explains little says nothing on time.
SMALL, LEFT = 0.03, 0.5


def find_late(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on torque that is late or early, or none."""
    said = []
    for samples in evidence.samples:
        found = measure_delay(evidence, samples)
        if found is not None and found.certain:
            which = "all joints" if found.joint < 0 else evidence.joints[found.joint]
            said.append(
                f"in {samples.name} the torque of {which} is {abs(found.delay)} samples "
                f"({abs(found.delay) * found.step:.3g} s) {'late' if found.delay > 0 else 'early'}"
            )
    if not said:
        return ()
    return (
        f"Torque and motion seem to be apart in time: {', '.join(said[:3])}; moved back, they "
        "agree far better. Check how the columns were put together, and shift them.",
    )


@frozen
class Delay:
    """How the torque of a log fits its motion best.

    Attributes
    ----------
    joint : int
        Whose torque is moved; -1 for all.
    delay : int [samples]
        By which it is late.
    step : float [s]
    error, moved : float
        Relative errors of the model where the columns are, and moved.
    """

    joint: int
    delay: int
    step: float
    error: float
    moved: float

    @property
    def certain(self) -> bool:
        """Whether there is no other way to see it."""
        far = self.moved < min(FAR**0.5 * self.error, LEFT)
        return self.delay != 0 and far and self.error > SMALL


def measure_delay(evidence: Evidence, prepared: Prepared) -> Delay | None:
    """Return the delay that explains most, or None where a log is too short to show any."""
    samples = _consecutive(prepared)
    if samples is None or len(samples.tau) < 200:
        return None
    kept = samples.motion.kept
    dt = float(np.median(np.diff(samples.motion.t) / np.diff(kept)))
    stride = max(1, round(LONGEST / dt / SIDES))
    reach = SIDES * stride
    whole = np.flatnonzero(_gapless(kept, reach))
    rows = whole[:: max(1, len(whole) // ENOUGH)]
    structure = evidence.structure
    if len(rows) * samples.tau.shape[1] < 3 * len(structure.base.kept) or len(rows) < 100:
        return None
    fit = _Fit(structure, samples, rows)
    n = samples.tau.shape[1]
    now = fit.errors(range(n), np.zeros(1, int))[0]
    coarse = stride * np.arange(-SIDES, SIDES + 1)
    best, at, who = now, 0, -1
    for joint in (-1, *range(n)):
        moved = range(n) if joint < 0 else (joint,)
        left = fit.errors(moved, coarse)
        k = int(coarse[np.argmin(left)])
        if stride > 1 and left.min() < FAR * now:
            near = np.arange(max(k - stride, -reach), min(k + stride, reach) + 1)
            left = fit.errors(moved, near)
            k = int(near[np.argmin(left)])
        if left.min() < best and abs(k) < reach:
            best, at, who = float(left.min()), k, joint
    return Delay(who, at, dt, float(now / fit.size) ** 0.5, float(best / fit.size) ** 0.5)


class _Fit:
    """The unpruned model with an offset a joint, fitted to torque columns that are moved.

    Parameters
    ----------
    structure : Structure
    samples : Samples
    rows : (m,) int
        Samples that are fitted to.
    """

    def __init__(self, structure: Structure, samples: Samples, rows: np.ndarray) -> None:
        tau, n = samples.tau, samples.tau.shape[1]
        spread = tau.std(0)
        self._tau = tau / np.where(spread > 0, spread, 1.0)
        self._rows = rows
        self._columns, self._A = _own_columns(structure, samples, rows, spread)
        p = len(structure.base.kept) + n
        gram = np.zeros((p, p))
        for columns, A in zip(self._columns, self._A, strict=True):
            gram[np.ix_(columns, columns)] += A.T @ A
        length = np.sqrt(np.diag(gram))
        unit = np.divide(1.0, length, out=np.zeros(p), where=length > 0)
        square, V = np.linalg.eigh(unit[:, None] * gram * unit)
        kept = square > 1e-9 * square[-1]
        self._turn = unit[:, None] * V[:, kept] / np.sqrt(square[kept])
        here = self._tau[rows]
        self.size = float(((here - here.mean(0)) ** 2).sum())
        self._parts = np.concatenate([self._fitted(a, here[:, [a]]) for a in range(n)])
        self._squares = (here**2).sum(0)

    def _fitted(self, a: int, T: Array) -> Array:
        """Return the parts (s, u) of torques (m, s) at a joint that directions of the fit take."""
        part: Array = (T.T @ self._A[a]) @ self._turn[self._columns[a]]
        return part

    def errors(self, moved: Sequence[int], shifts: np.ndarray) -> Array:
        """Return the sums of squared errors, (k,), with columns taken so many samples later."""
        others = [b for b in range(self._tau.shape[1]) if b not in moved]
        fitted = np.repeat(self._parts[others].sum(0)[None], len(shifts), 0)
        square = np.full(len(shifts), self._squares[others].sum())
        for a in moved:
            T = self._tau[self._rows[:, None] + shifts, a]
            fitted += self._fitted(a, T)
            square += (T**2).sum(0)
        left: Array = np.maximum(square - (fitted**2).sum(1), 0.0)
        return left


def _own_columns(
    structure: Structure, samples: Samples, rows: np.ndarray, spread: Array
) -> tuple[list[np.ndarray], list[Array]]:
    """Return the columns that each joint can see, its offset last, and their rows (m, v).

    Of a robot with many joints all columns would fill the memory with zeros.
    """
    n, p = samples.tau.shape[1], len(structure.base.kept)
    parts = []
    for at in range(0, len(rows), CHUNK):
        motion = samples.motion[rows[at : at + CHUNK]]
        W = structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept]
        seen = [np.flatnonzero(W[:, a].any(0)) for a in range(n)]
        parts.append([(columns, W[:, a][:, columns]) for a, columns in enumerate(seen)])
    known = [reduce(np.union1d, (part[a][0] for part in parts)) for a in range(n)]
    out = []
    for a, columns in enumerate(known):
        A = np.zeros((len(rows), len(columns) + 1))
        for at, part in zip(range(0, len(rows), CHUNK), parts, strict=True):
            own, W = part[a]
            A[at : at + len(W), np.searchsorted(columns, own)] = W
        A[:, :-1] /= spread[a] if spread[a] > 0 else np.inf
        A[:, -1] = 1.0
        out.append(A)
    return [np.append(columns, p + a) for a, columns in enumerate(known)], out


def _consecutive(prepared: Prepared) -> Samples | None:
    """Return samples that follow each other, undecimated."""
    if isinstance(prepared, Samples):
        return replace(prepared, decimation=None, instrument=None)
    middle = prepared.stretches[len(prepared.stretches) // 2]
    return next((replace(p, decimation=None) for p in middle.parts() if len(p.tau)), None)


def _gapless(kept: np.ndarray, reach: int) -> np.ndarray:
    """Return at which samples all within reach follow each other, (N,) bool."""
    at = np.arange(len(kept))
    inside = (at >= reach) & (at < len(kept) - reach)
    low, high = np.clip(at - reach, 0, None), np.clip(at + reach, None, len(kept) - 1)
    whole: np.ndarray = inside & (kept[high] - kept[low] == high - low)
    return whole
