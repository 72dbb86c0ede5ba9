"""`Samples`: a log made ready for the regression: motion of every joint, torque, and how.

A `Survey` is what there is to know of it as a whole; parts of a log add up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from identifiability.foundation.errors import ClosureError, LogError, RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.base import AFTER, UP
from identifiability.logs.prepare.plan import Plan, joint_log
from identifiability.logs.rules import RULES
from identifiability.logs.signals import is_constant, never_moves
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.robot.closure import known_torque, project
from identifiability.robot.floating import SIX, closed_contacts, wrench_torque

# `Survey`: what there is to know of a prepared log as a whole; parts of a log add up.
#
# Here it is said once whether logs have anything to explain (`find_signal`, `explain_silence`):
# ε_RA has no denominator where they have not, and nothing is fitted to them.


#: Rows of a log, from the first to the last (exclusive).
Rows = tuple[int, int]

#: Why torque has no weight.
DWELLS = (
    "torque of a joint that stands has no weight, as dry friction may be anything up to its level "
    "there"
)

#: Rows that a note lists.
LISTED = 5


@frozen
class Survey:
    """Counts, ranges and sums over a log.

    Attributes
    ----------
    kept, outputs : int
        Samples that were prepared, and left after decimation.
    dropped : int
        Samples at which the loops do not close.
    first_dropped : tuple of int
        The first of their rows.
    singular : int
        Samples near a singular configuration.
    first_singular : tuple of int
        The first of their rows, if any.
    condition : float
        Largest condition number of the closure (1 for an open chain).
    start, stop : float [s]
        Times of the first and the last sample; NaN without any.
    low, high : (3, n)
        Ranges of position, velocity and acceleration of the actuated joints.
    torque : (n,) [N·m or N]
        Sum of the measured torque over the outputs.
    torque_range : (2, n) [N·m or N]
        Its smallest and its largest value.
    lost : int
        Samples that were left out because they lie beside a gap.
    rows : (n,) int
        Outputs at which torque of each joint is data: it does not dwell there.
    """

    kept: int
    outputs: int
    dropped: int
    first_dropped: tuple[int, ...]
    singular: int
    first_singular: tuple[int, ...]
    condition: float
    start: float
    stop: float
    low: Array
    high: Array
    torque: Array
    torque_range: Array
    lost: int = 0
    rows: np.ndarray = field(default_factory=lambda: np.zeros(1, int))

    @staticmethod
    def of(motion: Motion, own: Rows | None, outputs: int, torque: Array, span: Array) -> Survey:
        """Return the survey of a motion, or of those of its rows that are its own."""
        inside = slice(None) if own is None else slice(*np.searchsorted(motion.kept, own))
        dropped, near = _inside(motion.dropped, own), _inside(motion.near_singular, own)
        t = motion.t[inside]
        parts = [x[inside] for x in (motion.actuated_q, motion.actuated_v, motion.actuated_a)]
        return Survey(
            kept=len(t),
            outputs=outputs,
            dropped=len(dropped),
            first_dropped=tuple(dropped[:LISTED].tolist()),
            singular=len(near),
            first_singular=tuple(near[:1].tolist()),
            condition=motion.condition,
            start=float(t[0]) if len(t) else np.nan,
            stop=float(t[-1]) if len(t) else np.nan,
            low=np.stack([x.min(0, initial=np.inf) for x in parts]),
            high=np.stack([x.max(0, initial=-np.inf) for x in parts]),
            torque=torque,
            torque_range=span,
            rows=np.full(len(torque), outputs),
        )

    def __add__(self, later: Survey) -> Survey:
        """Return the survey of both, this one first in time."""
        counts: dict[str, Any] = {
            name: getattr(self, name) + getattr(later, name)
            for name in ("kept", "outputs", "dropped", "singular", "torque", "lost", "rows")
        }
        (low, high), (later_low, later_high) = self.torque_range, later.torque_range
        return Survey(
            **counts,
            first_dropped=(*self.first_dropped, *later.first_dropped)[:LISTED],
            first_singular=(*self.first_singular, *later.first_singular)[:1],
            condition=max(self.condition, later.condition),
            start=later.start if np.isnan(self.start) else self.start,
            stop=self.stop if np.isnan(later.stop) else later.stop,
            low=np.minimum(self.low, later.low),
            high=np.maximum(self.high, later.high),
            torque_range=np.stack([np.minimum(low, later_low), np.maximum(high, later_high)]),
        )

    def notes(self, total: int) -> list[str]:
        """Return what happened to the samples of a log with `total` of them, for the report."""
        notes = []
        if self.dropped:
            first = ", ".join(str(k + 1) for k in self.first_dropped)
            more = " …" if self.dropped > LISTED else ""
            notes.append(
                f"{self.dropped} of {total} samples were dropped because the loops do not close "
                f"there (data rows {first}{more})"
            )
        if self.singular:
            notes.append(
                f"{self.singular} samples lie near a singular configuration (first in data row "
                f"{self.first_singular[0] + 1}, condition number up to {self.condition:.1e}); "
                "torques there are amplified errors"
            )
        if self.lost:
            notes.append(f"{self.lost} of {total} samples beside long gaps were left out")
        return notes

    def dwells(self, joints: Sequence[str]) -> list[str]:
        """Return at which joints how much torque has no weight, for the report."""
        shares = 1 - self.rows / max(self.outputs, 1)
        told = [f"{j} {percent(s)}" for j, s in zip(joints, shares, strict=True) if s > 0]
        return [f"{DWELLS}: {', '.join(told)} of the time"] if told else []


def stands_still(surveys: Sequence[Survey]) -> np.ndarray:
    """Return which actuated joints are at one place in these logs, (n,) bool."""
    low = np.min([s.low for s in surveys], axis=0)
    high = np.max([s.high for s in surveys], axis=0)
    # The joints that stand for a base are at zero wherever it goes.
    based = (low[0] == 0.0) & (high[0] == 0.0) & ~never_moves(low[2], high[2])
    still: np.ndarray = never_moves(low[0], high[0]) & ~based
    return still


def robot_moves(surveys: Sequence[Survey]) -> bool:
    """Return whether any actuated joint is at two places in these logs."""
    return not stands_still(surveys).all()


def torque_varies(surveys: Sequence[Survey]) -> np.ndarray:
    """Return at which actuated joints the measured torque changes in these logs, (n,) bool."""
    low = np.min([s.torque_range[0] for s in surveys], axis=0)
    high = np.max([s.torque_range[1] for s in surveys], axis=0)
    return ~is_constant(low, high)


def find_signal(surveys: Sequence[Survey]) -> np.ndarray:
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


def _inside(rows: np.ndarray, own: Rows | None) -> np.ndarray:
    return rows if own is None else rows[(rows >= own[0]) & (rows < own[1])]


# `Samples`: a log made ready for the regression: motion of every joint, torque, and how.


@frozen
class Piece:
    """Consecutive samples, with what the decimation filter draws on at both ends.

    Attributes
    ----------
    motion : Motion
        Of those N that columns are computed of.
    tau : ((N - 1) e + 1, n) [N·m or N]
        Of every sample: e are between two of the motion's.
    decimation : Decimation or None
    again : int
        How many of its first samples are the last ones of the piece before.
    dwells : (N, n) bool or None
        Where a joint's torque is no data; None where all is.
    """

    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    again: int = 0
    dwells: np.ndarray | None = None

    @property
    def coarse(self) -> signals.Decimation | None:
        """What low-passes and decimates columns, if anything does."""
        return self.decimation and self.decimation.coarse

    def down(self, x: Array) -> Array:
        """Return x (N, …) low-passed and decimated, if there is any decimation."""
        return x if self.coarse is None else self.coarse.apply(x)

    @property
    def moves(self) -> np.ndarray | None:
        """Where, at its outputs, torque of each joint is data, (m, n) bool; None for all."""
        return None if self.dwells is None else ~self.dwells[self.at]

    @property
    def torque(self) -> Array:
        """Torque at its outputs, zero where it is no data, (m, n)."""
        tau, d = np.array(self.tau), self.decimation
        if d is None:
            return self.masked(tau)
        if self.dwells is not None:
            # A sample of the columns stands for those around it.
            tau[self.dwells[(np.arange(len(tau)) + d.every // 2) // d.every]] = 0.0
        return self.masked(d.apply(tau))

    @property
    def raw(self) -> Array:
        """The same as it was measured, not low-passed, (m, n)."""
        every = 1 if self.decimation is None else self.decimation.every
        return self.masked(np.array(self.tau[::every][self.at]))

    def silenced(self, x: Array, joint: int | None = None) -> Array:
        """Return inputs (N, n, …), or (N, …) of a joint, that are zero where torque is no data.

        Torque and columns alike, before a filter draws on them: what is low-passed is then related
        as it is where the joint moves, however near. They are written over.
        """
        if self.dwells is not None and self.decimation is not None:
            x[self.dwells if joint is None else self.dwells[:, joint]] = 0.0
        return x

    def masked(self, x: Array, joint: int | None = None) -> Array:
        """Return rows (m, n, …), or (m, …) of a joint, that are zero where torque is no data.

        They are written over.
        """
        if self.dwells is not None:
            x[self.dwells[self.at] if joint is None else self.dwells[self.at][:, joint]] = 0.0
        return x

    @property
    def at(self) -> slice:
        """The samples of the motion at which the outputs are."""
        d = self.coarse
        return slice(None) if d is None else slice(d.reach, len(self.motion) - d.reach, d.factor)


@frozen
class Samples:
    """A prepared log.

    Attributes
    ----------
    name : str
    motion : Motion
        Of every joint, at the samples whose loops close.
    tau : (N, n) [N·m or N]
        Measured torque at the same samples, less what is known beforehand.
    decimation : Decimation or None
        Applied alike to regressor and torque.
    notes : tuple of str
        How the derivatives were made and what was dropped, for the report.
    sha256 : str
    own : (int, int) or None
        Rows of the log at which outputs are wanted, where the others are only what the filter
        draws on; None for all.
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None where there is none.
    band : float or None [Hz]
        Up to where torque and regressor are kept beside them.
    instrument : Motion or None
        A second record of the motion at the same samples, whose errors are not those of `motion`.
    lost : int
        Samples of its own rows that were left out because they lie beside a gap.
    breaks : (b,) int
        Rows of the log before which so many samples are missing that it is split there.
    hints : tuple of str
        What seems to be wrong with the log.
    dwells : (N, n) bool or None
        Where a joint stands, so that its torque has no weight; None for nowhere.
    path : str
        As of the log.
    """

    name: str
    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    notes: tuple[str, ...]
    sha256: str
    own: Rows | None = None
    cutoff: float | None = None
    band: float | None = None
    instrument: Motion | None = None
    lost: int = 0
    breaks: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    hints: tuple[str, ...] = ()
    dwells: np.ndarray | None = None
    path: str = ""

    @property
    def beside(self) -> Samples | None:
        """The samples along the second record of the motion."""
        other = self.instrument
        return None if other is None else replace(self, motion=other, instrument=None)

    @cached_property
    def runs(self) -> list[tuple[int, int]]:
        """Stretches of samples that make outputs without a gap, as (start, stop)."""
        return [(start, stop) for start, stop, _ in self._stretches]

    @cached_property
    def run_outputs(self) -> list[int]:
        """Number of samples after decimation of each of `runs`."""
        return [count for *_, count in self._stretches]

    @cached_property
    def outputs(self) -> int:
        """Number of samples after decimation."""
        return sum(self.run_outputs)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The outputs with which a stretch begins: the first, and those behind a long gap."""
        if not len(self.breaks):
            return (0,)
        kept, d = self.motion.kept, self.decimation
        at = np.arange(len(kept))
        if d is not None:
            runs = [a + d.reach + d.factor * np.arange(n) for a, _, n in self._stretches]
            at = np.concatenate([np.empty(0, int), *runs])
        before = np.searchsorted(kept[at], self.breaks)
        return (0, *(int(k) for k in np.unique(before) if 0 < k < len(at)))

    @cached_property
    def _stretches(self) -> list[tuple[int, int, int]]:
        """First sample and last (exclusive) that outputs draw on, and how many there are."""
        d = self.decimation
        if d is None:
            return [(0, len(self.tau), len(self.tau))]
        kept = self.motion.kept
        breaks = np.flatnonzero(np.diff(kept) > 1) + 1
        low, high = self.own or (0, np.inf)
        out = []
        for start, stop in pairwise([0, *breaks.tolist(), len(kept)]):
            row = int(kept[start]) if stop > start else 0
            centres = [k for k in d.centres(row, row + stop - start) if low <= k < high]
            if centres:
                first = start + centres[0] - row - d.reach
                out.append((first, start + centres[-1] - row + d.reach + 1, len(centres)))
        return out

    @cached_property
    def survey(self) -> Survey:
        """What there is to know of the whole log."""
        n = self.tau.shape[1]
        none, every = np.empty((0, n)), np.ones((0, n), bool)
        # Samples a piece when torque is summed.
        parts = [(p.torque, p.moves) for p in self.pieces(1024)]
        tau = np.concatenate([none, *(x for x, _ in parts)])
        moves = [every, *(np.ones(x.shape, bool) if m is None else m for x, m in parts)]
        where = np.concatenate(moves)
        low, high = (
            f(0, initial=s * np.inf, where=where) for f, s in ((tau.min, 1), (tau.max, -1))
        )
        survey = Survey.of(self.motion, self.own, self.outputs, tau.sum(0), np.stack([low, high]))
        return replace(survey, lost=self.lost, rows=where.sum(0))

    def pieces(self, size: int) -> Iterator[Piece]:
        """Yield pieces of about `size` samples of the motion."""
        d = self.decimation
        if d is None:
            for start in range(0, len(self.tau), size):
                rows = slice(start, start + size)
                yield Piece(self.motion[rows], self.tau[rows], None, 0, self._dwells_in(rows))
            return
        step = max(1, size // d.coarse.factor)
        for start, _, count in self._stretches:
            for first in range(0, count, step):
                last = min(first + step, count)
                begin = start + first * d.factor
                end = begin + (last - 1 - first) * d.factor + 2 * d.reach + 1
                some: slice | np.ndarray = slice(begin, end)
                if d.every > 1:  # a copy, that does not keep what lies between
                    some = np.arange(begin, end, d.every)
                again = 2 * d.coarse.reach + 1 - d.coarse.factor if first else 0
                motion, tau = self.motion[some], self.tau[begin:end]
                if d.every > 1:
                    span = d.every * (motion.t[-1] - motion.t[0]) / (end - 1 - begin)
                    # None is missing between them: they are rows of a log that has no others.
                    motion = replace(motion, span=float(span), kept=motion.kept // d.every)
                yield Piece(motion, tau, d, again, self._dwells_in(some))

    def take(self, rows: slice | np.ndarray) -> Samples:
        """Return some of the samples."""
        other = None if self.instrument is None else self.instrument[rows]
        taken = replace(self, motion=self.motion[rows], tau=self.tau[rows], instrument=other)
        return replace(taken, dwells=self._dwells_in(rows))

    def thin(self, step: int) -> Samples:
        """Return every `step`-th sample, without decimation filter."""
        return replace(self.take(slice(None, None, step)), decimation=None)

    def _dwells_in(self, rows: slice | np.ndarray) -> np.ndarray | None:
        return None if self.dwells is None else self.dwells[rows]

    def output_times(self) -> Array:
        """Return the times of the samples after decimation, (outputs,) [s]."""
        if self.decimation is None:
            return self.motion.t
        d = self.decimation
        at = [start + d.reach + d.factor * np.arange(n) for start, _, n in self._stretches]
        times: Array = self.motion.t[np.concatenate(at)] if at else np.empty(0)
        return times


def prepare_rows(
    robot: Robot, log: Log, origin: int, plan: Plan, own: Rows, *, anywhere: bool = True
) -> Samples:
    """Prepare some rows of a log by a plan.

    Parameters
    ----------
    robot : Robot
    log : Log
        The rows and what the filters draw on at both ends.
    origin : int
        Row of its first sample in the whole log.
    plan : Plan
    own : (int, int)
        Rows of the whole log at which outputs are wanted.
    anywhere : bool
        The loops must close somewhere in these rows.

    Raises
    ------
    LogError, ClosureError
    """
    log = joint_log(robot, plan.mend(log, origin))
    q, dq, ddq = plan.derive(log, origin)
    reach = plan.reach - plan.filter_reach
    part = slice(max(0, own[0] - reach - origin), min(len(log), own[1] + reach - origin))
    try:
        touch = _touch(robot, log)
        touch = None if touch is None else touch[part]
        motion = complete_motion(robot, log.t[part], q[part], dq[part], ddq[part], touch)
    except ClosureError:
        if anywhere:
            raise
        motion = _no_motion(robot, np.arange(part.stop - part.start))
    smooth = plan.smooth_speed(log, origin)
    if smooth is not None:
        motion = replace(motion, smooth_v=smooth[part][motion.kept])
    tau = log.tau[part][motion.kept] - _known_torque(robot, log.name, motion)
    if robot.base is not None and log.base is not None:
        tau = motion.freed(tau + _pushed(robot, motion, log.base[part][motion.kept]))
    dwells = None if plan.dwells is None else plan.dwells.find(log, dq)[part][motion.kept]
    if robot.base is not None:
        dwells = _silent(motion, dwells)
    if log.unmeasured is not None:
        lacking = plan.lacking(log.unmeasured)[part][motion.kept]
        dwells = lacking if dwells is None else dwells | lacking
    lost, breaks = 0, np.empty(0, int)
    if plan.grid is not None:
        apart = plan.grid.left_out(origin, origin + len(log))
        breaks = plan.grid.breaks
        low, high = (min(max(k - origin, 0), len(log)) for k in own)
        lost = int(np.isin(motion.kept + part.start, low + np.flatnonzero(apart[low:high])).sum())
        left = ~apart[part][motion.kept]
        motion, tau = motion[left], tau[left]
        dwells = None if dwells is None else dwells[left]
    rows = ("kept", "dropped", "near_singular")
    moved = {k: getattr(motion, k) + origin + part.start for k in rows}
    motion = replace(motion, **moved, start=log.start)
    samples = Samples(log.name, motion, tau, plan.decimation, (), log.sha256, own, plan.cutoff)
    samples = replace(samples, lost=lost, breaks=breaks, hints=plan.hints, dwells=dwells)
    return replace(samples, band=plan.band, path=log.path)


def _touch(robot: Robot, log: Log) -> Array | None:
    """Return where up is and which contacts may press, (N, 3 + c); None of robots that stand."""
    if robot.base is None or log.base is None:
        return None
    contacts = robot.base.contacts
    flags = log.base[:, AFTER : AFTER + len(contacts)]
    closed = closed_contacts(contacts, log.t, flags)
    return np.hstack([log.base[:, UP], closed])


def _pushed(robot: Robot, motion: Motion, record: Array) -> Array:
    """Return the torque of the actuated joints that measured wrenches make, (N, n)."""
    assert robot.base is not None
    at, tree = AFTER + len(robot.base.contacts), np.zeros((len(motion), robot.nv))
    for k, wrench in enumerate(robot.base.wrenches):
        values = record[:, at + 6 * k : at + 6 * (k + 1)]
        tree += wrench_torque(robot.tree, motion.q, wrench, values)
    return project(robot, motion, tree)


def _silent(motion: Motion, dwells: np.ndarray | None) -> np.ndarray:
    """Return where rows are no data, (N, n) bool: the base never stands, and contacts hide some.

    What a joint at rest supplies is nobody's data, also where the base's rows are made of it.
    """
    n = motion.actuated_q.shape[1]
    found = np.zeros((len(motion), n), bool) if dwells is None else np.array(dwells)
    found[:, :SIX] = False
    return found if motion.silent is None else found | motion.silent


def _known_torque(robot: Robot, name: str, motion: Motion) -> Array:
    """Return the torque that is known beforehand, (N, n)."""
    try:
        return known_torque(robot, motion)
    except RobotError as error:
        raise LogError(f"{name}: {error}") from None


def _no_motion(robot: Robot, rows: np.ndarray) -> Motion:
    """Return the motion of rows at which the loops do not close, as if it had none."""
    n = len(robot.actuated)
    tree, joint, none = np.empty((0, robot.nv)), np.empty((0, n)), np.empty(0, int)
    q, X = np.empty((0, len(robot.home))), np.empty((0, len(robot.dependent), n))
    return Motion(np.empty(0), q, tree, tree, joint, joint, joint, X, none, rows)


def join_motions(motions: Sequence[Motion]) -> Motion:
    """Return motions one after the other."""
    first, none = motions[0], np.empty(0, int)
    rows = [m.each for m in motions]
    known = [name for name in rows[0] if all(name in own for own in rows)]
    joined: dict[str, Any] = {name: np.concatenate([own[name] for own in rows]) for name in known}
    joined.setdefault("smooth_v", None)
    condition = max(m.condition for m in motions)
    return replace(first, **joined, condition=condition, dropped=none, near_singular=none)


def check_left(name: str, left: int, total: int, notes: Sequence[str]) -> None:
    """Refuse a log of which next to nothing is left.

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
