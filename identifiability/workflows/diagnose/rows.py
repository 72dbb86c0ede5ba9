"""`Rows`: the regression of a diagnosis after decimation: torque, model columns, dictionary.

A diagnosis asks hundreds of questions of the same few thousand rows, so they are built once:
columns of the base model, then one or more columns for every candidate (family, place, shape).
Most candidates act in one joint: of the columns of an arm five in six entries are zero, and are
neither stored nor filtered. Of motion that only judges few columns are ever looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from identifiability.effects import Effect, Family, Part, Placed, Span
from identifiability.effects.effect import measure_spans
from identifiability.effects.functions import has_session
from identifiability.estimation.noise import JointRuns, Runs, find_runs
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.samples import Piece
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot
from identifiability.workflows.diagnose.known_values import KnownValues, NearFile

#: What a model has where: families with their places.
Present = Collection[tuple[str, str]]
#: Why a family is not tried where it is.
HAS = "the model has it already"
#: What a candidate's columns depend on along some logs: family, place, kinds and shape.
Key = tuple[str, str, tuple[str, ...], float | None]
#: Samples that columns are computed of at a time, at least; and in units of what a decimation
#: filter draws on beside them, so that it costs little more than the samples themselves.
PIECE, REACHES = 4096, 12
#: Columns that are filtered together.
TOGETHER = 64

#: Pieces of each log, as long as it is there.
_KNOWN: WeakKeyDictionary[Samples, tuple[Piece, ...]] = WeakKeyDictionary()

#: Torque (N,) by joint and column, where it is not zero everywhere.
Entries = dict[tuple[int, int], Array]


@frozen
class Candidate:
    """One effect that could be missing: a family at a place with a shape.

    Attributes
    ----------
    family : Family
    place : str
        Joint, motor or body.
    shape : float
        nan for families without one.
    kinds : tuple of str
        Kinds of its parameters.
    effect : Effect
    columns : tuple of int
        In `Rows.D`.
    positive : bool
        Whether physics forbids negative levels.
    """

    family: Family
    place: str
    shape: float
    kinds: tuple[str, ...]
    effect: Effect
    columns: tuple[int, ...]
    positive: bool = False

    @property
    def group(self) -> tuple[str, str]:
        """Family and place: what is named."""
        return self.family.name, self.place

    @cached_property
    def slot(self) -> tuple[str, str, tuple[str, ...]]:
        """Family, place and kinds: what a model has once, whatever its shape."""
        return self.family.name, self.place, () if self.family.flexible else self.kinds

    @cached_property
    def key(self) -> Key:
        """What its columns depend on along some logs, whatever numbers they have."""
        return (*self.group, self.kinds, None if np.isnan(self.shape) else self.shape)

    @property
    def part(self) -> Part:
        """The candidate as a part of an effect."""
        return Part(self.effect, self.place, self.kinds)


def is_body(c: Candidate) -> bool:
    """Whether a candidate is a body by itself, with mass, moments and inertia."""
    return c.family.name == "payload" and len(c.columns) == len(GROUPED_KINDS)


@frozen
class Refusal:
    """A family that makes no sense at a place, and why."""

    family: str
    place: str
    reason: str


@frozen
class Rows:
    """Decimated rows of one or more logs.

    Attributes
    ----------
    tau : (N, n) [N·m or N]
        Torque that the model columns should explain.
    X : (N, n, b)
        Base model, refitted at every step; of a fixed one only values that have errors.
    D : Dictionary
        Columns of the candidates, (N, n, c).
    t : (N,) [s]
    log : (N,) int
        Which log a row comes from.
    runs : sequence of (start, stop)
        Stretches without gaps.
    q, dq, ddq : (N, n)
        Motion of the actuated joints, filtered like the columns.
    measured, raw : (N, n) [N·m or N]
        Measured torque, all of it: filtered like the columns, and as it was measured.
    session : (N,) or None [s]
        Time of the session, where logs share a clock.
    moves : (N, n) bool or None
        Where torque of each joint is data; elsewhere all columns and torque are zero. None where
        all is.
    root : (d, b) or None
        What is known beforehand of the values of the model: observations of zero, each in units of
        its standard deviation. None where nothing is, or they are no question at all.
    """

    tau: Array
    X: Array
    D: Dictionary
    t: Array
    log: np.ndarray
    runs: Runs
    q: Array
    dq: Array
    ddq: Array
    measured: Array
    raw: Array
    root: Array | None = None
    session: Array | None = None
    moves: np.ndarray | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.tau)

    @property
    def joints(self) -> int:
        """Number of actuated joints."""
        return int(self.tau.shape[1])

    @cached_property
    def data(self) -> np.ndarray:
        """Where torque of each joint is data, (N, n) bool."""
        return np.ones(self.tau.shape, bool) if self.moves is None else self.moves

    @cached_property
    def counts(self) -> np.ndarray:
        """Rows of each joint that are data, one at least, (n,)."""
        rows: np.ndarray = np.maximum(self.data.sum(0), 1)
        return rows

    @property
    def silent(self) -> int:
        """Number of rows of all joints that are no data."""
        return int(self.data.size - self.data.sum())

    @cached_property
    def moving(self) -> JointRuns:
        """Stretches without gaps at which torque of each joint is data."""
        return JointRuns.of(self.runs, self.data)

    def columns(self, chosen: Sequence[Candidate]) -> Array:
        """Return the columns of the model with some candidates, (N, n, b + …)."""
        at = [k for c in chosen for k in c.columns]
        return np.concatenate([self.X, self.D.take(at)], axis=2)

    def along(self, j: int) -> dict[str, Array]:
        """Return what the residual of joint j may depend on, each (N,)."""
        return {
            "velocity": self.dq[:, j],
            "position": self.q[:, j],
            "acceleration": self.ddq[:, j],
            "load": self.measured[:, j],
            "time": self.t,
            "log": self.log,
            **({} if self.session is None else {"session": self.session}),
        }


def list_candidates(
    robot: Robot,
    families: Sequence[Family],
    present: Present,
    motions: Sequence[Motion],
    *,
    fixed: bool,
) -> tuple[list[Candidate], list[Refusal]]:
    """Return every candidate, and the families that make no sense somewhere.

    Parameters
    ----------
    robot : Robot
    families : sequence of Family
    present : collection of (family, place)
        What the model has already.
    motions : sequence of Motion
        Shapes are chosen from the range that was moved through.
    fixed : bool
        Whether the model keeps the values of the robot file; then what it has may be wrong too.
    """
    spans = measure_spans(robot, motions)
    out: list[Candidate] = []
    refused: list[Refusal] = []
    for family in families:
        reason = _refuse(robot, family, present, fixed)
        if reason:
            refused.append(Refusal(family.name, "", reason))
            continue
        for place in family.places(robot):
            known = (family.name, place) in present
            # What is added to a level that is there may be of either sign.
            free = known or bool(family.effect.supersedes)
            reason = HAS if known and not fixed else family.refuse(robot, place)
            if reason:
                refused.append(Refusal(family.name, place, reason))
            else:
                start = out[-1].columns[-1] + 1 if out else 0
                span = spans.get(place, Span(place, 1.0, 1.0, robot=robot))
                out += _at_place(robot, family, span, start, free)
    return out, refused


def _refuse(robot: Robot, family: Family, present: Present, fixed: bool) -> str:
    """Return why a family makes no sense anywhere; empty if it does."""
    places = family.places(robot)
    if not places:
        return "the robot has no place for it"
    if not fixed and all((family.name, place) in present for place in places):
        return HAS
    if family.fixed_only and not fixed and any(name == "rigid_body" for name, _ in present):
        return "every mass is refitted, so it cannot be told from the bodies' own parameters"
    return ""


def _at_place(robot: Robot, family: Family, span: Span, column: int, free: bool) -> list[Candidate]:
    place, out = span.joint, []
    for shape in family.grid(span):
        effect = family.at(shape, place)
        there = {p.kind: p.nonnegative for p in effect.parameters(robot) if p.owner == place}
        reached = there if family.reached is None else family.reached(effect, robot, span)
        kinds = tuple(kind for kind in there if kind in reached)[: 1 if family.alike else None]
        for chosen in [(kind,) for kind in kinds] if family.separate else [kinds]:
            at = tuple(range(column, column + len(chosen)))
            positive = not free and all(there[kind] for kind in chosen)
            out.append(Candidate(family, place, shape, chosen, effect, at, positive))
            column += len(chosen)
    return out


def number(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates whose columns are the first ones, in their order."""
    ends = np.cumsum([len(c.columns) for c in candidates]).tolist()
    return [
        replace(c, columns=tuple(range(end - len(c.columns), end)))
        for c, end in zip(candidates, ends, strict=True)
    ]


