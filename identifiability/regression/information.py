"""`Information`: all that a regression says about its parameters, independent of its length.

The sufficient statistic of the linear model per block of time and per actuator: Gram matrices of
``[W τ]`` (or the rows themselves while they are fewer), over the columns that the actuator can see
and in a basis that makes them well conditioned. A basis is a triangular factor of a subsample of
the actuator's rows, so ``[W τ] basis⁻¹`` has columns of about unit length and right angles, and
nothing is lost by squaring (plain Gram matrices lose half the digits, QR of all rows costs five
times as much). Adding is concatenation of blocks, so chunks, files and processes are one sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.options import at_least, checked
from identifiability.foundation.values import frozen
from identifiability.regression.actuator_blocks import (
    ActuatorBlocks,
    choose_basis,
    hold,
    merge_held,
    stack,
)
from identifiability.regression.regression import Part, Regression, map_parts

#: Blocks of time a log is divided into at most; the bootstrap draws whole blocks.
BLOCKS = 256

#: Rows of the subsample that the bases are made of, at least.
BASIS_ROWS = 4096

#: Samples of that subsample for every column, at least.
ROWS_A_COLUMN = 4


@frozen
class Information:
    """Blocks of ``[W τ]`` by actuator.

    Attributes
    ----------
    columns : tuple of str
        Names of the k columns of W.
    parts : tuple of ActuatorBlocks
        One for each of the n actuators.
    counts : (B,) int
        Samples in each block.
    log : (B,) int
        Which log a block comes from.
    """

    columns: tuple[str, ...]
    parts: tuple[ActuatorBlocks, ...]
    counts: np.ndarray
    log: np.ndarray

    @staticmethod
    def of_rows(columns: Sequence[str], W: Array, tau: Array, log: Array, size: int) -> Information:
        """Return the information of rows in memory.

        Parameters
        ----------
        columns : sequence of str
        W : (N, n, k)
        tau : (N, n) [N·m or N]
        log : (N,) int
            Which log each sample comes from; ascending.
        size : int
            Samples a block; none crosses a log.
        """
        first = np.unique(log, return_index=True)[1]
        ends = [*first[1:], len(log)]
        at = np.array([s for a, b in zip(first, ends, strict=True) for s in range(a, b, size)])
        parts = []
        for a in range(tau.shape[1]):
            rows = np.column_stack([W[:, a], tau[:, a]])
            seen = np.flatnonzero(rows[:, :-1].any(0))
            basis = choose_basis(rows, seen)
            Z = rows[:, [*seen, -1]] @ _inverse(basis)
            blocks = stack([hold(block) for block in np.split(Z, at[1:])])
            parts.append(ActuatorBlocks(seen, basis, blocks))
        counts = np.diff([*at, len(log)])
        return Information(tuple(columns), tuple(parts), counts, np.asarray(log)[at])

    @property
    def size(self) -> int:
        """Number of columns k."""
        return len(self.columns)

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.counts.sum())

    @property
    def actuators(self) -> int:
        """Number of actuators n."""
        return len(self.parts)

    @property
    def rows(self) -> int:
        """Number of rows, samples × actuators."""
        return self.samples * self.actuators

    @property
    def nbytes(self) -> int:
        """Size of what is held [bytes]."""
        return sum(p.blocks.nbytes + p.basis.nbytes for p in self.parts)

    @cached_property
    def _common(self) -> tuple[Array, tuple[Array, ...]]:
        """A basis of all actuators' rows, and how each one's own coordinates turn into it."""
        wide = [part.widen(self.size) for part in self.parts]
        short = max(0, self.size + 1 - sum(map(len, wide)))
        Q, basis = np.linalg.qr(np.vstack([*wide, np.zeros((short, self.size + 1))]))
        return basis, tuple(np.split(Q, np.cumsum([len(w) for w in wide]))[: len(wide)])

    @property
    def basis(self) -> Array:
        """Upper triangular, (k + 1, k + 1), with ``[W τ] = Z basis`` for all rows."""
        return self._common[0]

    def squares(self, z: Array) -> Array:
        """Return each actuator's sum of squares of ``Z z``, (n,) or (n, m).

        Parameters
        ----------
        z : (k + 1,) or (k + 1, m)
        """
        own = [Q @ z for Q in self._common[1]]
        pairs = zip(own, self.parts, strict=True)
        return np.array([np.einsum("i...,i...->...", u, p.total @ u) for u, p in pairs])

    def blocks(self, weights: Array) -> Array:
        """Return ``Zᵀ Z`` of each block, actuators weighted, (B, k + 1, k + 1)."""
        out = np.zeros((len(self.counts), self.size + 1, self.size + 1))
        for weight, part, Q in zip(weights, self.parts, self._common[1], strict=True):
            out += part.grams(np.sqrt(weight) * Q)
        return out

    def total(self, weights: Array | None = None) -> Array:
        """Return ``Zᵀ Z`` of all blocks, actuators weighted, (k + 1, k + 1)."""
        weights = np.ones(self.actuators) if weights is None else weights
        triples = zip(weights, self.parts, self._common[1], strict=True)
        total: Array = sum(w * (Q.T @ p.total @ Q) for w, p, Q in triples)
        return total

    def factor(self, weights: Array | None = None) -> Array:
        """Return R (k + 1, k + 1), upper triangular, with ``RᵀR = [W τ]ᵀ [W τ]``."""
        eigenvalues, vectors = np.linalg.eigh(self.total(weights))
        root = np.sqrt(np.maximum(eigenvalues, 0.0))[:, None] * vectors.T
        return triangular_factor(root @ self.basis)

    def reduce(self, M: Array, columns: Sequence[str], held: Array | None = None) -> Information:
        """Return the information of the columns ``W M``, with torque ``τ - W held``.

        Parameters
        ----------
        M : (k, m)
            Zeroed columns are left out, tied ones added.
        columns : sequence of str
            Names of the m new columns.
        held : (k,), optional
            Parameter values that are held fixed.
        """
        k, m = M.shape
        map_ = np.zeros((k + 1, m + 1))
        map_[:k, :m] = M
        map_[k, m] = 1.0
        if held is not None:
            map_[:k, m] = -held
        parts = tuple(part.reduce(map_) for part in self.parts)
        return Information(tuple(columns), parts, self.counts, self.log)

    def select(self, columns: Sequence[int]) -> Information:
        """Return the information about some columns, the others held at zero."""
        names = [self.columns[c] for c in columns]
        return self.reduce(np.eye(self.size)[:, list(columns)], names)

    def take(self, kept: np.ndarray) -> Information:
        """Return some of the blocks."""
        parts = tuple(part.take(kept) for part in self.parts)
        return replace(self, parts=parts, counts=self.counts[kept], log=self.log[kept])

    def merge(self, at: np.ndarray) -> Information:
        """Return blocks that each hold those from one of `at` up to the next."""
        parts = tuple(part.merge(at) for part in self.parts)
        counts = np.add.reduceat(self.counts, at)
        return replace(self, parts=parts, counts=counts, log=self.log[at])

    def __add__(self, other: Information) -> Information:
        """Return the information of both; blocks and logs stay apart."""
        if self.columns != other.columns:
            raise ValueError("only information about the same columns can be added")
        later = other.log + (self.log.max(initial=-1) + 1)
        return Information(
            self.columns,
            tuple(a.join(b) for a, b in zip(self.parts, other.parts, strict=True)),
            np.concatenate([self.counts, other.counts]),
            np.concatenate([self.log, later]),
        )


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
        Blocks of time over all logs, at most; each holds consecutive samples of one log.
    engine : Engine, optional
        Where stretches of long logs are worked on; here without.
    progress : callable(int, int), optional
    """
    names = tuple(p.name for p in regression.parameters)
    factors = _survey(regression)
    size = max(1, -(-regression.outputs // blocks))
    while True:
        seen = np.array([R[:, :-1].any(0) for R in factors])
        bases = [choose_basis(R, np.flatnonzero(s)) for R, s in zip(factors, seen, strict=True)]
        gather = partial(_gather_part, seen=seen, bases=bases, size=size)
        gathered = _Gathered()
        missed = np.zeros(seen.shape)
        for found, unseen in map_parts(gather, regression, engine, progress):
            gathered.extend(found)
            missed += unseen
        if not missed.any():
            break
        # In the subsample these columns did not act.
        lengths = [np.diag(np.append(np.sqrt(squares), 0.0)) for squares in missed]
        factors = [np.vstack(pair) for pair in zip(factors, lengths, strict=True)]
    parts = tuple(
        ActuatorBlocks(np.flatnonzero(s), S, stack(held))
        for s, S, held in zip(seen, bases, zip(*gathered.held, strict=True), strict=True)
    )
    logs = np.array([log for log, _ in gathered.edges], int)
    return Information(names, parts, np.array(gathered.counts), logs)


class _Gathered:
    """Blocks in order of time: (log, block), what is held by actuator, samples."""

    def __init__(self) -> None:
        self.edges: list[tuple[int, int]] = []
        self.held: list[list[Array]] = []
        self.counts: list[int] = []

    def add(self, edge: tuple[int, int], held: list[Array], count: int) -> None:
        """Add samples to the last block, or as a new one."""
        if self.edges and self.edges[-1] == edge:
            pairs = zip(self.held[-1], held, strict=True)
            self.held[-1] = [merge_held(one, other) for one, other in pairs]
            self.counts[-1] += count
        else:
            self.edges.append(edge)
            self.held.append(held)
            self.counts.append(count)

    def extend(self, later: _Gathered) -> None:
        """Add blocks of later samples."""
        for block in zip(later.edges, later.held, later.counts, strict=True):
            self.add(*block)


def _gather_part(
    part: Part, seen: np.ndarray, bases: Sequence[Array], size: int
) -> tuple[_Gathered, Array]:
    """Return the blocks of a part, and the squared lengths (n, k) of columns not in `seen`."""
    out = _Gathered()
    missed = np.zeros(seen.shape)
    own = [(np.flatnonzero(s), _inverse(S)) for s, S in zip(seen, bases, strict=True)]
    for chunk in part.chunks():
        log, start, W, tau = chunk.log, chunk.start, chunk.W, chunk.tau
        if not seen.all():
            missed[~seen] += np.square(W[:, ~seen]).sum(0)
        Z = [np.column_stack([W[:, a, c], tau[:, a]]) @ inv for a, (c, inv) in enumerate(own)]
        at = 0
        while at < len(tau):
            block = (start + at) // size
            stop = min(len(tau), (block + 1) * size - start)
            out.add((log, block), [hold(rows[at:stop]) for rows in Z], stop - at)
            at = stop
    return out, missed


def _survey(regression: Regression) -> list[Array]:
    """Return a factor (…, k + 1) of evenly spaced rows of each actuator.

    The rows are taken before any decimation: a basis need not be exact.
    """
    n, k = len(regression.robot.actuated), len(regression.parameters)
    wanted = max(BASIS_ROWS // n, ROWS_A_COLUMN * (k + 1))
    step = max(1, sum(s.survey.kept for s in regression.samples) // wanted)
    thin = replace(regression, samples=tuple(s.thin(step) for s in regression.samples))
    factors = [np.zeros((0, k + 1))] * n
    for _, _, W, tau in thin.chunks():
        for a in range(n):
            rows = np.vstack([factors[a], np.column_stack([W[:, a], tau[:, a]])])
            acts = rows.any(0)
            R = triangular_factor(rows[:, acts])
            factors[a] = np.zeros((len(R), k + 1))
            factors[a][:, acts] = R
    return factors


def _inverse(basis: Array) -> Array:
    inverse: Array = solve_triangular(basis, np.eye(len(basis)))
    return inverse
