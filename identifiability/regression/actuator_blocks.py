"""`ActuatorBlocks`: what the rows of one actuator say, over the columns that it can see.

In a tree the torque of a joint depends on the bodies that it moves alone, so most entries of a
Gram matrix over all columns would be zeros; and a block of few samples is smaller as rows than as
their Gram matrix.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.linalg import few_at_once, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Blocks larger than this are held in a file and worked on in batches of this size [bytes]: of a
#: long log of a robot with many joints they would fill the memory. Of one actuator of many they
#: are held there sooner, by this factor.
MOST_BYTES, SOONER = 2**28, 8

#: Directions that a basis' rows do not excite get this share of their column's length.
FLOOR = 1e-6


@frozen
class ActuatorBlocks:
    """Blocks of one actuator's ``[W τ]`` in a basis of its own.

    Attributes
    ----------
    columns : (v,) int
        Columns that it can see, ascending; all others are zero in its rows.
    basis : (r, v + 1)
        ``[W τ] = Z basis`` over these columns and the torque.
    blocks : (B, m, r) or (B, r, r)
        Rows Z of each block where there are m < r (filled up with zeros), else ``Zᵀ Z``. They lie
        in a file where they are large.
    sums : (B, r)
        Sum of the rows Z of each block, which tells what slow noise does.
    """

    columns: np.ndarray
    basis: Array
    blocks: Array
    sums: Array

    @property
    def squared(self) -> bool:
        """Whether Gram matrices are held, not rows."""
        return bool(self.blocks.shape[1] == self.blocks.shape[2])

    @cached_property
    def root(self) -> Array:
        """A factor of ``Zᵀ Z`` over all blocks, (r, r) or fewer rows."""
        if self.squared:
            values, vectors = np.linalg.eigh(self.blocks.sum(0))
            return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
        rows = self.blocks.reshape(-1, self.blocks.shape[2])
        root = rows[:0]
        for at in few_at_once(len(rows), rows[:1].nbytes):
            root = triangular_factor(np.vstack([root, rows[at]]))
        return root

    def __getstate__(self) -> dict[str, Any]:
        """Return its fields: what follows from them is neither sent to workers nor part of keys."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def grams(self, change: Array, at: slice) -> Array:
        """Return ``(Z change)ᵀ (Z change)`` of some blocks, (b, q, q), for a `change` (r, q)."""
        if self.squared:
            grams: Array = change.T @ self.blocks[at] @ change
            return grams
        Z: Array = self.blocks[at] @ change
        return Z.transpose(0, 2, 1) @ Z

    def products(self, left: Array, right: Array, at: slice) -> Array:
        """Return ``(Z left)ᵀ (Z right)`` of some blocks, (b, p, q), for (r, p) and (r, q)."""
        Z = self.blocks[at]
        one = left.T if self.squared else (Z @ left).transpose(0, 2, 1)
        found: Array = one @ (Z @ right)
        return found

    def widen(self, size: int) -> Array:
        """Return the basis over all `size` columns and the torque, (r, size + 1)."""
        wide = np.zeros((len(self.basis), size + 1))
        wide[:, [*self.columns, size]] = self.basis
        return wide

    def reduce(self, map_: Array) -> ActuatorBlocks:
        """Return the blocks of ``[W τ] map_``, for a map (k + 1, m + 1) that keeps the torque."""
        k, m = np.subtract(map_.shape, 1)
        columns = np.flatnonzero(map_[self.columns, :m].any(0))
        part = map_[np.ix_([*self.columns, k], [*columns, m])]
        return self.turned(*np.linalg.qr(self.basis @ part), columns)

    def turned(self, Q: Array, basis: Array, columns: np.ndarray) -> ActuatorBlocks:
        """Return the blocks of ``Z Q``, in another basis."""
        m, q = self.blocks.shape[1], Q.shape[1]
        few = not self.squared and m < q
        out = allot((len(self.blocks), m if few else q, q))
        for at in batches(self.blocks):
            out[at] = self.blocks[at] @ Q if few else self.grams(Q, at)
        turned = ActuatorBlocks(columns, basis, out, self.sums @ Q)
        if "root" in vars(self):  # that of all rows anew would cost a pass over them
            vars(turned)["root"] = triangular_factor(self.root @ Q)
        return turned

    def take(self, kept: np.ndarray) -> ActuatorBlocks:
        """Return some of the blocks."""
        kept = np.arange(len(self.blocks))[kept]
        out = allot((len(kept), *self.blocks.shape[1:]))
        blocks = np.take(self.blocks, kept, axis=0, out=out, mode="clip")
        return replace(self, blocks=blocks, sums=self.sums[kept])

    def weigh(self, weights: Array) -> ActuatorBlocks:
        """Return the blocks with weights (B,) of their squares."""
        root, out = np.sqrt(weights), allot(self.blocks.shape)
        scale = weights if self.squared else root
        for at in batches(self.blocks):
            out[at] = scale[at, None, None] * self.blocks[at]
        return replace(self, blocks=out, sums=root[:, None] * self.sums)

    def merge(self, at: np.ndarray) -> ActuatorBlocks:
        """Return blocks that each hold those from one of `at` up to the next."""
        r, sums = self.blocks.shape[2], np.add.reduceat(self.sums, at, axis=0)
        if self.squared:
            blocks = np.add.reduceat(self.blocks, at, axis=0, out=allot((len(at), r, r)))
        else:
            blocks = hold_blocks(self.blocks.reshape(-1, r), at * self.blocks.shape[1])
        merged = replace(self, blocks=blocks, sums=sums)
        if "root" in vars(self):
            vars(merged)["root"] = self.root
        return merged

    def merge_weighted(self, group: np.ndarray, counts: Array) -> Array:
        """Return ``Zᵀ Z`` of groups of blocks, each of them counted so often, (G, r, r).

        Parameters
        ----------
        group : (B,) int
            Ascending from 0.
        counts : (B,)
        """
        out = []
        for blocks, c in ((self.blocks[group == g], counts[group == g]) for g in np.unique(group)):
            rows = (blocks * np.sqrt(c)[:, None, None]).reshape(-1, blocks.shape[2])
            out.append(np.tensordot(c, blocks, 1) if self.squared else rows.T @ rows)
        return np.stack(out)

    def join(self, other: ActuatorBlocks) -> ActuatorBlocks:
        """Return the blocks of both, over the columns that either sees."""
        columns = np.union1d(self.columns, other.columns)
        wide = [
            replace(one, columns=np.searchsorted(columns, one.columns)).widen(len(columns))
            for one in (self, other)
        ]
        Q, basis = np.linalg.qr(np.vstack(wide))
        first = self.turned(Q[: len(wide[0])], basis, columns)
        second = other.turned(Q[len(wide[0]) :], basis, columns)
        sums = np.concatenate([first.sums, second.sums])
        return replace(first, blocks=stack([*first.blocks, *second.blocks]), sums=sums)