@frozen
class Table:
    """Rows of some logs to which columns of candidates are added, each computed once.

    Attributes
    ----------
    robot : Robot
    samples : tuple of Samples
    bare : Rows
        Without columns of candidates.
    """

    robot: Robot
    samples: tuple[Samples, ...]
    bare: Rows

    @staticmethod
    def of(
        structure: Structure,
        samples: Sequence[Samples],
        fixed: bool = False,
        known: KnownValues | None = None,
        near: NearFile | None = None,
    ) -> Table:
        """Return the rows of some logs, without candidates; arguments are those of `build_rows`."""
        regression = replace(structure.regression(samples, keep=True), echo=None, instruments=None)
        chunks = [
            (np.full(len(c.tau), c.log), c.W.copy(), c.tau, c.raw, c.data)
            for part in regression.parts()
            for c in part.chunks()
        ]
        log, X, tau, raw, data = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
        target, root = tau, None
        if fixed and known is None:
            target, X = tau - X @ structure.nominal_base, X[:, :, :0]
        elif fixed and known is not None:
            target, X, root = tau - X @ known.values, X[:, :, known.uncertain], known.root
        elif near is not None:
            target, root = tau - X @ near.values, near.root
        D = Dictionary(len(tau), tau.shape[1], 0)
        t = np.concatenate([s.output_times() for s in samples])
        q, dq, ddq = np.split(np.concatenate([_states(s) for s in samples]), 3, axis=1)
        session = None
        if has_session([s.motion for s in samples]):
            session = np.concatenate([s.output_times() + (s.motion.start or 0.0) for s in samples])
        bare = Rows(target, X, D, t, log, find_runs(samples), q, dq, ddq, tau, raw, root)
        return Table(structure.robot, tuple(samples), replace(bare, session=session, moves=data))

    def rows(self, candidates: Sequence[Candidate], *, later: bool = False) -> Rows:
        """Return the rows with the columns of some candidates, by the numbers that these have.

        Parameters
        ----------
        candidates : sequence of Candidate
            Whose columns are those of the dictionary, all of them.
        later : bool
            Whether columns are computed only when they are looked at.
        """
        owner = {k: c for c in candidates for k in c.columns}

        def ask(columns: Sequence[int]) -> Entries:
            wanted = list({id(owner[k]): owner[k] for k in columns}.values())
            self._compute(wanted)
            asked = set(columns)
            return {
                (j, c.columns[k]): x
                for c in wanted
                for (j, k), x in self._known[c.key].items()
                if c.columns[k] in asked
            }

        D = Dictionary(len(self.bare), self.bare.joints, len(owner), ask)
        if not later:
            D.require(range(len(owner)))
        return replace(self.bare, D=D)

    def extend(self, rows: Rows, more: Sequence[Candidate]) -> Rows:
        """Return rows whose dictionary has the columns of further candidates behind its own."""
        self._compute(more)
        D = rows.D
        for c in more:
            D.width = max(D.width, c.columns[-1] + 1)
            for (j, k), x in self._known[c.key].items():
                D.add(j, c.columns[k], x)
        return rows

    def _compute(self, candidates: Iterable[Candidate]) -> None:
        """Compute the columns of candidates that were not asked for before."""
        missing = {c.key: c for c in candidates if c.key not in self._known}
        ends = np.cumsum([0, *(len(c.columns) for c in missing.values())]).tolist()
        parts = [
            (c.part, range(start, start + len(c.columns)))
            for c, start in zip(missing.values(), ends, strict=False)
        ]
        owner = [(key, k) for key, c in missing.items() for k in range(len(c.columns))]
        self._known.update((key, {}) for key in missing)
        for (j, at), x in compute_entries(self.robot, parts, self.samples).items():
            key, k = owner[at]
            self._known[key][j, k] = x

    @cached_property
    def _known(self) -> dict[Key, Entries]:
        """Return what was computed: torque by joint and column among a candidate's own."""
        return {}


