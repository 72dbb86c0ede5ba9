"""`Part` of a regression: a log, or a stretch of a long one, computed chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import repeat
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import Prepared, Stretch
from identifiability.logs.prepare.samples import Piece
from identifiability.regression.model import Model
from identifiability.regression.windows import inside
from identifiability.robot import Robot

#: Samples a chunk: the regressor of one chunk stays in the processor's cache.
CHUNK = 1024

#: Samples a piece in units of what a decimation filter draws on beside them, and what the columns
#: of such a piece may take [bytes].
REACHES, PIECE_BYTES = 4, 32_000_000


@frozen
class Chunk:
    """Consecutive rows of a regression.

    Attributes
    ----------
    log : int
        Which log they come from.
    start : int
        Output of that log at which they begin.
    W : (m, n, p)
    tau, raw : (m, n) [N·m or N]
        Torque, low-passed like W where that was, and as it was measured.
    t : (m,) [s]
    velocity : (m, n) [rad/s or m/s]
        Of the actuated joints.
    instruments : (m, n, p) or None
        What stands for W where W itself is noisy.
    moves : (m, n) bool or None
        Where torque of each joint is data; elsewhere rows of W, instruments and torque are zero.
        None where all is.
    """

    log: int
    start: int
    W: Array
    tau: Array
    raw: Array
    t: Array
    velocity: Array
    instruments: Array | None = None
    moves: np.ndarray | None = None

    @property
    def data(self) -> np.ndarray:
        """Where torque of each joint is data, (m, n) bool."""
        return np.ones(self.tau.shape, bool) if self.moves is None else self.moves

    @property
    def wide(self) -> Array:
        """Instruments, if there are any, then W, (m, n, 2p) or (m, n, p)."""
        V = self.instruments
        return self.W if V is None else np.concatenate([V, self.W], axis=2)

    def inside(self, windows: np.ndarray) -> list[Chunk]:
        """Return copies of its rows that lie in windows of the log, (w, 2), a chunk for each."""
        found = []
        for _, rows in inside(windows, self.start, self.start + len(self.t)):
            V = None if self.instruments is None else self.instruments[rows].copy()
            W, tau, raw = self.W[rows].copy(), self.tau[rows].copy(), self.raw[rows].copy()
            t, velocity = self.t[rows].copy(), self.velocity[rows].copy()
            moves = None if self.moves is None else self.moves[rows].copy()
            start = self.start + rows.start
            found.append(Chunk(self.log, start, W, tau, raw, t, velocity, V, moves))
        return found


class Kept:
    """Chunks of a part that were computed once: those of its windows; None before."""

    def __init__(self) -> None:
        self.chunks: list[Chunk] | None = None


class Memory:
    """Chunks of logs in memory for several regressions, each as long as its log is there."""

    def __init__(self) -> None:
        self._kept: WeakKeyDictionary[Samples, Kept] = WeakKeyDictionary()

    def of(self, samples: Samples) -> Kept:
        """Return where the chunks of a log are kept."""
        return self._kept.setdefault(samples, Kept())

    def __reduce__(self) -> tuple[type[Memory], tuple[()]]:
        """Send none of it about."""
        return Memory, ()


class Buffer:
    """Where the rows (N, n, p) of one piece after the other are written."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._rows = np.empty((0, *shape))
        self._held: Piece | None = None

    def ready(self, piece: Piece, before: Piece | None) -> tuple[Array, int]:
        """Return where to write a piece, and how many rows of it the one before left there."""
        rows, again = self._rows, 0
        if len(rows) < len(piece.motion):
            self._rows = np.empty((len(piece.motion), *rows.shape[1:]))
        if before is not None and before is self._held:
            again, end = piece.again, len(before.motion)
            self._rows[:again] = rows[end - again : end]
        self._held = piece
        return self._rows, again