def hold(rows: Array) -> Array:
    """Return what is held of rows (m, r): they themselves where m < r, else their Gram matrix."""
    return rows if len(rows) < rows.shape[1] else rows.T @ rows


def hold_blocks(rows: Array, at: np.ndarray) -> Array:
    """Return what is held of blocks of rows (N, r) that begin at rows `at`, (B, m, r) or (B, r, r).

    Blocks with fewer rows than others are filled up with zeros.
    """
    r, ends = rows.shape[1], np.append(at[1:], len(rows))
    sizes = ends - at
    most = int(sizes.max(initial=0))
    if most == sizes.min(initial=most) and most < r:
        return rows.reshape(len(at), most, r)
    out = allot((len(at), min(most, r), r))
    for place, a, b in zip(out, at.tolist(), ends.tolist(), strict=True):
        fill(place, hold(rows[a:b]))
    return out


def merge_held(one: Array, other: Array) -> Array:
    """Return what is held of the rows of both."""
    if max(len(one), len(other)) < one.shape[1]:
        return hold(np.vstack([one, other]))
    return _gram(one) + _gram(other)


def stack(held: Sequence[Array]) -> Array:
    """Return what is held of each block as one array, (B, m, r) or (B, r, r)."""
    out = allot((len(held), max(map(len, held)), held[0].shape[1]))
    for place, one in zip(out, held, strict=True):
        fill(place, one)
    return out


def fill(place: Array, held: Array) -> None:
    """Put what is held of a block into its place (m, r), full of zeros, or (r, r)."""
    held = _gram(held) if len(place) == place.shape[1] else held
    place[: len(held)] = held


def allot(shape: tuple[int, ...], sooner: int = SOONER) -> Array:
    """Return zeros: in memory, or where they are large in a file that vanishes with them."""
    size = 8 * int(np.prod(shape))
    if sooner * size <= MOST_BYTES:
        return np.zeros(shape)
    with tempfile.TemporaryFile() as file:
        try:
            file.truncate(size)
            os.posix_fallocate(file.fileno(), 0, size)
        except (OSError, AttributeError):  # no room there, or a system that cannot say
            return np.zeros(shape)
        return np.asarray(np.memmap(file, float, "r+", shape=shape))


def batches(large: Array) -> Iterator[slice]:
    """Yield which of many blocks (B, …) to work on at a time."""
    size = max(1, MOST_BYTES // max(large[:1].nbytes, 1))
    yield from (slice(at, at + size) for at in range(0, len(large), size))


def _gram(held: Array) -> Array:
    return held if len(held) == held.shape[1] else held.T @ held


def choose_basis(R: Array, columns: np.ndarray) -> Array:
    """Return a basis of some columns and the torque from rows of ``[W τ]``, (v + 1, v + 1).

    Upper triangular; the rows need not be all: a basis is of the right size and direction only.

    Parameters
    ----------
    R : (m, k + 1)
        Some of the rows, or a triangular factor of them.
    columns : (v,) int
    """
    part = R[:, [*columns, R.shape[1] - 1]]
    length = np.linalg.norm(part, axis=0)
    # A column that never acts gets the length of a typical one: it must not divide by zero.
    length[length == 0] = float(np.median(length[length > 0])) if length.any() else 1.0
    return triangular_factor(np.vstack([part, FLOOR * np.diag(length)]))


def invert_basis(basis: Array) -> Array:
    """Return the inverse of a basis, (v + 1, v + 1)."""
    inverse: Array = solve_triangular(basis, np.eye(len(basis)))
    return inverse