def _states(samples: Samples) -> Array:
    """Return position, velocity and acceleration of the actuated joints at the outputs, (N, 3n)."""
    at, m = samples.output_times(), samples.motion
    both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
    return np.stack([np.interp(at, m.t, column) for column in both.T], axis=1)


@frozen
class Block:
    """The columns that act in one joint.

    Attributes
    ----------
    columns : (k,) int
        Rising.
    values : (N, k) [N·m or N per unit]
    """

    columns: np.ndarray
    values: Array


@dataclass
class Dictionary:
    """Columns of candidates along some rows.

    Attributes
    ----------
    rows, joints, width : int
        N, n and the number of columns c.
    ask : callable(columns) -> Entries, optional
        Says what columns are that were not looked at yet, where they act; without it they are zero.
    """

    rows: int
    joints: int
    width: int
    ask: Callable[[Sequence[int]], Entries] | None = None
    _columns: list[dict[int, Array]] = field(init=False)
    _known: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._columns = [{} for _ in range(self.joints)]

    @staticmethod
    def of(columns: Array) -> Dictionary:
        """Return the dictionary of columns (N, n, c) that are there."""
        acts: np.ndarray = np.any(columns, axis=0)

        def ask(asked: Sequence[int]) -> Entries:
            found = [(j, k) for k in asked for j in np.flatnonzero(acts[:, k]).tolist()]
            return {(j, k): columns[:, j, k] for j, k in found}

        N, n, c = columns.shape
        return Dictionary(N, n, c, ask)

    def block(self, joint: int) -> Block:
        """Return all columns that act in a joint."""
        at, own = self.columns(joint), self._columns[joint]
        values = np.empty((self.rows, len(at)))
        for place, k in enumerate(at.tolist()):
            values[:, place] = own[k]
        return Block(at, values)

    def columns(self, joint: int) -> np.ndarray:
        """Return the numbers of all columns that act in a joint, rising."""
        self.require(range(self.width))
        return np.array(sorted(self._columns[joint]), int)

    def acting(self, joint: int, columns: Iterable[int]) -> Array:
        """Return some columns in one joint in their order, (N, k)."""
        at = [*columns]
        self.require(at)
        out, own = np.zeros((self.rows, len(at))), self._columns[joint]
        for place, k in enumerate(at):
            if k in own:
                out[:, place] = own[k]
        return out

    def take(self, columns: Iterable[int]) -> Array:
        """Return some columns in their order, (N, n, k)."""
        at = [*columns]
        self.require(at)
        out = np.zeros((self.rows, self.joints, len(at)))
        for j, own in enumerate(self._columns):
            for place, k in enumerate(at):
                if k in own:
                    out[:, j, place] = own[k]
        return out

    def rms(self) -> Array:
        """Return the root mean square of each column in each joint, (n, c)."""
        self.require(range(self.width))
        out = np.zeros((self.joints, self.width))
        for j, own in enumerate(self._columns):
            for k, x in own.items():
                out[j, k] = np.sqrt(np.mean(x**2))
        return out

    def add(self, joint: int, column: int, values: Array) -> None:
        """Take what a further column is in a joint."""
        self._columns[joint][column] = values
        self._known.add(column)

    def require(self, columns: Iterable[int]) -> None:
        """Ask for columns that were not looked at yet."""
        if isinstance(columns, range) and len(columns) == len(self._known) == self.width:
            return
        missing = sorted(set(columns) - self._known)
        self._known.update(missing)
        if missing and self.ask is not None:
            for (j, k), x in self.ask(missing).items():
                self._columns[j][k] = x