@frozen
class Part:
    """A log of a regression, or a stretch of a long one: small to send, large to compute.

    Attributes
    ----------
    robot : Robot
    model : Model
    columns : (b,) int or None
    log : int
        Which log of the regression.
    start : int
        Output of that log at which the part begins.
    samples : Samples, LongSamples or Stretch
    instruments : the same, or None
    windows : (w, 2) int
        Outputs [start, stop) of the log that are looked at one by one.
    kept : Kept or None
        Where those of them are kept, once they were computed; None if they take too much memory.
    dwelling : bool
        Whether rows are computed where torque is no data, too.
    """

    robot: Robot
    model: Model
    columns: np.ndarray | None
    log: int
    start: int
    samples: Prepared | Stretch
    instruments: Prepared | Stretch | None
    windows: np.ndarray
    kept: Kept | None
    dwelling: bool = False

    def keep(self, chunks: list[Chunk] | None) -> None:
        """Keep the chunks of its windows that were computed elsewhere."""
        if self.kept is not None:
            self.kept.chunks = chunks

    @property
    def remote(self) -> bool:
        """Whether it is worth sending to another process."""
        return isinstance(self.samples, Stretch)

    def chunks(self, size: int = CHUNK) -> Iterator[Chunk]:
        """Yield its chunks; each one's W is overwritten by the next, unless all are kept."""
        if self.kept is not None and self.kept.chunks is not None and self._covered:
            yield from self._numbered(self.kept.chunks)
            return
        done = []
        for chunk in self._computed(size):
            own = [] if self.kept is None else chunk.inside(self.windows)
            done += own
            yield own[0] if own and self._covered else chunk
        self.keep(done)

    def _numbered(self, chunks: list[Chunk]) -> Iterator[Chunk]:
        """Yield chunks of a regression in which the log may have another number."""
        for chunk in chunks:
            yield chunk if chunk.log == self.log else replace(chunk, log=self.log)

    def shown(self) -> Iterator[Chunk]:
        """Yield the chunks of its windows alone, from where they are kept, if they are."""
        if self.kept is not None and self.kept.chunks is not None:
            yield from self._numbered(self.kept.chunks)
            return
        for chunk in self._computed(CHUNK, windows=self.windows):
            yield from chunk.inside(self.windows)

    @property
    def is_kept(self) -> bool:
        """Whether chunks of its windows are kept."""
        return self.kept is not None and self.kept.chunks is not None

    @property
    def is_shown(self) -> bool:
        """Whether any window reaches into it, or it is empty."""
        count = self.samples.outputs
        return not count or bool(inside(self.windows, self.start, self.start + count))

    @property
    def _covered(self) -> bool:
        """Whether one window reaches over all of it."""
        stop = self.start + self.samples.outputs
        return bool(np.any((self.windows[:, 0] <= self.start) & (self.windows[:, 1] >= stop)))

    def _computed(self, size: int, windows: np.ndarray | None = None) -> Iterator[Chunk]:
        """Yield its chunks, or those that reach into windows; the next one overwrites W."""
        start = self.start
        own, others = self._pieces(self.samples, size), self._pieces(self.instruments, size)
        for (piece, regressor), (_, instruments) in zip(own, others, strict=False):
            t, first = piece.motion.t[piece.at], start
            start += len(t)
            if windows is not None and not inside(windows, first, start):
                continue
            W, V = regressor(), instruments()
            if V is not None and V.shape != W.shape:
                raise ValueError("instruments need as many samples as the log that they stand for")
            velocity, moves = piece.motion.actuated_v[piece.at], piece.moves
            if self.dwelling:
                piece = replace(piece, dwells=None)  # noqa: PLW2901 - all of it is asked for
            W, V = piece.masked(W), None if V is None else piece.masked(V)
            yield Chunk(self.log, first, W, piece.torque, piece.raw, t, velocity, V, moves)

    def _pieces(
        self, samples: Prepared | Stretch | None, size: int
    ) -> Iterator[tuple[Any, Callable[[], Any]]]:
        """Yield pieces and what computes the regressor of their outputs, over the one before."""
        if samples is None:
            yield from repeat((None, lambda: None))
            return
        widths = self.model.widths(self.robot)
        shape = (len(self.robot.actuated), sum(widths))
        buffer, before = Buffer(shape), None
        if isinstance(samples, Samples) and samples.decimation is not None:
            # Beside few samples a strong filter would draw on many more, for each piece anew.
            size = min(max(size, REACHES * samples.decimation.reach), max(size, most_rows(shape)))
        for piece in samples.pieces(size):
            yield piece, partial(self._regressor, piece, before, buffer, widths)
            before = piece

    def _regressor(
        self, piece: Piece, before: Piece | None, buffer: Buffer, widths: Sequence[int]
    ) -> Array:
        out, again = buffer.ready(piece, before)
        W = self.model.regressor(self.robot, piece.motion, out, widths, again)
        W = W if self.dwelling else piece.silenced(W)
        if self.columns is None:
            return piece.down(W)
        if most_rows(W.shape[1:]) >= CHUNK:
            return piece.down(np.take(W, self.columns, axis=2))
        # Of many joints these would be hundreds of megabytes before they are decimated.
        return np.stack([piece.down(own[:, self.columns]) for own in W.swapaxes(0, 1)], axis=1)


def most_rows(shape: tuple[int, int]) -> int:
    """Return how many samples of so many joints and columns (n, p) a large piece has."""
    return PIECE_BYTES // (8 * shape[0] * shape[1])
