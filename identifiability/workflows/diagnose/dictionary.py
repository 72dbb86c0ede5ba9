"""`Dictionary`: the columns of all candidates, kept where they act, computed at once or when asked.

Most candidates act in one joint: of the columns of an arm five in six entries are zero. They are
neither stored nor filtered. Of motion that only judges few columns are ever looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from identifiability.effects import Effect, Part, Placed
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.samples import Piece
from identifiability.robot import Robot

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


@frozen
class Stacked:
    """Columns of candidates in rows of all joints, one joint below the other.

    They are held where they act: over all rows those of many joints would fill the memory.

    Attributes
    ----------
    blocks : tuple of Block
        Of each joint, in whatever rows.
    width : int
        Number of columns c.
    known : int
        Rows below all joints in which no column acts.
    """

    blocks: tuple[Block, ...]
    width: int
    known: int = 0

    def __getitem__(self, key: tuple[slice, int | Sequence[int]]) -> Array:
        """Return some columns ``[:, columns]`` over all rows, (R, k), or one, (R,)."""
        at = np.atleast_1d(np.asarray(key[1], int))
        out = np.zeros((self._ends[-1] + self.known, len(at)))
        for rows, here, own in self._acting(at):
            out[rows, here] = own
        return out if np.ndim(key[1]) else out[:, 0]

    def times(self, columns: Sequence[int], other: Array) -> Array:
        """Return the products of some columns with those of others over all rows (R, m), (k, m)."""
        out = np.zeros((len(columns), other.shape[1]))
        for rows, here, own in self._acting(np.asarray(columns, int)):
            out[here] += own.T @ other[rows]
        return out

    def gram(self, columns: Sequence[int]) -> Array:
        """Return the products of some columns with one another, (k, k)."""
        out = np.zeros((len(columns), len(columns)))
        for _, here, own in self._acting(np.asarray(columns, int)):
            out[np.ix_(here, here)] += own.T @ own
        return out

    @cached_property
    def lengths(self) -> Array:
        """Return the length of each column, (c,)."""
        squares = np.zeros(self.width)
        for block in self.blocks:
            squares[block.columns] += np.sum(block.values**2, axis=0)
        return np.sqrt(squares)

    @cached_property
    def _ends(self) -> list[int]:
        ends: list[int] = np.cumsum([0, *(len(b.values) for b in self.blocks)]).tolist()
        return ends

    def _acting(self, at: np.ndarray) -> Iterator[tuple[slice, np.ndarray, Array]]:
        """Yield rows of a joint, which of some columns act there, and these (·, k) in its rows."""
        key = at.tobytes()
        if key not in self._found:
            self._found[key] = self._find(at)
        for rows, here, block, where in self._found[key]:
            yield rows, here, block.values[:, where]

    def _find(self, at: np.ndarray) -> list[tuple[slice, np.ndarray, Block, np.ndarray]]:
        """Return rows of a joint, which of some columns act there, its block and where in it."""
        where, out = self._places[:, at], []
        acts: np.ndarray = where >= 0
        for j in np.flatnonzero(acts.any(1)).tolist():
            here = np.flatnonzero(acts[j])
            rows = slice(self._ends[j], self._ends[j + 1])
            out.append((rows, here, self.blocks[j], where[j, here]))
        return out

    @cached_property
    def _found(self) -> dict[bytes, list[tuple[slice, np.ndarray, Block, np.ndarray]]]:
        """Return what `_find` found: each candidate is asked for many times."""
        return {}

    @cached_property
    def _places(self) -> np.ndarray:
        """Return where each column is among those of each joint, −1 where it does not act."""
        out = np.full((len(self.blocks), self.width), -1)
        for own, block in zip(out, self.blocks, strict=True):
            own[block.columns] = np.arange(len(block.columns))
        return out


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

    def require(self, columns: Iterable[int]) -> None:
        """Ask for columns that were not looked at yet."""
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
        outputs, samples_here = len(piece.tau[piece.at]), len(piece.motion)
        found: Entries = {}
        for effect, width, columns in layout:
            W = space[:, :width, :samples_here]
            effect.fill(robot, piece.motion, W.transpose(2, 0, 1))
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
        size = PIECE if d is None else max(PIECE, REACHES * d.reach)
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