def compute_entries(
    robot: Robot, parts: Sequence[tuple[Part, Sequence[int]]], samples: Sequence[Samples]
) -> Entries:
    """Return the torque of parts of effects along logs, after decimation, without what is zero.

    Parameters
    ----------
    robot : Robot
    parts : sequence of (Part, columns)
        With the column that each of its parameters has.
    samples : sequence of Samples
    """
    layout = _lay_out(robot, parts)
    rows = sum(s.outputs for s in samples)
    pieces = [piece for s in samples for piece in _pieces(s)]
    longest = max((len(piece.motion) for piece in pieces), default=0)
    widest = max((width for _, width, _ in layout), default=0)
    # Each column of each joint in one piece, for it is asked for, and filtered, alone; what acts is
    # taken out and zero again, so that new memory is not asked for of every effect.
    space = np.zeros((len(robot.actuated), widest, longest))
    entries: Entries = {}
    start = 0
    for piece in pieces:
        outputs, samples_here = len(piece.motion.t[piece.at]), len(piece.motion)
        found: Entries = {}
        for effect, width, columns in layout:
            W = space[:, :width, :samples_here]
            effect.fill(robot, piece.motion, W.transpose(2, 0, 1))
            if piece.motion.free is not None:
                W[:] = piece.motion.freed(W.transpose(2, 0, 1)).transpose(1, 2, 0)
            acts: np.ndarray = np.einsum("jkt,jkt->jk", W, W) != 0  # quicker than to ask each
            for own, column in columns:
                for j in np.flatnonzero(acts[:, own]).tolist():
                    found[j, column] = W[j, own].copy()
            W[acts] = 0.0
            if len(found) >= TOGETHER:
                _write(entries, piece, found, start, rows)
                found = {}
        _write(entries, piece, found, start, rows)
        start += outputs
    return entries


