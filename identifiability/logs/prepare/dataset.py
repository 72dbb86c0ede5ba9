"""`Dataset`: the rows of a log, made ready for the regression, in memory or when asked for.

Motion of every joint, torque, how much each row counts, and what was done; a `Survey` is what there
is to know of it as a whole, and parts of a log add up. A log that does not fit in memory is
prepared anew, stretch by stretch, whenever its rows are gone through.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property, reduce
from itertools import pairwise
from operator import add
from typing import Any

import numpy as np

from identifiability.foundation.engines import Engine, Serial, Steps
from identifiability.foundation.errors import ClosureError, LogError, RobotError
from identifiability.foundation.findings import Finding, of_key
from identifiability.foundation.names import Array
from identifiability.foundation.options import checked
from identifiability.foundation.rounding import percent
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.base import AFTER, UP
from identifiability.logs.log import join_logs
from identifiability.logs.prepare.preparation import Plan, Preparation, joint_log, make_plan
from identifiability.logs.rules import RULES
from identifiability.logs.signals import is_constant, never_moves
from identifiability.logs.tables import is_parquet
from identifiability.robot import KnownRobot, Motion, Robot, complete_motion
from identifiability.robot.closure import known_torque, project
from identifiability.robot.floating import SIX, closed_contacts, wrench_torque

# `Survey`: what there is to know of a prepared log as a whole; parts of a log add up.
#
# Here it is said once whether logs have anything to explain (`find_signal`, `explain_silence`):
# ε_RA has no denominator where they have not, and nothing is fitted to them.


#: Rows of a log, from the first to the last (exclusive).
Rows = tuple[int, int]

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

    def notes(self, name: str, joints: Sequence[str], total: int) -> list[Finding]:
        """Return what was done with the samples of a log with `total` of them."""
        notes, first = [], ", ".join(str(k + 1) for k in self.first_dropped)
        if self.dropped:
            first += " …" if self.dropped > LISTED else ""
            notes.append(Finding("unclosed", name, rows=self.dropped, all=total, where=first))
        if self.singular:
            at = {"first": self.first_singular[0] + 1, "condition": self.condition}
            notes.append(Finding("singular", name, rows=self.singular, **at))
        if self.lost:
            notes.append(Finding("beside_gaps", name, rows=self.lost, all=total))
        rest = dict(zip(joints, (self.outputs - self.rows).tolist(), strict=True))
        rest = {j: k for j, k in rest.items() if k > 0}
        if rest:
            where = ", ".join(f"{j} {percent(k / self.outputs)}" for j, k in rest.items())
            columns = tuple(f"{j}.tau" for j in rest)
            rows = sum(rest.values())
            notes.append(Finding("standing", name, rows=rows, columns=columns, where=where))
        return notes


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


# `Dataset`: a log made ready for the regression: motion of every joint, torque, and how.


@frozen
class Piece:
    """Consecutive samples, with what the decimation filter draws on at both ends.

    Attributes
    ----------
    motion : Motion
        Of N samples.
    tau : (N, n) [N·m or N]
    decimation : Decimation or None
    weight : (N, n)
        How much torque of each joint counts, from 0 for no data to 1.
    """

    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    weight: Array

    def down(self, x: Array) -> Array:
        """Return x (N, …) low-passed and decimated, if there is any decimation."""
        return x if self.decimation is None else self.decimation.apply(x)

    @cached_property
    def _lost(self) -> np.ndarray | None:
        """Where torque is no data, (N, n) bool; None for nowhere."""
        lost = self.weight <= 0
        return lost if lost.any() else None

    @property
    def moves(self) -> np.ndarray:
        """Where, at its outputs, torque of each joint is data, (m, n) bool."""
        found: np.ndarray = self.weight[self.at] > 0
        return found

    @property
    def torque(self) -> Array:
        """Torque at its outputs by the root of its weight, (m, n)."""
        tau = np.array(self.tau)
        return self.weighed(self.down(self.silenced(tau)))

    @property
    def raw(self) -> Array:
        """The same as it was measured, not low-passed, (m, n)."""
        return self.weighed(np.array(self.tau[self.at]))

    def silenced(self, x: Array, joint: int | None = None) -> Array:
        """Return inputs (N, n, …), or (N, …) of a joint, that are zero where torque is no data.

        Torque and columns alike, before a filter draws on them: what is low-passed is then related
        as it is where the joint moves, however near. They are written over.
        """
        if self._lost is not None and self.decimation is not None:
            x[self._lost if joint is None else self._lost[:, joint]] = 0.0
        return x

    def weighed(self, x: Array, joint: int | None = None) -> Array:
        """Return rows (m, n, …), or (m, …) of a joint, by the root of their weight.

        They are written over.
        """
        weight = self.weight[self.at] if joint is None else self.weight[self.at][:, joint]
        if not (weight == 1).all():
            x *= np.sqrt(weight).reshape(*weight.shape, *(1,) * (x.ndim - weight.ndim))
        return x

    @property
    def at(self) -> slice:
        """The samples of the motion at which the outputs are."""
        d = self.decimation
        return slice(None) if d is None else slice(d.reach, len(self.motion) - d.reach, d.factor)


@frozen
class Dataset:
    """A prepared log. Make one with `prepare_log`.

    Attributes
    ----------
    name : str
    motion : Motion
        Of every joint, at the samples whose loops close; of a log that is too long for memory at
        some of them, evenly spaced.
    tau : (N, n) [N·m or N]
        Measured torque at the same samples, less what is known beforehand.
    weight : (N, n)
        How much it counts, from 0, where it is no data because the joint stands or nobody measured
        it, to 1.
    decimation : Decimation or None
        Applied alike to regressor and torque.
    notes : tuple of str
        How the derivatives were made and what was dropped, for the report; findings among them
        are its `ledger`.
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
    path : str
        As of the log.
    stretches : tuple of Stretch
        What all rows of a long log are prepared from; none where they are in memory.
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
    path: str = ""
    weight: Array = field(default_factory=lambda: np.ones((1, 1)))
    stretches: tuple[Stretch, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        """Count every row alike where nobody says otherwise."""
        if self.weight.shape != self.tau.shape:
            object.__setattr__(self, "weight", np.broadcast_to(self.weight, self.tau.shape))

    @property
    def ledger(self) -> tuple[Finding, ...]:
        """What was done with its rows and columns when it was prepared."""
        return tuple(of_key(self.notes))

    @property
    def long(self) -> bool:
        """Whether its rows do not fit in memory, and are prepared when they are gone through."""
        return bool(self.stretches)

    def divided(self) -> list[Dataset]:
        """Return what is worked on one by one: the stretches of a long log, or all in memory."""
        if not self.long:
            return [self]
        none = self.take(slice(0))  # small to send, large to compute
        return [replace(none, stretches=(stretch,)) for stretch in self.stretches]

    @property
    def beside(self) -> Dataset | None:
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
        return self.survey.outputs if self.long else sum(self.run_outputs)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The outputs with which a stretch begins: the first, and those behind a long gap."""
        if not len(self.breaks):
            return (0,)
        if self.long:
            before = np.cumsum([0, *(s.outputs for s in self.divided())])[:-1]
            at = before[np.isin([s.first for s in self.stretches], self.breaks)]
            return (0, *(int(k) for k in np.unique(at) if 0 < k < self.outputs))
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
        if self.long:
            every: list[Survey] = [s.survey for s in self.stretches]
            return reduce(add, every)
        n = self.tau.shape[1]
        # Samples a piece when torque is summed.
        parts = [(p.torque, p.moves) for p in self.pieces(1024)]
        tau = np.concatenate([np.empty((0, n)), *(x for x, _ in parts)])
        where = np.concatenate([np.empty((0, n), bool), *(m for _, m in parts)])
        low, high = (
            f(0, initial=s * np.inf, where=where) for f, s in ((tau.min, 1), (tau.max, -1))
        )
        survey = Survey.of(self.motion, self.own, self.outputs, tau.sum(0), np.stack([low, high]))
        return replace(survey, lost=self.lost, rows=where.sum(0))

    def pieces(self, size: int) -> Iterator[Piece]:
        """Yield pieces of about `size` samples of the motion.

        Raises
        ------
        LogError
            If the file of a long log changed meanwhile.
        """
        if self.long:
            for stretch in self.stretches:
                for part in stretch.parts():
                    yield from part.pieces(size)
            return
        d = self.decimation
        if d is None:
            for start in range(0, len(self.tau), size):
                rows = slice(start, start + size)
                yield Piece(self.motion[rows], self.tau[rows], None, self.weight[rows])
            return
        step = max(1, size // d.factor)
        for start, _, count in self._stretches:
            for first in range(0, count, step):
                begin, few = start + first * d.factor, min(step, count - first)
                rows = slice(begin, begin + (few - 1) * d.factor + 2 * d.reach + 1)
                yield Piece(self.motion[rows], self.tau[rows], d, self.weight[rows])

    def take(self, rows: slice | np.ndarray) -> Dataset:
        """Return some of the samples in memory."""
        other = None if self.instrument is None else self.instrument[rows]
        motion, tau, weight = self.motion[rows], self.tau[rows], self.weight[rows]
        taken = replace(self, motion=motion, tau=tau, weight=weight)
        return replace(taken, instrument=other, stretches=())

    def thin(self, step: int) -> Dataset:
        """Return about every `step`-th sample of all, of those in memory; without decimation."""
        rows = self.stretches[-1].last if self.long else len(self.tau)
        every = max(1, round(step * len(self.tau) / max(rows, 1)))
        return replace(self.take(slice(None, None, every)), decimation=None)

    def output_times(self, at: slice | np.ndarray = slice(None)) -> Array:
        """Return the times of samples after decimation [s], all by default; of long logs about."""
        if self.long:
            span = self.survey.stop - self.survey.start
            return self.survey.start + span * np.arange(self.outputs)[at] / self.outputs
        if self.decimation is None:
            return self.motion.t[at]
        d = self.decimation
        rows = [start + d.reach + d.factor * np.arange(n) for start, _, n in self._stretches]
        times: Array = self.motion.t[np.concatenate([np.empty(0, int), *rows])[at]]
        return times


@frozen
class Stretch:
    """Consecutive rows of a long log and all that it takes to prepare them: one task of a pass.

    Attributes
    ----------
    robot : Robot
    log : Log
    plan : Plan
    first, last : int
        Rows [first, last).
    piece : int
        Samples that are prepared at a time.
    survey : Survey
        What there is to know of them; None while it is made.
    """

    robot: Robot
    log: Log
    plan: Plan
    first: int
    last: int
    piece: int
    survey: Any = None

    def parts(self) -> Iterator[Dataset]:
        """Yield the rows prepared, some thousand at a time.

        Raises
        ------
        LogError
            If the file changed meanwhile.
        """
        reach, rows = self.plan.reach, (self.first, self.last)
        for first, last, origin, log in self.log.pieces(self.piece, reach, *rows):
            own = (first, last)
            yield prepare_rows(self.robot, log, origin, self.plan, own, anywhere=False)


def prepare_rows(
    robot: Robot, log: Log, origin: int, plan: Plan, own: Rows, *, anywhere: bool = True
) -> Dataset:
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
    dwells = None if plan.dwells is None else plan.dwells.find(dq)[part][motion.kept]
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
    return Dataset(
        log.name,
        motion,
        tau,
        plan.decimation,
        (),
        log.sha256,
        own=own,
        cutoff=plan.cutoff,
        band=plan.band,
        lost=lost,
        breaks=breaks,
        hints=plan.hints,
        path=log.path,
        weight=np.ones((1, 1)) if dwells is None else 1.0 - dwells,
    )


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


# From a `Log` to a `Dataset`.


#: Samples that are prepared at a time, at least; and in units of what filters draw on.
PIECE, MARGINS = 8_192, 4

#: Stretches that a log is divided into, at most, and the fewest samples of one.
STRETCHES, SHORTEST = 64, 65_536


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
        Where the stretches of a long log are surveyed; by default here.
    progress : callable(int, int), optional

    Raises
    ------
    LogError, ClosureError
    """
    how = how or Preparation()
    plan = make_plan(robot, log, how)
    if log.long:
        found = _prepare_long(robot, log, plan, engine or Serial(), progress)
    else:
        found = prepare_rows(robot, log, 0, plan, (0, len(log)))
    survey = found.survey
    notes = [*plan.notes, *survey.notes(log.name, robot.joints, len(log))]
    check_left(log.name, survey.kept, len(log), notes)
    while plan.factor > 1 and found.outputs < RULES.fewest:
        if how.decimate is not None or log.long:
            raise LogError(
                f"{log.name} is too short to be decimated by {plan.factor}: of its {len(log)} "
                f"samples fewer than {RULES.fewest} are left; give a longer log or a smaller "
                "decimation."
            )
        plan = replace(plan, factor=plan.factor - 1)
        found = replace(found, decimation=plan.decimation)
    if plan.decimation is not None:
        what = {"factor": plan.factor, "rate": 1.0 / (plan.step * plan.factor)}
        notes.append(Finding("decimated", log.name, rows=len(log), columns=("all",), **what))
    return replace(found, notes=tuple(notes), own=None)


def _prepare_long(
    robot: Robot, log: Log, plan: Plan, engine: Engine, progress: Steps | None
) -> Dataset:
    """Return a log divided into stretches that were surveyed, with some samples of it."""
    if robot.closed:  # before a long time is spent on loops that close nowhere
        # Samples in the middle of each window whose loops are tried first.
        middles = [(a + b) // 2 for a, b in signals.spread_windows(len(log))]
        tried = joint_log(robot, join_logs([log.rows(m, m + 64) for m in middles]))
        complete_motion(robot, tried.t, tried.q, 0 * tried.q, 0 * tried.q)
    stretches = divide(robot, log, plan)
    found = list(engine.map(survey_stretch, stretches, progress=progress))
    surveyed = (replace(s, survey=own) for s, (own, _) in zip(stretches, found, strict=True))
    return replace(_join([part for _, part in found]), stretches=tuple(surveyed))


def divide(robot: Robot, log: Log, plan: Plan) -> tuple[Stretch, ...]:
    """Return the stretches of a log; they depend on the file alone, not on who works on them."""
    assert log.file is not None
    rows, table, most = len(log), log.file.table, STRETCHES
    if is_parquet(table.path):
        # Rows inside a group are reached by reading all that come before them.
        groups = [row for row, _ in table.pieces]
        # Times a log that may be read to reach the rows of its stretches, before these
        # become fewer.
        if max(b - a for a, b in pairwise(groups)) * STRETCHES > 4 * rows:
            most = max(8, min(STRETCHES, 2 * (len(groups) - 1)))
    count = min(most, max(1, rows // SHORTEST))
    edges = np.linspace(0, rows, count + 1).astype(int).tolist()
    if plan.grid is not None:
        edges = sorted({*edges, *plan.grid.breaks.tolist()})
    piece = max(PIECE, MARGINS * plan.reach)
    return tuple(Stretch(robot, log, plan, a, b, piece) for a, b in pairwise(edges))


def survey_stretch(stretch: Stretch) -> tuple[Survey, Dataset]:
    """Return the survey of a stretch, and some of its samples."""
    # Samples of the whole log that are kept, evenly spaced.
    step = max(1, len(stretch.log) // 4096)
    surveys, shown = [], []
    for part in stretch.parts():
        assert part.own is not None
        surveys.append(part.survey)
        kept = part.motion.kept
        own = (kept % step == 0) & (kept >= part.own[0]) & (kept < part.own[1])
        shown.append(part.take(np.flatnonzero(own)))
    return reduce(add, surveys), _join(shown)


def _join(parts: Sequence[Dataset]) -> Dataset:
    """Return rows one after the other."""
    motion = join_motions([s.motion for s in parts if len(s.motion)] or [parts[0].motion])
    tau, weight = (np.concatenate([getattr(s, k) for s in parts]) for k in ("tau", "weight"))
    return replace(parts[0], motion=motion, tau=tau, weight=weight)
