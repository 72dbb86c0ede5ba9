"""What is odd about time: torque that is late, another unit, derivatives that contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy

from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.foundation.names import Array
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

# Torque that is late, or early, beside its motion, and positions beside their velocities.
#
# A delay by a few samples is found by the slope of the model's torque, and tested against what is
# left from one stretch of time to the next. A larger one is another model (`alternatives`).


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
    says="Columns seem to be apart in time: …",
    means="Columns were recorded with different delays, or put together from different clocks; "
    "a millisecond at speed looks like friction or inertia.",
    do="Shift the columns by what is said, or log what was measured together. Of a base that "
    "moves, let all channels pass one filter.",
)
def find_late(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque or positions that are late or early, or none."""
    parts = []
    for recording, samples in zip(logs.recordings, logs.samples, strict=True):
        windows = [recording.rows(a, b) for a, b in signals.spread_windows(len(recording))]
        position = measure_position(joint_log(logs.robot, windows[0]))
        shift = None if position else measure_shift(logs.structure, samples)
        for what, other, own in (
            ("positions", "their velocities", position),
            ("torque", "the motion", shift),
        ):
            if own is not None and own.certain:
                whose = "all joints" if own.joint < 0 else logs.joints[own.joint]
                parts.append(f"in {samples.name} {what} of {whose}, {own.text} beside {other}")
    if not parts:
        return ()
    return (
        f"Columns seem to be apart in time: {'; '.join(parts[:3])}. Rows may hold what was read at "
        "different moments, or a velocity the difference to the row before: shift the columns, or "
        "log what was measured together.",
    )


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


def _consecutive(prepared: Prepared) -> Samples | None:
    """Return samples that follow each other, undecimated."""
    if isinstance(prepared, Samples):
        return replace(prepared, decimation=None, instrument=None)
    middle = prepared.stretches[len(prepared.stretches) // 2]
    return next((replace(p, decimation=None) for p in middle.parts() if len(p.tau)), None)


# Time in another unit: speeds that contradict the file's limits, or too few samples.


@check(
    "time in another unit",
    Does.MISREADS,
    4,
    says="The time may be in another unit than s: …",
    means="The robot would move far faster or slower than its file allows, or hardly be sampled.",
    do="`--set time_unit=ms` (or `us`, `ns`, `min`), or `[time]` in the sidecar.",
)
def find_time_scale(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on time in another unit, or none."""
    why = _by_limits(logs) or _by_rate(logs)
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
    do="Leave the column out (it is then computed), or give the right one; `--set "
    "derivatives=given` uses it all the same.",
)
def find_wrong_rates(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on given derivatives of another motion, or none."""
    found = [f"in {s.name} {note}" for s in logs.samples for note in s.notes if CONTRADICTS in note]
    if not found:
        return ()
    return (f"A derivative contradicts its position: {'; '.join(found[:3])}.",)


#: What such a note holds (`logs.units.find_contradictions`).
CONTRADICTS = "' contradicts '"