def _pieces(samples: Samples) -> tuple[Piece, ...]:
    """Return the pieces of a log that columns are computed of, the same ones whenever it is asked.

    So what is known of a motion as long as it is there (`nominal.once`) is known then, too.
    """
    if samples not in _KNOWN:
        d = samples.decimation
        size = PIECE if d is None else max(PIECE, REACHES * d.coarse.reach)
        _KNOWN[samples] = tuple(samples.pieces(size))
    return _KNOWN[samples]


def _write(entries: Entries, piece: Piece, found: Entries, start: int, rows: int) -> None:
    """Write what effects are along a piece, decimated, where its outputs begin in all rows."""
    every = list(found.items())
    for first in range(0, len(every), TOGETHER):
        part = every[first : first + TOGETHER]
        down = piece.down(np.stack([piece.silenced(x, at[0]) for at, x in part]).T)
        for (at, _), values in zip(part, down.T, strict=True):
            if at not in entries:
                entries[at] = np.zeros(rows)
            entries[at][start : start + len(values)] = piece.masked(values, at[0])


def _lay_out(
    robot: Robot, parts: Sequence[tuple[Part, Sequence[int]]]
) -> list[tuple[Effect, int, list[tuple[int, int]]]]:
    """Return each effect once: its number of columns, and which of them go where."""
    out: dict[int, tuple[Effect, int, list[tuple[int, int]]]] = {}
    for part, columns in parts:
        effect, own = Placed([part]).layout(robot)[0]
        if id(effect) not in out:
            out[id(effect)] = (effect, len(effect.parameters(robot)), [])
        out[id(effect)][2].extend(zip(own, columns, strict=True))
    return list(out.values())
