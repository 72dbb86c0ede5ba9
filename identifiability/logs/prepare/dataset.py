"""`Dataset`: the rows of a log, made ready for the regression.

It holds the motion of every joint, torque, weights of rows, and notes on the preparation. A
`Survey` summarises the whole log. A long log is prepared piece by piece, and its rows stay on the
disk.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from scipy.ndimage import correlate1d

from identifiability.foundation.engines import Engine, Serial, Steps
from identifiability.foundation.errors import ClosureError, LogError, RobotError, listing
from identifiability.foundation.findings import Finding, of_key
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import checked
from identifiability.foundation.rounding import percent
from identifiability.foundation.values import Fields, frozen
from identifiability.logs import Log, signals
from identifiability.logs.base import AFTER, UP
from identifiability.logs.rows import WINDOW, divide_rows, find_range, forget, gather, is_long
from identifiability.logs.rules import RULES
from identifiability.logs.signals import is_constant, never_moves
from identifiability.logs.spectrum import noise_level
from identifiability.robot import KnownRobot, Motion, Robot, complete_motion
from identifiability.robot.closure import known_torque, project
from identifiability.robot.floating import SIX, closed_contacts, wrench_torque

from .preparation import Plan, Preparation, joint_log, make_plan, smoothed

# `Survey`: the summary of a prepared log.
#
# It is decided here whether logs have any information (`find_signal`, `explain_silence`). Without
# any, ε_RA has no denominator and nothing is fitted.


#: Rows of a log, from the first to the last (exclusive).
Rows = tuple[int, int]


@frozen
class Survey:
    """Counts, ranges and sums over a log.

    Attributes
    ----------
    kept, outputs : int
        Number of samples before and after decimation.
    start, stop : float [s]
        Times of the first and the last sample; NaN without any.
    low, high : (3, n)
        Ranges of position, velocity and acceleration of the actuated joints.
    torque_range : (2, n) [N·m or N]
        Smallest and largest torque.
    rows : (n,) int
        Number of outputs at which torque of each joint is data, because the joint moves.
    """

    kept: int
    outputs: int
    start: float
    stop: float
    low: Array
    high: Array
    torque_range: Array
    rows: Array = np.zeros(1, int)


def stands_still(surveys: Sequence[Survey]) -> Array:
    """Return which actuated joints are at one place in these logs, (n,) bool."""
    low = np.min([s.low for s in surveys], axis=0)
    high = np.max([s.high for s in surveys], axis=0)
    # The joints of a base have position zero for any motion of the base.
    at_zero = (low[0] == 0.0) & (high[0] == 0.0)
    based = at_zero & ~never_moves(low[2], high[2])
    return never_moves(low[0], high[0]) & ~based


def robot_moves(surveys: Sequence[Survey]) -> bool:
    """Return whether any actuated joint is at two places in these logs."""
    return not stands_still(surveys).all()


def torque_varies(surveys: Sequence[Survey]) -> Array:
    """Return at which actuated joints the measured torque changes in these logs, (n,) bool."""
    low = np.min([s.torque_range[0] for s in surveys], axis=0)
    high = np.max([s.torque_range[1] for s in surveys], axis=0)
    return ~is_constant(low, high)


def find_signal(surveys: Sequence[Survey]) -> Array:
    """Return at which actuated joints logs have something to explain, (n,) bool.

    The robot moves, and the torque of that joint changes.
    """
    return torque_varies(surveys) & robot_moves(surveys)


def explain_silence(surveys: Sequence[Survey]) -> str:
    """Return why logs have nothing to explain, for after "because"; nothing if they have."""
    if not robot_moves(surveys):
        return "the robot does not move in these logs"
    if not torque_varies(surveys).any():
        return "the measured torque never changes in these logs"
    return ""


# `Dataset`: a log made ready for the regression: motion of every joint, torque, and how.


@frozen
class Piece:
    """Consecutive samples, with those at both ends that the decimation filter needs.

    Attributes
    ----------
    motion : Motion
        Motion at N samples.
    tau : (N, n) [N·m or N]
    decimation : Decimation or None
    weight : (N, n)
        Weight of each torque, from 0 for no data to 1.
    first : int
        Its first output among those of the dataset.
    """

    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    weight: Array
    first: int

    def down(self, x: Array) -> Array:
        """Return x (N, …) low-passed and decimated, if there is any decimation."""
        if self.decimation is None:
            return x
        return self.decimation.apply(x)

    @cached_property
    def _lost(self) -> Array | None:
        """Return a mask of torque that is no data, (N, n) bool; None if all is data.

        Samples between those of columns are as the nearest of these.
        """
        lost = self.weight <= 0
        every = self.decimation.every if self.decimation else 1
        nearest = (np.arange(len(lost)) + every // 2) // every
        return lost[every * nearest] if lost.any() else None

    @property
    def sparse(self) -> Piece:
        """The samples of which columns are computed, with the same outputs.

        The motion was low-passed, so that few samples hold all of it.
        """
        d = self.decimation
        if d is None or d.every == 1:
            return self
        motion = self.motion[np.arange(0, len(self.motion), d.every)]
        half = d.every // 2
        speeds = np.pad(self.motion.actuated_v, ((half, half), (0, 0)), mode="edge")
        mean = np.sign(speeds).reshape(len(motion), d.every, -1).mean(1)
        # A mean over an interval lowers the second difference by a 24th.
        signs = correlate1d(mean, np.array([-1, 26, -1]) / 24, axis=0, mode="nearest")
        # No sample is missing between two of these.
        motion = replace(motion, kept=motion.kept // d.every, signs=signs)
        fewer = signals.Decimation(d.factor // d.every)
        return Piece(motion, self.tau[:: d.every], fewer, self.weight[:: d.every], self.first)

    @property
    def moves(self) -> Array:
        """Return a mask of outputs at which torque of each joint is data, (m, n) bool."""
        return self.weight[self.at] > 0

    @property
    def torque(self) -> Array:
        """Torque at its outputs by the root of its weight, (m, n)."""
        tau = np.array(self.tau)
        return self.weighed(self.down(self.silenced(tau)))

    @property
    def raw(self) -> Array:
        """The same as it was measured, not low-passed, (m, n)."""
        return self.weighed(np.array(self.tau[self.at]))

    def silenced(self, x: Array, joints: np.ndarray | None = None) -> Array:
        """Return inputs (N, n, …), or (N, m) of m joints, with zeros where torque is no data.

        Zeros are set in torque and columns alike, before a filter uses them. Low-passed torque and
        columns are then related as they are while the joint moves. The inputs are overwritten.
        """
        if self._lost is not None and self.decimation is not None:
            x[self._lost if joints is None else self._lost[:, joints]] = 0.0
        return x

    def weighed(self, x: Array, joints: np.ndarray | None = None) -> Array:
        """Return rows (N, n, …), or (N, m) of m joints, by the root of their weight.

        They are written over.
        """
        weight = self.weight[self.at] if joints is None else self.weight[self.at][:, joints]
        if not (weight == 1).all():
            axes = (1,) * (x.ndim - weight.ndim)
            x *= np.sqrt(weight).reshape(*weight.shape, *axes)
        return x

    @property
    def at(self) -> slice:
        """The samples of the motion at which the outputs are."""
        d = self.decimation
        if d is None:
            return slice(None)
        return slice(d.reach, len(self.motion) - d.reach, d.factor)


@frozen
class Dataset:
    """A prepared log; `prepare_log` makes it.

    Attributes
    ----------
    name : str
    motion : Motion
        Motion of every joint, at the samples whose loops close.
    tau : (N, n) [N·m or N]
        Measured torque at the same samples, minus known torque.
    weight : (N, n)
        Weight of each torque, from 0 to 1. It is 0 if the joint stands, or torque was not measured.
    decimation : Decimation or None
        Decimation filter, which is the same for regressor and torque.
    notes : tuple of str
        Notes on derivatives and dropped samples, for the report. The findings among them are its
        `ledger`.
    sha256 : str
    own : (int, int) or None
        Rows of the log at which outputs are wanted; the filter also needs the other rows. None for
        all.
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None without one.
    band : float or None [Hz]
        Upper limit of the kept band of torque and regressor.
    instrument : Motion or None
        A second record of the motion at the same samples, with errors independent of those of
        `motion`.
    lost : int
        Number of samples in these rows that were left out next to a gap.
    breaks : (b,) int
        Rows of the log before which it is split, because many samples are missing.
    hints : tuple of str
        Problems of the log.
    path : str
        Path of the log.
    series : bool
        Whether its motion is a fitted series.
    """

    name: str
    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    notes: Strings
    sha256: str
    own: Rows | None = None
    cutoff: float | None = None
    band: float | None = None
    instrument: Motion | None = None
    lost: int = 0
    breaks: Array = np.empty(0, int)
    hints: Strings = ()
    path: str = ""
    weight: Array = np.ones((1, 1))
    series: bool = False

    def __post_init__(self) -> None:
        """Set equal weights if none are given."""
        if self.weight.shape != self.tau.shape:
            object.__setattr__(self, "weight", np.broadcast_to(self.weight, self.tau.shape))

    @property
    def drives_alone(self) -> bool:
        """Return whether its torque is motor torque minus link torque."""
        return self.motion.drives_alone

    @property
    def ledger(self) -> tuple[Finding, ...]:
        """Return the findings on its rows and columns during preparation."""
        return tuple(of_key(self.notes))

    @property
    def long(self) -> bool:
        """Return whether it has so many rows that they stay on the disk."""
        return is_long(len(self.tau))

    def divided(self) -> list[Dataset]:
        """Return the parts to process one by one: stretches of a long log, or the whole log."""
        if not self.long:
            return [self]
        reach = 0 if self.decimation is None else self.decimation.reach
        kept = self.motion.kept
        parts = []
        for a, b in divide_rows(len(kept)):
            part = self.take(slice(max(0, a - reach), b + reach))
            stop = int(kept[b - 1]) + 1
            parts.append(replace(part, own=(int(kept[a]), stop)))
        return parts

    @property
    def beside(self) -> Dataset | None:
        """The samples along the second record of the motion."""
        other = self.instrument
        if other is None:
            return None
        return replace(self, motion=other, instrument=None)

    @cached_property
    def torque_noise(self) -> Array:
        """Standard deviation of white noise on the torque after decimation, (n,) [N·m or N].

        Of the first rows of a long log.
        """
        level = noise_level(self.tau[:WINDOW], self.motion.t[:WINDOW])
        if self.decimation is None:
            return level
        return level * np.linalg.norm(self.decimation.taps)

    @cached_property
    def outputs(self) -> int:
        """Number of samples after decimation."""
        return sum(count for *_, count in self.runs)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The outputs with which a stretch begins: the first, and those behind a long gap."""
        if not len(self.breaks):
            return (0,)
        before = np.searchsorted(self.motion.kept[self.at_outputs], self.breaks)
        return (0, *(int(k) for k in np.unique(before) if 0 < k < self.outputs))

    @cached_property
    def runs(self) -> list[tuple[int, int, int]]:
        """Stretches of samples that make outputs without a gap, (start, stop, outputs) each."""
        d = self.decimation
        kept = self.motion.kept
        if d is None:
            return [(0, len(kept), len(kept))]
        edges = [0]
        out = []
        for a, b in divide_rows(len(kept) - 1):
            edges += (a + 1 + np.flatnonzero(np.diff(kept[a : b + 1]) > 1)).tolist()
        for start, stop in pairwise([*edges, len(kept)]) if len(kept) else ():
            row = int(kept[start])
            shift = start - int(kept[start])
            low, high = self.own or (0, row + stop - start)
            # Multiples of the factor, so that it does not matter in which parts a log is read.
            first = -(-max(row + d.reach, low) // d.factor) * d.factor
            centres = range(first, min(row + stop - start - d.reach, high), d.factor)
            if centres:
                ends = (centres[0] + shift - d.reach, centres[-1] + shift + d.reach + 1)
                out.append((*ends, len(centres)))
        return out

    @cached_property
    def survey(self) -> Survey:
        """Return the summary of the whole log."""
        m = self.motion
        n = self.tau.shape[1]
        rows = np.zeros(n, int)
        ends = [np.full((2, n), [[np.inf], [-np.inf]])]
        for p in self.pieces(1024):
            raw = p.raw
            where = p.moves
            rows = rows + where.sum(0)
            # As measured: low-passed torque changes near rows that are no data.
            lowest = raw.min(0, initial=np.inf, where=where)
            highest = raw.max(0, initial=-np.inf, where=where)
            ends.append(np.stack([lowest, highest]))
        low, high = np.stack(ends, 1)
        ranges = [find_range(x) for x in (m.actuated_q, m.actuated_v, m.actuated_a)]
        start, stop = (m.t[0], m.t[-1]) if len(m) else (np.nan, np.nan)
        low_ends = np.stack([low for low, _ in ranges])
        high_ends = np.stack([high for _, high in ranges])
        torque_range = np.stack([low.min(0), high.max(0)])
        return Survey(
            kept=len(m),
            outputs=self.outputs,
            start=float(start),
            stop=float(stop),
            low=low_ends,
            high=high_ends,
            torque_range=torque_range,
            rows=rows,
        )

    def pieces(self, size: int, windows: Array | None = None) -> Iterator[Piece]:
        """Yield pieces of about `size` samples of the motion, or of many reaches of the filter.

        Neighbours overlap by the reach on either side: their common samples are computed twice.

        Parameters
        ----------
        size : int
        windows : (w, 2) int, optional
            Outputs [start, stop) that are wanted; all by default.
        """
        d = self.decimation
        factor, more = (1, 0) if d is None else (d.factor, 2 * d.reach)
        step = max(size, MARGINS * more) // factor
        wanted = [[0, self.outputs]] if windows is None else windows.tolist()
        before = 0
        for start, _, count in self.runs:
            for low, high in wanted:
                stop = min(high - before, count)
                for first in range(max(low - before, 0), stop, step):
                    begin = start + first * factor
                    few = min(step, stop - first)
                    rows = slice(begin, begin + (few - 1) * factor + more + 1)
                    motion = self.motion[rows]
                    yield Piece(motion, self.tau[rows], d, self.weight[rows], before + first)
                    if self.long or self.own is not None:
                        forget()
            before += count

    def take(self, rows: slice | Array) -> Dataset:
        """Return some of the samples."""
        other = None if self.instrument is None else self.instrument[rows]
        motion = self.motion[rows]
        tau = self.tau[rows]
        weight = self.weight[rows]
        return replace(
            self,
            motion=motion,
            tau=tau,
            weight=weight,
            instrument=other,
        )

    def thin(self, step: int) -> Dataset:
        """Return every `step`-th sample, without decimation."""
        return replace(self.take(slice(None, None, step)), decimation=None)

    def output_times(self, at: slice | Array = slice(None)) -> Array:
        """Return the times of samples after decimation [s], all by default."""
        return self.motion.t[self.at_outputs[at]]

    @property
    def at_outputs(self) -> Array:
        """The samples of the motion at which the outputs are."""
        factor, reach = (1, 0) if (d := self.decimation) is None else (d.factor, d.reach)
        rows = [start + reach + factor * np.arange(count) for start, _, count in self.runs]
        return np.concatenate([np.empty(0, int), *rows])

    def describe(self, joints: Sequence[str], total: int) -> list[Finding]:
        """Return the findings on the samples of a log with `total` of them."""
        m = self.motion
        notes = []
        if len(m.dropped):
            where = listing(map(str, m.dropped + 1), 5)
            notes.append(
                Finding("unclosed", self.name, rows=len(m.dropped), all=total, where=where)
            )
        if m.singular:
            first = int(m.near_singular[0]) + 1
            notes.append(
                Finding("singular", self.name, rows=m.singular, first=first, condition=m.condition)
            )
        if self.lost:
            notes.append(Finding("beside_gaps", self.name, rows=self.lost, all=total))
        rests = self.survey.outputs - self.survey.rows
        rest = {j: k for j, k in zip(joints, rests.tolist(), strict=True) if k > 0}
        if rest:
            shares = (f"{j} {percent(k / self.survey.outputs)}" for j, k in rest.items())
            told: Fields = {"rows": sum(rest.values()), "where": ", ".join(shares)}
            told["columns"] = tuple(f"{j}.tau" for j in rest)
            told["share"] = max(rest.values()) / self.survey.outputs
            notes.append(Finding("standing", self.name, **told))
        return notes


#: Prepared logs.
Samples: TypeAlias = tuple[Dataset, ...]


def _prepare_rows(rows: tuple[Log, int, Rows], robot: Robot, plan: Plan) -> Dataset:
    """Prepare some rows of a log by a plan.

    Parameters
    ----------
    rows : (Log, int, (int, int))
        The rows with those at both ends that the filters need, the index of the first in the whole
        log, and the range of wanted rows in the whole log.
    robot : Robot
    plan : Plan

    Raises
    ------
    LogError, ClosureError
    """
    log, origin, own = rows
    log = joint_log(robot, plan.mend(log, origin))
    q, dq, ddq = plan.derive(log, origin)
    part = slice(own[0] - origin, own[1] - origin)
    touch = _touch(robot, log)
    touch = None if touch is None else touch[part]
    motion = complete_motion(robot, log.t[part], q[part], dq[part], ddq[part], touch)
    at = own[0] - origin + motion.kept
    smooth = plan.smooth_speed(log, origin)
    if smooth is not None:
        motion = replace(motion, smooth_v=smooth[at])
    motion = replace(motion, drives_alone=log.drives_alone)
    tau = log.tau[at] - _known_torque(robot, log.name, motion)
    if robot.base is not None and log.base is not None:
        tau = motion.freed(tau + _pushed(robot, motion, log.base[at]))
    silent = np.zeros(tau.shape, bool) if plan.dwells is None else plan.dwells.find(dq)[at]
    undirected = plan.undirected(log)
    if undirected is not None:
        silent = silent | undirected[at]
    if robot.base is not None:
        silent = _silent(motion, silent)
    if log.unmeasured is not None:
        silent = silent | plan.lacking(log.unmeasured)[at]
    left = np.ones(len(tau), bool)
    breaks = np.empty(0, int)
    if plan.grid is not None:
        left = ~plan.grid.left_out(origin, origin + len(log))[at]
        breaks = plan.grid.breaks
        motion = motion[left]
    places = {k: getattr(motion, k) + own[0] for k in ("kept", "dropped", "near_singular")}
    moved = replace(motion, **places, start=log.start)
    lost = int((~left).sum())
    return Dataset(
        log.name,
        moved,
        tau[left],
        plan.decimation,
        (),
        log.sha256,
        cutoff=plan.cutoff,
        band=plan.band,
        lost=lost,
        breaks=breaks,
        hints=plan.hints,
        path=log.path,
        weight=1.0 - silent[left],
        series=log.speed_error is not None,
    )


def _touch(robot: Robot, log: Log) -> Array | None:
    """Return the upward direction and possible contacts, (N, 3 + c); None for a fixed base."""
    if robot.base is None or log.base is None:
        return None
    contacts = robot.base.contacts
    flags = log.base[:, AFTER : AFTER + len(contacts)]
    closed = closed_contacts(contacts, log.t, flags)
    return np.hstack([log.base[:, UP], closed])


def _pushed(robot: Robot, motion: Motion, record: Array) -> Array:
    """Return the torque of the actuated joints that measured wrenches make, (N, n)."""
    assert robot.base is not None
    at = AFTER + len(robot.base.contacts)
    tree = np.zeros((len(motion), robot.nv))
    for k, wrench in enumerate(robot.base.wrenches):
        values = record[:, at + 6 * k : at + 6 * (k + 1)]
        tree += wrench_torque(robot.tree, motion.q, wrench, values)
    return project(robot, motion, tree)


def _silent(motion: Motion, dwells: Array) -> Array:
    """Return which rows are no data, (N, n) bool: dwells of joints, and rows that contacts hide.

    The base never dwells: its rows count at all times.
    """
    found = np.array(dwells)
    found[:, :SIX] = False
    if motion.silent is None:
        return found
    return found | motion.silent


def _known_torque(robot: Robot, name: str, motion: Motion) -> Array:
    """Return the known torque, (N, n)."""
    try:
        return known_torque(robot, motion)
    except RobotError as error:
        raise LogError(f"{name}: {error}") from None


def join_motions(motions: Sequence[Motion]) -> Motion:
    """Return motions one after the other."""
    first = motions[0]
    none = np.empty(0, int)
    rows = [m.each for m in motions]
    known = [name for name in rows[0] if all(name in own for own in rows)]
    joined: Fields = {name: np.concatenate([own[name] for own in rows]) for name in known}
    joined.setdefault("smooth_v", None)
    condition = max(m.condition for m in motions)
    return replace(
        first,
        **joined,
        condition=condition,
        dropped=none,
        near_singular=none,
    )


def check_left(name: str, left: int, total: int, notes: Sequence[str]) -> None:
    """Refuse a log with nearly no rows after preparation.

    Raises
    ------
    LogError
    """
    if left < RULES.fewest:
        why = f" ({'; '.join(notes[1:])})" if notes[1:] else ""
        raise LogError(
            f"{name}: {left} of {total} samples are left{why}, too few to say anything; at least "
            f"{RULES.fewest} are needed and some hundreds are usual."
        )


# From a `Log` to a `Dataset`.


#: Number of samples to prepare at a time, at least in units of the reach of the filters. For a
#: decimation filter, in units of its reach on both sides.
MARGINS = 6


@checked
def prepare_log(
    robot: KnownRobot,
    log: Log,
    how: Preparation | None = None,
    *,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> Dataset:
    """Turn a log into rows: pick the joints, make derivatives, close the loops.

    Parameters
    ----------
    robot : Robot
    log : Log
    how : Preparation, optional
    engine : Engine, optional
        Engine for the summary of a long log; by default this process.
    progress : callable(int, int), optional

    Raises
    ------
    LogError, ClosureError
    """
    how = how or Preparation()
    total = len(log)
    log = smoothed(robot, log, how)
    plan = make_plan(robot, log, how)
    reach = plan.reach
    rows = []
    for a, b in divide_rows(total, max(WINDOW, MARGINS * reach)):
        low = max(0, a - reach)
        rows.append((log.rows(low, min(total, b + reach)), low, (a, b)))
    work = partial(
        _prepare_rows,
        robot=robot,
        plan=plan,
    )
    done = (engine if engine and log.long else Serial()).map(work, rows, progress=progress)
    found = _join(done)
    notes = [*plan.notes, *found.describe(robot.joints, total)]
    check_left(log.name, len(found.tau), total, notes)
    while plan.factor > 1 and found.outputs < RULES.fewest:
        if how.decimate is not None:
            raise LogError(
                f"{log.name} is too short to be decimated by {plan.factor}: of its {len(log)} "
                f"samples fewer than {RULES.fewest} are left; give a longer log or a smaller "
                "decimation."
            )
        plan = replace(plan, factor=plan.factor - 1)
        found = replace(found, decimation=plan.decimation)
    if plan.decimation is not None:
        rate = 1.0 / (plan.step * plan.factor)
        notes.append(
            Finding(
                "decimated",
                log.name,
                rows=len(log),
                columns=("all",),
                factor=plan.factor,
                rate=rate,
            )
        )
    motion = replace(found.motion, first=log.clock.first)
    return replace(found, motion=motion, notes=tuple(notes))


def _join(parts: Iterator[Dataset]) -> Dataset:
    """Return rows one after the other."""
    first: list[Dataset] = []
    told = []  # little, as parts are many

    def arrays() -> Iterator[dict[str, Array]]:
        for part in parts:
            motion = part.motion
            told.append((motion.dropped, motion.near_singular, motion.condition, part.lost))
            if not first:
                first.append(part.take(np.empty(0, int)))  # a slice would keep all of it
            if len(part.tau):
                yield {**motion.each, "tau": part.tau, "weight": part.weight}

    found = gather(arrays())
    own = {k: found.pop(k) for k in ("tau", "weight") if found}
    dropped, singular, condition, lost = zip(*told, strict=True)
    motion = replace(
        first[0].motion,
        **found,
        dropped=np.concatenate(dropped),
        near_singular=np.concatenate(singular),
        condition=max(condition),
    )
    return replace(first[0], motion=motion, lost=sum(lost), **own)


def require_signal(samples: Sequence[Dataset], done: str) -> None:
    """Refuse logs that have nothing to explain.

    Parameters
    ----------
    samples : sequence of Dataset
    done : str
        The refused step, as a participle.

    Raises
    ------
    LogError
    """
    why = explain_silence([s.survey for s in samples]) if samples else ""
    if why:
        names = [s.name for s in samples]
        raise LogError(Finding("logs.silent", done, why=why, names=names))


def move_samples(robot: Robot, given: Dataset, by: Array) -> Dataset:
    """Return samples at other positions, A times theirs.

    Parameters
    ----------
    robot : Robot
    given : Dataset
    by : (n, n)
        A.

    Raises
    ------
    ClosureError
        If loops do not close at some.
    """
    old = given.motion
    actuated = (x @ by.T for x in (old.actuated_q, old.actuated_v, old.actuated_a))
    new = complete_motion(robot, old.t, *actuated)
    if len(new) < len(old):
        raise ClosureError(f"Loops of {given.name} do not close there.")
    new = replace(new, kept=old.kept, dropped=old.dropped, first=old.first, start=old.start)
    new = replace(new, drives_alone=old.drives_alone)
    strongest = np.abs(by).argmax(1)
    return replace(given, motion=new, weight=given.weight[:, strongest])
