"""`Dictionary`: the columns of all candidates, kept where they act, computed at once or when asked.

Most candidates act in one joint: of the columns of an arm five in six entries are zero. They are
neither stored nor filtered. Of motion that only judges few columns are ever looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from identifiability.effects import Effect, Part, Placed
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.samples import Piece
from identifiability.robot import Robot

#: Samples that columns are computed of at a time, at least; and in units of what a decimation
#: filter draws on beside them, so that it costs little more than the samples themselves.
PIECE, REACHES = 1024, 4
#: Columns that are filtered together.
TOGETHER = 64

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
        rows = np.cumsum([0, *(len(b.values) for b in self.blocks)])
        out = np.zeros((rows[-1] + self.known, len(at)))
        for start, stop, block in zip(rows[:-1], rows[1:], self.blocks, strict=True):
            here = np.flatnonzero(np.isin(at, block.columns))
            out[start:stop, here] = block.values[:, np.searchsorted(block.columns, at[here])]
        return out if np.ndim(key[1]) else out[:, 0]


@dataclass
class Dictionary:
    """Columns of candidates along some rows.

    Attributes
    ----------
    rows, joints, width : int
        N, n and the number of columns c.
    ask : callable(columns) -> Entries, optional
        Computes columns that were not computed yet; without it all were.
    """

    rows: int
    joints: int
    width: int
    ask: Callable[[Sequence[int]], Entries] | None = None
    _blocks: list[Block] = field(default_factory=list)
    _known: set[int] = field(default_factory=set)

    @staticmethod
    def of(columns: Array) -> Dictionary:
        """Return the dictionary of columns (N, n, c) that are there."""
        N, n, c = columns.shape
        entries = {(j, k): columns[:, j, k] for j in range(n) for k in range(c)}
        return Dictionary.of_entries(N, n, c, {at: x for at, x in entries.items() if x.any()})

    @staticmethod
    def of_entries(rows: int, joints: int, width: int, entries: Entries) -> Dictionary:
        """Return a dictionary with some entries; all others are zero."""
        found = Dictionary(rows, joints, width)
        found._add(range(width), entries)
        return found

    @staticmethod
    def later(
        rows: int, joints: int, width: int, ask: Callable[[Sequence[int]], Entries]
    ) -> Dictionary:
        """Return a dictionary whose columns are computed when they are looked at."""
        found = Dictionary(rows, joints, width, ask)
        found._add((), {})
        return found

    def block(self, joint: int) -> Block:
        """Return all columns that act in a joint."""
        self._require(range(self.width))
        return self._blocks[joint]

    def take(self, columns: Iterable[int]) -> Array:
        """Return some columns in their order, (N, n, k)."""
        at = np.fromiter(columns, int)
        self._require(at.tolist())
        out = np.zeros((self.rows, self.joints, len(at)))
        for j, block in enumerate(self._blocks):
            here = np.flatnonzero(np.isin(at, block.columns))
            out[:, j, here] = block.values[:, np.searchsorted(block.columns, at[here])]
        return out

    def entries(self, columns: Sequence[int], numbers: Sequence[int]) -> Entries:
        """Return some columns where they act, under other numbers."""
        self._require(columns)
        number = dict(zip(columns, numbers, strict=True))
        return {
            (j, number[k]): block.values[:, at]
            for j, block in enumerate(self._blocks)
            for at, k in enumerate(block.columns.tolist())
            if k in number
        }

    def extend(self, other: Dictionary, columns: Sequence[int]) -> Dictionary:
        """Return the columns of both: some of another dictionary follow its own."""
        width = self.width

        def ask(asked: Sequence[int]) -> Entries:
            own, new = [k for k in asked if k < width], [k for k in asked if k >= width]
            theirs = [columns[k - width] for k in new]
            return {**self.entries(own, own), **other.entries(theirs, new)}

        return Dictionary.later(self.rows, self.joints, width + len(columns), ask)

    def rms(self) -> Array:
        """Return the root mean square of each column in each joint, (n, c)."""
        out = np.zeros((self.joints, self.width))
        for j in range(self.joints):
            block = self.block(j)
            out[j, block.columns] = np.sqrt(np.mean(block.values**2, axis=0))
        return out

    def _require(self, columns: Iterable[int]) -> None:
        missing = sorted(set(columns) - self._known)
        if missing and self.ask is not None:
            self._add(missing, self.ask(missing))

    def _add(self, columns: Iterable[int], entries: Entries) -> None:
        self._known.update(columns)
        old = self._blocks or [
            Block(np.empty(0, int), np.empty((self.rows, 0))) for _ in range(self.joints)
        ]
        new: list[list[int]] = [[] for _ in range(self.joints)]
        for j, k in entries:
            new[j].append(k)
        self._blocks = []
        for j, (block, more) in enumerate(zip(old, new, strict=True)):
            every = np.concatenate([block.columns, np.array(more, int)])
            order = np.argsort(every)
            values = np.empty((self.rows, len(every)))
            for place, at in enumerate(order.tolist()):
                fresh = at - len(block.columns)
                values[:, place] = (
                    block.values[:, at] if fresh < 0 else entries.pop((j, more[fresh]))
                )
            self._blocks.append(Block(every[order], values))


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
    entries: Entries = {}
    start = 0
    for piece in (piece for s in samples for piece in s.pieces(_size(s))):
        outputs = len(piece.tau[piece.at])
        found: Entries = {}
        for effect, width, columns in layout:
            W = np.zeros((len(piece.motion), len(robot.actuated), width))
            effect.fill(robot, piece.motion, W)
            for own, column in columns:
                w = W[:, :, own]
                for j in np.flatnonzero(np.einsum("nj,nj->j", w, w)).tolist():
                    found[j, column] = w[:, j]
            if len(found) >= TOGETHER:
                _write(entries, piece, found, start, rows)
                found = {}
        _write(entries, piece, found, start, rows)
        start += outputs
    return entries


def _size(samples: Samples) -> int:
    """Return how many samples of a log columns are computed of at a time."""
    d = samples.decimation
    return PIECE if d is None else max(PIECE, REACHES * d.reach)


def _write(entries: Entries, piece: Piece, found: Entries, start: int, rows: int) -> None:
    """Write what effects are along a piece, decimated, where its outputs begin in all rows."""
    if not found:
        return
    down = piece.down(np.stack(list(found.values()), axis=1))
    for at, values in zip(found, down.T, strict=True):
        if at not in entries:
            entries[at] = np.zeros(rows)
        entries[at][start : start + len(values)] = values


def _lay_out(
    robot: Robot, parts: Sequence[tuple[Part, Sequence[int]]]
) -> list[tuple[Effect, int, list[tuple[int, int]]]]:
    """Return each effect once: its number of columns, and which of them go where."""
    out: dict[int, tuple[Effect, int, list[tuple[int, int]]]] = {}
    for part, columns in parts:
        effect, own = Placed([part]).layout(robot)[0]
        width = len(effect.parameters(robot))
        entry = out.setdefault(id(effect), (effect, width, []))
        entry[2].extend(zip(own, columns, strict=True))
    return list(out.values())
