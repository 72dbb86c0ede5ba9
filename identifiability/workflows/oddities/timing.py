"""What is odd about time: torque that is late, another unit, derivatives that contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
import scipy

from identifiability.foundation.linalg import RANK_TOLERANCE, ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_number
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.prepare.plan import joint_log
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Spectrum, choose_band
from identifiability.regression.structure import Structure
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check
from identifiability.workflows.oddities.rules import RULES
from identifiability.workflows.oddities.torque import measure_carried

# Torque that is late, or early, beside its motion, and positions beside their velocities.
#
# The torque column of one joint, or of all, is moved against the unpruned model of the whole
# robot, whose parameters are common to all joints; where a column is as it should be, it fits best
# unmoved. A delay of all joints by less than a sample is found by the slope of the model's torque
# (`measure_shift`), and tested against what is left from one stretch of time to the next.


#: Longest delay that is looked for [s], and how many on each side.
SIDES = 40

#: Samples of a log that are looked at, and of which the regressor is made at a time.
ENOUGH, CHUNK = 1000, 256

#: Samples of a log by which it is measured, stretches of time between which it scatters, bytes that
#: the columns may take, and columns beside the model's at each joint.
LONG = 4096
STRETCHES = 24
BYTES: Tolerance = 3e7
BESIDE = 5


@check(
    "late",
    Does.EXPLAINS,
    9,
    says="Torque and motion seem to be apart in time: …",
    means="Columns were recorded with different delays, or put together from different clocks; "
    "a millisecond at speed looks like friction or inertia.",
    do="Shift the columns by what is said, or log what was measured together. Of a base that "
    "moves, let all channels pass one filter.",
)
def find_late(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque or positions that are late or early, or none."""
    said, parts = [], []
    for recording, samples in zip(logs.recordings, logs.samples, strict=True):
        found = measure_delay(logs, samples)
        if found is None or not found.certain:
            windows = [recording.rows(a, b) for a, b in signals.spread_windows(len(recording))]
            position = measure_position(joint_log(logs.robot, windows[0]))
            shift = None if position else measure_shift(logs.structure, samples)
            for what, verb, other, own in (
                ("positions", "are", "their velocities", position),
                ("torque", "is", "the motion", shift),
            ):
                if own is None or not own.certain:
                    continue
                if own.joint < 0:
                    parts.append(f"in {samples.name} {what} {verb} {own.text} beside {other}")
                else:
                    whose = f"the {what} of {logs.joints[own.joint]}"
                    said.append(f"in {samples.name} {whose} {verb} {own.text} beside {other}")
        else:
            which = "all joints" if found.joint < 0 else logs.joints[found.joint]
            said.append(
                f"in {samples.name} the torque of {which} is {abs(found.delay)} samples "
                f"({abs(found.delay) * found.step:.3g} s) {'late' if found.delay > 0 else 'early'}"
            )
    if not said and parts:
        return (
            f"Columns seem to be apart in time by a part of a sample: {', '.join(parts[:3])}. "
            "Rows may hold what was read at different moments, or a velocity the difference to the "
            "row before: shift the columns, or log what was measured together.",
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
        far = self.moved < min(RULES.delay_left**0.5 * self.error, RULES.delay_left)
        # No delay is looked for below this error of the log, unmoved.
        return self.delay != 0 and far and self.error > 0.03


def measure_delay(logs: MeasuredLogs, prepared: Prepared) -> Delay | None:
    """Return the delay that explains most, or None where a log is too short to show any."""
    samples = _consecutive(prepared)
    if samples is None:
        return None
    kept = samples.motion.kept
    dt = float(np.median(np.diff(samples.motion.t) / np.diff(kept)))
    # Longest delay that is looked for [s], and how many on each side.
    stride = max(1, round(0.3 / dt / SIDES))
    reach = SIDES * stride
    whole = np.flatnonzero(_gapless(kept, reach))
    rows = whole[:: max(1, len(whole) // ENOUGH)]
    structure = logs.structure
    n = samples.tau.shape[1]
    # Fewest rows for each column of the model, with which a delay is looked for.
    # Fewest rows in all.
    if len(rows) < max(100, 3.0 * len(structure.base.kept) / n):
        return None
    fit = _Fit(structure, samples, rows)
    now = fit.errors(range(n), np.zeros(1, int))[0]
    coarse = stride * np.arange(-SIDES, SIDES + 1)
    best, at, who = now, 0, -1
    for joint in (-1, *range(n)):
        moved = range(n) if joint < 0 else (joint,)
        left = fit.errors(moved, coarse)
        k = int(coarse[np.argmin(left)])
        if stride > 1 and left.min() < RULES.delay_left * now:
            near = np.arange(max(k - stride, -reach), min(k + stride, reach) + 1)
            left = fit.errors(moved, near)
            k = int(near[np.argmin(left)])
        if left.min() < best and abs(k) < reach:
            best, at, who = float(left.min()), k, joint
    return Delay(who, at, dt, float(now / fit.size) ** 0.5, float(best / fit.size) ** 0.5)


@frozen
class Shift:
    """By how much columns of all joints, or of one, are late beside others.

    Attributes
    ----------
    samples, sigma : float
        By how many samples, and its standard deviation.
    step : float [s]
    joint : int
        Whose columns; -1 for all.
    among : int
        Of how many joints it is the one that stands out most.
    left : float
        Share of the squares of what is left there that the shift does not explain.
    """

    samples: float
    sigma: float
    step: float
    joint: int = -1
    among: int = 1
    left: float = 1.0

    @property
    def chance(self) -> float:
        """How often chance makes one that is as far from zero."""
        t = abs(self.samples) / self.sigma if self.sigma > 0 else np.inf
        return 2.0 * self.among * float(scipy.special.stdtr(STRETCHES - 1, -t))

    @property
    def certain(self) -> bool:
        """Whether it is no chance, and large enough to say.

        Other physics of one joint may look like a small shift, but a shift leaves nothing of it.
        """
        small = abs(self.samples) <= RULES.shift_most
        told = small if self.joint < 0 else self.left < RULES.delay_left
        # A shift is said from this size on [samples].
        sized = abs(self.samples) >= 0.25
        # Level at which a shift of a part of a sample is said.
        return told and sized and self.chance < 0.001

    @property
    def text(self) -> str:
        """How much, in words."""
        size, way = abs(self.samples), "late" if self.samples > 0 else "early"
        much = (
            f"{size:.2f} ± {1.96 * self.sigma:.2f}" if size <= RULES.shift_most else f"{size:.0f}"
        )
        return f"{much} samples ({size * self.step:.2g} s) {way}"


def measure_shift(structure: Structure, prepared: Prepared) -> Shift | None:
    """Return by how much the torque of all joints is late, or where that is not certain of one.

    None where a log is too short to tell. A small delay d adds ``−d τ'`` to the torque τ of the
    model. What friction lacks at low and high speed is fitted beside it. What a joint that stands
    supplies is no data.
    """
    samples = _consecutive(prepared)
    if samples is None:
        return None
    motion, n = samples.motion, samples.tau.shape[1]
    long = min(LONG, int(BYTES / (8 * n * max(len(structure.base.kept), 1))))
    first = max(0, (len(motion) - long) // 2)
    rows = np.arange(first, min(len(motion), first + long))
    down = (isinstance(prepared, Samples) and prepared.decimation) or signals.Decimation(2)
    ends = np.flatnonzero(np.diff(motion.kept[rows]) != 1) + 1
    runs = [r for r in np.split(rows, ends) if down.outputs(len(r)) > 0]
    outputs = sum(down.outputs(len(r)) for r in runs)
    columns = len(structure.base.kept) + BESIDE * n
    # Fewest outputs for each column and each stretch with which a part of a sample is told.
    if outputs < 2.0 * max(columns / n, STRETCHES):
        return None
    dt = float(np.median(np.diff(motion.t) / np.diff(motion.kept)))

    still = np.zeros(samples.tau.shape, bool) if samples.dwells is None else samples.dwells
    at = [slice(down.reach, len(r) - down.reach, down.factor) for r in runs]
    moves = np.concatenate([~still[r][k] for r, k in zip(runs, at, strict=True)])

    def filtered(parts: Sequence[Array]) -> Array:
        """Return columns (N, n, …) of the stretches, filtered without what is no data."""
        kept = [np.where(_beside(still[r], x), 0.0, x) for r, x in zip(runs, parts, strict=True)]
        out = np.concatenate([down.apply(x) for x in kept])
        return np.where(_beside(moves, out), out, 0.0)

    tau = filtered([samples.tau[r] for r in runs])
    spread = tau.std(0)
    weight = np.divide(1.0, spread, out=np.zeros(n), where=spread > 0)

    def each(x: Array) -> Array:
        """Return a column for every joint, (m n, n)."""
        columns: Array = np.eye(n) * (x * weight)[:, :, None]
        return columns.reshape(-1, n)

    W = [structure.model.regressor(structure.robot, motion[r])[:, :, structure.base.kept]
         for r in runs]  # fmt: skip
    model = (filtered(W) * weight[:, None]).reshape(outputs * n, -1)
    top = np.maximum(np.abs(motion.actuated_v[rows]).max(0), 1e-300)
    speeds = [motion.actuated_v[r] / top for r in runs]
    known = [model, each(filtered([np.ones((len(r), n)) for r in runs]))]
    known += [each(filtered([v * np.abs(v) for v in speeds]))]
    # Speeds at which friction may change, as shares of the largest: what a model of friction
    # lacks is told from a shift.
    known += [
        each(filtered([np.sign(v) * np.exp(-np.abs(v) / u) for v in speeds])) for u in (0.05, 0.2)
    ]
    y = (tau * weight).reshape(-1)
    beta = np.linalg.lstsq(model, y, rcond=1e-8)[0]
    slopes = each(filtered([signals.differentiate(w @ beta, dt) * dt for w in W]))
    return _test_shift(-slopes, y, np.hstack(known), dt)


def _beside(mask: np.ndarray, x: Array) -> np.ndarray:
    """Return a mask (N, n) that goes with x (N, n, …)."""
    out: np.ndarray = mask.reshape(*mask.shape, *(1,) * (x.ndim - 2))
    return out


def measure_position(log: Log) -> Shift | None:
    """Return by how much positions are late beside measured velocities; None where none are."""
    # Fewest samples of a stretch.
    if log.dq is None or len(log) < STRETCHES * 8 or signals.has_gap(log.t).any():
        return None
    dt = signals.sampling_step(log.t)
    cutoff = choose_band([Spectrum.of([log.q], dt)]).outputs
    if 2 * cutoff * dt * len(log) < STRETCHES:
        return None
    v = signals.lowpass(log.dq, dt, cutoff)
    rest = signals.differentiate(signals.lowpass(log.q, dt, cutoff), dt) - v
    size = v.std(0)
    weight = np.divide(1.0, size, out=np.zeros(len(size)), where=size > 0)
    slopes = signals.differentiate(v, dt) * dt * weight
    known = np.eye(len(size))[None].repeat(len(v), 0).reshape(-1, len(size))
    each = (np.eye(len(size)) * slopes[:, :, None]).reshape(-1, len(size))
    return _test_shift(-each, (rest * weight).reshape(-1), known, dt)


def _test_shift(slopes: Array, y: Array, known: Array, dt: float) -> Shift | None:
    """Return the shift of all joints, with what it scatters over time and over joints.

    If it is not certain that of one joint is returned, where that is.

    Parameters
    ----------
    slopes : (m n, n)
        What a shift of each joint by a sample adds.
    y : (m n,)
    known : (m n, c)
        Columns that are fitted beside them.
    dt : float [s]
    """
    size = np.linalg.norm(known, axis=0)
    Q, R = np.linalg.qr(known[:, size > 0] / size[size > 0])
    U, s, _ = np.linalg.svd(R)
    Q = Q @ U[:, s > RANK_TOLERANCE * s.max(initial=0.0)]
    d, rest = slopes - Q @ (Q.T @ slopes), y - Q @ (Q.T @ y)
    used = (d**2).sum(0) > RANK_TOLERANCE * (slopes**2).sum(0)
    d, count = d[:, used], slopes.shape[1]
    if not used.any() or not (rest**2).sum() > 0:
        return None
    each = np.linalg.pinv(d.T @ d) @ (d.T @ rest)
    # Without one stretch after the other [Künsch 1989]: few rows tell of each.
    columns = np.hstack([Q, d, y[:, None]])
    edges = np.arange(STRETCHES + 1) * (len(y) // count) // STRETCHES * count
    parts = np.stack([columns[a:b].T @ columns[a:b] for a, b in pairwise(edges)])
    without = parts.sum(0) - parts
    found = [np.linalg.lstsq(G[:-1, :-1], G[:-1, -1], rcond=1e-10)[0] for G in without]
    moved = np.array(found)[:, Q.shape[1] :]
    moved -= moved.mean(0)
    C = (STRETCHES - 1) / STRETCHES * moved.T @ moved
    # Joints that disagree by more than their own errors make the mean uncertain, too
    # [DerSimonian & Laird 1986].
    own = np.sqrt(np.maximum(np.diag(C), 1e-300))
    w = own**-2.0
    mean = w @ each / w.sum()
    apart = w @ (each - mean) ** 2 - (len(w) - 1)
    between = max(0.0, apart / max(w.sum() - (w**2).sum() / w.sum(), 1e-300)) if len(w) > 1 else 0.0
    w = 1.0 / (1.0 / w + between)
    w /= w.sum()
    sigma = np.sqrt(w @ (C + between * np.eye(len(w))) @ w)
    whole = Shift(float(w @ each), float(sigma), dt)
    k = int(np.argmax(np.abs(each) / own))
    joint = int(np.flatnonzero(used)[k])
    before, after = (float((x[joint::count] ** 2).sum()) for x in (rest, rest - d[:, k] * each[k]))
    one = Shift(float(each[k]), float(own[k]), dt, joint, len(each), after / max(before, 1e-300))
    return one if one.certain and not whole.certain else whole


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
        kept = square > ROUNDOFF * square[-1]
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


# Time in another unit: speeds and accelerations that contradict the file's limits and masses.


@check(
    "time in another unit",
    Does.MISREADS,
    4,
    says="The time may be in another unit than s: …",
    means="The robot would move far faster or slower than its file allows, or hardly be sampled.",
    do="`--time-unit ms` (or `us`, `ns`, `min`), or `[time]` in the sidecar.",
)
def find_time_scale(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on time in another unit, or none."""
    why = _by_limits(logs) or _by_inertia(logs) or _by_rate(logs)
    if not why:
        return ()
    return (f"The time may be in another unit than s: {why}. Check the column 't'.",)


def _by_limits(logs: MeasuredLogs) -> str:
    """Compare speeds with the file's limits."""
    limits = np.asarray(logs.robot.speed_limits, float)
    known = np.isfinite(limits) & (limits > 0)
    if not known.any():
        return ""
    speed = np.abs(logs.motion.actuated_v).max(0)
    if (speed[known] > RULES.speed_beyond * limits[known]).all():
        k = int(np.flatnonzero(known)[np.argmax(speed[known] / limits[known])])
        return (
            f"every joint moves faster than {RULES.speed_beyond:g} times its speed limit "
            f"({logs.joints[k]} {speed[k]:.3g}, limit {limits[k]:.3g})"
        )
    return ""


def _by_inertia(logs: MeasuredLogs) -> str:
    """Compare the factor of weight with that of inertia, by the file's masses."""
    carried = measure_carried(logs) if logs.weighs else []
    sure = [c for c in carried if c.half < RULES.factor_widest * c.factor]
    ratios = [c.moving / c.factor for c in sure if c.moving_half < RULES.factor_widest * c.moving]
    if not ratios:
        return ""
    ratio = float(np.median(ratios))
    if 1 / RULES.time_ratio < ratio < RULES.time_ratio:
        return ""
    return (
        "against the masses of the robot file, inertia shows "
        f"{format_number(ratio, 2)} times as strongly as weight, as if each second of the log "
        f"lasted {1 / np.sqrt(ratio):.2g} s"
    )


def _by_rate(logs: MeasuredLogs) -> str:
    for log in logs.recordings:
        step = (log.clock.last - log.clock.first) / max(len(log) - 1, 1)
        if step > LOG_RULES.slowest_step:
            return f"{log.name} has one sample in {step:.3g} s, too few for a robot in motion"
    return ""


# Velocities or accelerations that contradict what they are derived from.


@check(
    "derivative of another motion",
    Does.MISREADS,
    1,
    says="A derivative contradicts its position: …",
    means="A velocity or acceleration column is of another joint, in another unit, late, or "
    "filtered until little of the motion is left.",
    do="Leave the column out (it is then computed), or give the right one; `--derivatives "
    "given` uses it all the same.",
)
def find_wrong_rates(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on given derivatives of another motion, or none."""
    found = [f"in {s.name} {note}" for s in logs.samples for note in s.notes if CONTRADICTS in note]
    if not found:
        return ()
    return (f"A derivative contradicts its position: {'; '.join(found[:3])}.",)


#: What such a note holds (`logs.units.find_contradictions`).
CONTRADICTS = "' contradicts '"
