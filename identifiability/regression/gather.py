"""Gather the `Information` of a regression, chunk by chunk, here or on workers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial, reduce
from itertools import groupby
from operator import add, attrgetter
from typing import Annotated

import numpy as np
from scipy.linalg.blas import dtrmm

from identifiability.foundation.engines import Engine, Steps
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.options import at_least, checked
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.information import (
    ActuatorBlocks,
    Information,
    choose_basis,
    fill,
    hold,
    invert_basis,
    merge_kept,
)
from identifiability.regression.regression import Chunk, LogPart, Regression, map_parts

#: Blocks of time a log is divided into at most; the bootstrap draws whole blocks.
BLOCKS = 256
#: Blocks that would take more [bytes] are fewer, down to so many: robots of many joints.
LARGEST, FEWEST = 2**30, 32


@checked
def gather_information(
    regression: Regression,
    blocks: Annotated[int, at_least(1)] = BLOCKS,
    *,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> Information:
    """Compress a regression.

    Parameters
    ----------
    regression : Regression
    blocks : int
        Blocks of time over all logs, at most; each holds consecutive samples of one log, and none
        reaches across a long gap.
    engine : Engine, optional
        Where stretches of long logs are worked on; here without.
    progress : callable(int, int), optional
    """
    names = tuple(p.name for p in regression.parameters)
    factors = _survey(regression)
    room = LARGEST // (8 * max(sum(len(R) ** 2 for R in factors), 1))
    size = max(1, -(-regression.outputs // min(blocks, max(room, FEWEST))))
    edges = [_block_edges(samples, size) for samples in regression.samples]
    count, longest = sum(map(len, edges)), min(size, max(s.outputs for s in regression.samples))
    while True:
        seen = np.array([R[:, :-1].any(0) for R in factors])
        bases = [choose_basis(R, np.flatnonzero(s)) for R, s in zip(factors, seen, strict=True)]
        gather = partial(_gather_part, seen=seen, bases=bases, edges=edges)
        missed = np.zeros(seen.shape)
        held = [np.zeros((count, min(longest, len(S)), len(S))) for S in bases]
        sums = [np.zeros((count, len(S))) for S in bases]
        counts, logs = np.zeros(count, int), np.zeros(count, int)
        data = np.zeros((count, len(bases)), int)
        todo = list(regression.parts())
        for part in todo:
            if part.remote:  # what is kept is not sent about
                part.keep([])
        pieces = _pieces(todo, map_parts(gather, todo, engine, progress), missed)
        for b, piece in enumerate(_join(pieces)):
            logs[b], counts[b], data[b] = piece.at[0], piece.count, piece.data
            for a, (one, total) in enumerate(zip(piece.held, piece.sums, strict=True)):
                fill(held[a][b], one)
                sums[a][b] = total
        if not missed.any():
            break
        # In the subsample these columns did not act.
        lengths = [np.diag(np.append(np.sqrt(squares), 0.0)) for squares in missed]
        factors = [np.vstack(pair) for pair in zip(factors, lengths, strict=True)]
    found = zip(seen, bases, held, sums, strict=True)
    parts = tuple(ActuatorBlocks(np.flatnonzero(s), *rest) for s, *rest in found)
    has = regression.instruments is not None
    return Information(names, parts, counts, data, logs, has)


def _block_edges(samples: Dataset, size: int) -> Array:
    """Return where blocks of a log begin; none reaches across a long gap."""
    ends = (*samples.starts[1:], samples.outputs)
    pairs = zip(samples.starts, ends, strict=True)
    return np.concatenate([np.arange(a, b, size) for a, b in pairs])


@frozen
class _Piece:
    """Samples of one block: log and number of the block, what is held by actuator, how many.

    `sums` are those of the rows, by actuator, and `data` how many of these count (n,).
    """

    at: tuple[int, int]
    held: list[Array]
    sums: list[Array]
    count: int
    data: np.ndarray

    def __add__(self, later: _Piece) -> _Piece:
        pairs = zip(self.held, later.held, strict=True)
        held = [merge_kept(one, other) for one, other in pairs]
        sums = [one + other for one, other in zip(self.sums, later.sums, strict=True)]
        return _Piece(self.at, held, sums, self.count + later.count, self.data + later.data)


def _join(pieces: Iterable[_Piece]) -> Iterator[_Piece]:
    """Yield blocks of consecutive pieces, one at a time: all of them may be large."""
    for _, same in groupby(pieces, attrgetter("at")):
        yield reduce(add, same)


#: Blocks of a part, squared lengths (n, k) of columns that were not expected, and what is kept of
#: it where it was gone through elsewhere.
_Found = tuple[Iterable[_Piece], Array, list[Chunk]]


def _pieces(parts: Sequence[LogPart], found: Iterable[_Found], missed: Array) -> Iterator[_Piece]:
    for part, (pieces, unseen, kept) in zip(parts, found, strict=True):
        yield from pieces
        missed += unseen
        if part.remote:
            part.keep(kept)


def _gather_part(
    part: LogPart, seen: np.ndarray, bases: Sequence[Array], edges: Sequence[Array]
) -> _Found:
    """Return the blocks of a part, and what columns not in `seen` are.

    Both are whole once the blocks were gone through, which are made one at a time.
    """
    missed = np.zeros(seen.shape)
    into = [(np.flatnonzero(s), invert_basis(S)) for s, S in zip(seen, bases, strict=True)]

    def pieces() -> Iterator[_Piece]:
        for chunk in part.chunks():
            W, tau, moves, start = chunk.wide, chunk.tau, chunk.data, chunk.start
            if not seen.all():
                missed[~seen] += np.einsum("nak,nak->ak", W, W)[~seen]
            rows = [np.column_stack([W[:, a, c], tau[:, a]]) for a, (c, _) in enumerate(into)]
            # A triangular factor takes half of a product's time.
            Z = [
                dtrmm(1.0, inv, x, side=1, overwrite_b=1)
                for x, (_, inv) in zip(rows, into, strict=True)
            ]
            at, own_edges = 0, edges[chunk.log]
            while at < len(tau):
                block = int(np.searchsorted(own_edges, start + at, "right")) - 1
                end = own_edges[block + 1] if block + 1 < len(own_edges) else np.inf
                stop = int(min(len(tau), end - start))
                own = [rows[at:stop] for rows in Z]
                sums, data = [rows.sum(0) for rows in own], moves[at:stop].sum(0)
                found = [hold(rows) for rows in own]
                yield _Piece((chunk.log, block), found, sums, stop - at, data)
                at = stop

    blocks = _join(pieces())
    if not part.remote:
        return blocks, missed, []
    return list(blocks), missed, part.kept or []


def _survey(regression: Regression) -> list[Array]:
    """Return a factor (…, k + 1) of evenly spaced rows of each actuator.

    Where not all are taken, they are so before any decimation: a basis need not be exact.
    """
    n = len(regression.robot.actuated)
    width = len(regression.parameters) * (1 if regression.instruments is None else 2)
    # Rows of the subsample that the bases are made of, at least.
    # Samples of that subsample for every column, at least.
    wanted = max(4096 // n, 4 * (width + 1))
    step = max(1, sum(s.survey.kept for s in regression.samples) // wanted)
    factors = [np.zeros((0, width + 1))] * n
    # Of few samples these are all: their columns are kept for the pass that is to come.
    few = regression if step == 1 else regression.thin(step)
    for part in few.parts(whole=True):
        for chunk in part.chunks():
            wide = chunk.wide
            for a in range(n):
                own = np.column_stack([wide[:, a], chunk.tau[:, a]])
                rows = np.vstack([factors[a], own])
                acts = rows.any(0)
                R = triangular_factor(rows[:, acts])
                factors[a] = np.zeros((len(R), width + 1))
                factors[a][:, acts] = R
    return factors
