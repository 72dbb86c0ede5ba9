"""`Information`: all that a regression says about its parameters, independent of its length.

The sufficient statistic of the linear model per block of time and per actuator: Gram matrices of
``[W τ]``, held in a basis that makes them well conditioned. The basis is a triangular factor of a
subsample of the rows, so ``[W τ] basis⁻¹`` has columns of about unit length and right angles, and
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
from identifiability.regression.regression import Part, Regression, map_parts

#: Blocks of time a log is divided into at most; the bootstrap draws whole blocks.
BLOCKS = 256

#: Rows of the subsample that the basis is made of.
BASIS_ROWS = 4096

#: Directions that the subsample does not excite get this share of their column's length.
FLOOR = 1e-6


@frozen
class Information:
    """Gram matrices of ``[W τ]`` in a basis.

    Attributes
    ----------
    columns : tuple of str
        Names of the k columns of W.
    basis : (k + 1, k + 1)
        Upper triangular; ``[W τ] = Z basis``.
    gram : (B, n, k + 1, k + 1)
        ``Zᵀ Z`` of each block of time and actuator.
    counts : (B,) int
        Samples in each block.
    log : (B,) int
        Which log a block comes from.
    """

    columns: tuple[str, ...]
    basis: Array
    gram: Array
    counts: np.ndarray
    log: np.ndarray

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
        return int(self.gram.shape[1])

    @property
    def rows(self) -> int:
        """Number of rows, samples × actuators."""
        return self.samples * self.actuators

    @cached_property
    def per_actuator(self) -> Array:
        """Gram matrices of each actuator over all blocks, (n, k + 1, k + 1)."""
        total: Array = self.gram.sum(0)
        return total

    def total(self, weights: Array | None = None) -> Array:
        """Return the Gram matrix in the basis, actuators weighted, (k + 1, k + 1)."""
        if weights is None:
            weights = np.ones(self.actuators)
        total: Array = np.einsum("a,aij->ij", weights, self.per_actuator)
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
        Q, basis = np.linalg.qr(self.basis @ map_)
        return Information(tuple(columns), basis, Q.T @ self.gram @ Q, self.counts, self.log)

    def select(self, columns: Sequence[int]) -> Information:
        """Return the information about some columns, the others held at zero."""
        names = [self.columns[c] for c in columns]
        return self.reduce(np.eye(self.size)[:, list(columns)], names)

    def rebase(self, basis: Array) -> Information:
        """Return the same information in another basis."""
        change = self.basis @ solve_triangular(basis, np.eye(len(basis)))
        return Information(
            self.columns, basis, change.T @ self.gram @ change, self.counts, self.log
        )

    def __add__(self, other: Information) -> Information:
        """Return the information of both; blocks and logs stay apart."""
        if self.columns != other.columns:
            raise ValueError("only information about the same columns can be added")
        other = other.rebase(self.basis)
        later = other.log + (self.log.max(initial=-1) + 1)
        return Information(
            self.columns,
            self.basis,
            np.concatenate([self.gram, other.gram]),
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
    basis = choose_basis(regression)
    size = max(1, -(-regression.outputs // blocks))
    edges: list[tuple[int, int]] = []  # (log, block within the log)
    grams: list[Array] = []
    counts: list[int] = []
    gather = partial(_gather_part, basis=basis, size=size)
    for part in map_parts(gather, regression, engine, progress):
        for edge, gram, count in part:
            if edges and edges[-1] == edge:
                grams[-1] = grams[-1] + gram
                counts[-1] += count
            else:
                edges.append(edge)
                grams.append(gram)
                counts.append(count)
    logs = np.array([log for log, _ in edges], int)
    return Information(names, basis, np.array(grams), np.array(counts), logs)


def _gather_part(part: Part, basis: Array, size: int) -> list[tuple[tuple[int, int], Array, int]]:
    """Return (log, block), Gram matrices (n, k + 1, k + 1) and samples of each block touched."""
    k = len(basis)
    inverse = solve_triangular(basis, np.eye(k))
    out: list[tuple[tuple[int, int], Array, int]] = []
    for chunk in part.chunks():
        log, start, W, tau = chunk.log, chunk.start, chunk.W, chunk.tau
        n = tau.shape[1]
        Z = np.concatenate([W, tau[:, :, None]], axis=2).reshape(-1, k) @ inverse
        Z = Z.reshape(len(tau), n, k).transpose(1, 0, 2)
        at = 0
        while at < len(tau):
            block = (start + at) // size
            stop = min(len(tau), (block + 1) * size - start)
            piece = Z[:, at:stop]
            gram = piece.transpose(0, 2, 1) @ piece
            if out and out[-1][0] == (log, block):
                _, before, count = out[-1]
                before += gram
                out[-1] = ((log, block), before, count + stop - at)
            else:
                out.append(((log, block), gram, stop - at))
            at = stop
    return out


def choose_basis(regression: Regression) -> Array:
    """Return a triangular factor of evenly spaced rows of ``[W τ]``, (k + 1, k + 1).

    The rows are taken before any decimation: a basis need not be exact, only of the right size
    and direction.
    """
    total = sum(s.survey.kept for s in regression.samples) * len(regression.robot.actuated)
    step = max(1, total // BASIS_ROWS)
    thin = replace(regression, samples=tuple(s.thin(step) for s in regression.samples))
    k = len(regression.parameters)
    R = np.zeros((0, k + 1))
    squares = np.zeros(k + 1)
    for _, _, W, tau in thin.chunks():
        flat = np.concatenate([W, tau[:, :, None]], axis=2).reshape(-1, k + 1)
        squares += np.einsum("ij,ij->j", flat, flat)
        R = triangular_factor(np.vstack([R, flat]))
    length = np.sqrt(squares)
    # A column that never acts gets the length of a typical one: it must not divide by zero.
    length[length == 0] = float(np.median(length[length > 0])) if length.any() else 1.0
    basis = triangular_factor(np.vstack([R, FLOOR * np.diag(length)]))
    signs: Array = np.where(np.diag(basis) < 0, -1.0, 1.0)
    return signs[:, None] * basis
