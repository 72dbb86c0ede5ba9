"""`Information`: the compressed content of a regression, independent of its length.

`ActuatorBlocks` hold the rows of one actuator, compressed, over the columns that act in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Annotated, Any

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from identifiability.foundation.engines import Engine, Steps
from identifiability.foundation.linalg import (
    NEARLY,
    TINY,
    few_at_once,
    find_chains,
    triangular_factor,
)
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import at_least, checked
from identifiability.foundation.values import frozen, remember
from identifiability.logs.prepare.dataset import Dataset

from .regression import Chunk, LogPart, Regression, map_parts
from .structure import random_motion

# `ActuatorBlocks`: the compressed rows of one actuator, over the columns that act in it.
#
# In a tree the torque of a joint depends on the bodies that it moves alone, so most entries of a
# Gram matrix over all columns would be zeros; and a block of few samples is smaller as rows than
# as their Gram matrix.


@frozen
class ActuatorBlocks:
    """Blocks of one actuator's ``[W τ]`` in a separate basis.

    Attributes
    ----------
    columns : (v,) int
        Columns that it can see, ascending; all others are zero in its rows.
    basis : (r, v + 1) or None
        ``[W τ] = Z basis`` over these columns and the torque; None where Z are these themselves.
    blocks : (B, m, r)
        Rows Z of each block, padded with zeros, or a factor of as many columns.
    sums : (B, r)
        Sum of the rows Z of each block, which tells what slow noise does.
    """

    columns: np.ndarray
    basis: Array | None
    blocks: Array
    sums: Array

    @cached_property
    def coordinates(self) -> Array:
        """The basis, also where it is the unit matrix, (r, v + 1)."""
        if self.basis is None:
            return np.eye(len(self.columns) + 1)
        return self.basis

    @cached_property
    def gram(self) -> Array:
        """``Zᵀ Z`` over all blocks, (r, r)."""
        Z = self.blocks.reshape(-1, self.blocks.shape[2])
        return Z.T @ Z

    @cached_property
    def sums_made(self) -> dict[Any, Any]:
        """Sums of these blocks that were computed, shared by all reductions of them."""
        return {}

    @property
    def total(self) -> Array:
        """Products of the columns and the torque over all blocks, (v + 1, v + 1)."""
        Z = self.blocks.reshape(-1, self.blocks.shape[2])
        gram = Z.T @ Z  # that of many columns is not kept
        if self.basis is None:
            return gram
        return self.basis.T @ gram @ self.basis

    @cached_property
    def root(self) -> Array:
        """A factor of ``Zᵀ Z`` over all blocks, (r, r): Z are at right angles, nothing is lost."""
        return factor_each(self.gram[None])[0]

    def reduce(self, map_: Array) -> ActuatorBlocks:
        """Return the blocks of ``[W τ] map_``, for a map (k + 1, m + 1) that keeps the torque."""
        k, m = np.subtract(map_.shape, 1)
        columns = np.flatnonzero(map_[self.columns, :m].any(0))
        entries = np.ix_([*self.columns, k], [*columns, m])
        basis = self.coordinates @ map_[entries]
        # Blocks stay in a basis that is larger than the requested columns by up to this factor: to
        # turn all of them costs more than to look at them many times.
        if len(basis) > 1.25 * basis.shape[1]:
            Q, basis = np.linalg.qr(basis)
            return ActuatorBlocks(columns, basis, self.blocks @ Q, self.sums @ Q)
        reduced = replace(self, columns=columns, basis=basis)
        vars(reduced).update(gram=self.gram, sums_made=self.sums_made)
        return reduced

    def take(self, kept: np.ndarray) -> ActuatorBlocks:
        """Return some of the blocks."""
        return replace(self, blocks=self.blocks[kept], sums=self.sums[kept])

    def weigh(self, weights: Array) -> ActuatorBlocks:
        """Return the blocks with weights (B,) of their squares."""
        root = np.sqrt(weights)[:, None]
        blocks = root[:, :, None] * self.blocks
        return replace(self, blocks=blocks, sums=root * self.sums)

    def summed(self, members: Array) -> ActuatorBlocks:
        """Return a block for each row of members (F, B): blocks counted so often, added up."""
        r = self.blocks.shape[2]

        def make() -> Array:
            out = []
            for weights in members:
                own = weights > 0
                roots = np.sqrt(weights[own])[:, None, None]
                Z = (roots * self.blocks[own]).reshape(-1, r)
                out.append(Z.T @ Z)
            return factor_each(np.array(out))

        blocks = remember(self.sums_made, members.tobytes(), make, 2)
        return replace(self, blocks=blocks, sums=members @ self.sums)


@frozen
class ColumnProducts:
    """Products of one actuator's columns.

    Attributes
    ----------
    place : (k + 1,) int
        Where each column stands, the torque last; those that do not act stand behind all others.
    products : (c + 1, c + 1) or None
        None where the rows are fewer than the columns.
    rows : (c + 1, m)
        Each column's rows; zero where there are products.
    """

    place: np.ndarray
    products: Array | None
    rows: Array

    @staticmethod
    def of(part: ActuatorBlocks, place: np.ndarray, count: int) -> ColumnProducts:
        """Return the products of the last so many columns of blocks, the torque among them."""
        Z = part.blocks.reshape(-1, part.blocks.shape[2])
        if len(Z) < count:
            rows = Z if part.basis is None else Z @ part.basis
            last = rows[:, -count:].T
            own = np.pad(last, ((0, 1), (0, 0)))
            return ColumnProducts(place, None, own)
        total = np.pad(part.total[-count:, -count:], (0, 1))
        return ColumnProducts(place, total, np.zeros((count + 1, 0)))

    def acts(self, columns: np.ndarray) -> np.ndarray:
        """Return which columns act, as their shape."""
        return self.place[columns] < len(self.rows) - 1

    def outer(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return the products of each of some columns with each of others."""
        some = self.place[some]
        others = self.place[others]
        if self.products is None:
            return self.rows[some] @ self.rows[others].T
        return self.products[some[:, None], others]

    def pairs(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return the product of each of some columns with its other."""
        some = self.place[some]
        others = self.place[others]
        if self.products is None:
            return (self.rows[some] * self.rows[others]).sum(-1)
        return self.products[some, others]

    def among(self, sets: np.ndarray) -> Array:
        """Return the products of the columns of sets (s, k) among themselves, (s, k, k)."""
        at = self.place[sets]
        if self.products is None:
            rows = self.rows[at]
            return rows @ rows.swapaxes(1, 2)
        return self.products[at[:, :, None], at[:, None, :]]


def factor_each(grams: Array) -> Array:
    """Return a factor of each of some products (B, r, r) of columns about at right angles."""
    r = grams.shape[1]
    # Values below are rounding of the products.
    least = TINY**1.25 * np.trace(grams, axis1=1, axis2=2) + 1e-300
    raised = grams + least[:, None, None] * np.eye(r)
    return np.linalg.cholesky(raised).swapaxes(1, 2)


class _Blocks:
    """Accumulate the sums of consecutive blocks.

    Rows, or a triangular factor of them where the longest block has more than there are columns.
    """

    def __init__(self, count: int, longest: int, seen: Sequence[np.ndarray]) -> None:
        widths = [len(columns) + 1 for columns in seen]
        self.seen = seen
        self.held = [np.zeros((count, min(longest, r), r)) for r in widths]
        self.sums = [np.zeros((count, r)) for r in widths]
        self.data = np.zeros((count, len(widths)), int)

    def take(
        self, rows: tuple[Array, Array, np.ndarray], start: int, edges: np.ndarray, before: int
    ) -> None:
        """Add consecutive rows (W, τ, data) of a log, from the output `start` of it on.

        Parameters
        ----------
        rows : (m, n, k), (m, n) and (m, n)
        start : int
        edges : (b,) int
            Outputs at which blocks of the log begin; the first of them is the block `before`.
        before : int
        """
        W, tau, data = rows
        row = start + np.arange(len(tau))
        block = np.searchsorted(edges, row, "right") - 1
        at = np.flatnonzero(np.diff(block, prepend=-1))  # where pieces of blocks begin
        block += before
        own = slice(block[0], block[-1] + 1)
        self.data[own] += np.add.reduceat(data, at, dtype=int)
        for a, columns in enumerate(self.seen):
            Z = np.column_stack([W[:, a, columns], tau[:, a]])
            held = self.held[a]
            self.sums[a][own] += np.add.reduceat(Z, at)
            if held.shape[1] < held.shape[2]:
                held[block, row - edges[block - before]] = Z
            else:
                _merge(held, own.start, np.split(Z, at[1:]))

    def add_all(self, first: int, other: _Blocks) -> None:
        """Add blocks that were gathered elsewhere, from one of these on."""
        for own, more in zip((*self.sums, self.data), (*other.sums, other.data), strict=True):
            own[first : first + len(more)] += more
        for held, blocks in zip(self.held, other.held, strict=True):
            if held.shape[1] < held.shape[2]:
                held[first : first + len(blocks)] += blocks
            else:
                _merge(held, first, blocks)

    def parts(self) -> tuple[ActuatorBlocks, ...]:
        """Return them by actuator, over the columns that act in it."""
        return tuple(map(_condition, self.seen, self.held, self.sums))


def _merge(held: Array, first: int, blocks: Iterable[Array]) -> None:
    """Put rows of consecutive blocks, from one on, into their factors."""
    for k, Z in enumerate(blocks, first):
        first_rows = len(Z) >= len(held[k]) and not held[k].any()
        rows = Z if first_rows else np.vstack([held[k], Z])
        held[k] = rows if len(rows) == len(held[k]) else triangular_factor(rows)


def _condition(columns: np.ndarray, blocks: Array, sums: Array) -> ActuatorBlocks:
    """Return blocks in a basis whose columns have about unit length and right angles."""
    R = triangular_factor(blocks.reshape(-1, blocks.shape[2]))
    acts = np.asarray(R[:, :-1].any(0))
    R = R[:, np.append(acts, True)]
    length = np.linalg.norm(R, axis=0)
    # Nothing may be divided by zero, such as a torque that is none.
    length[length == 0] = float(np.median(length[length > 0])) if length.any() else 1.0
    basis = triangular_factor(np.vstack([R, NEARLY * np.diag(length)]))
    inverse = np.zeros((len(acts) + 1, len(basis)))
    inverse[np.append(acts, True)] = solve_triangular(basis, np.eye(len(basis)))
    return ActuatorBlocks(columns[acts], basis, blocks @ inverse, sums @ inverse)


# `Information`: all that a regression says about its parameters, independent of its length.
#
# The sufficient statistic of the linear model per block of time and per actuator: factors of
# ``[W τ]`` (or the rows themselves while they are fewer). They have the columns that act in the
# actuator, in a basis that makes them well conditioned. A basis is a triangular factor of all rows
# of the actuator, so ``[W τ] basis⁻¹`` has columns of about unit length and right angles. So sums
# of squares over blocks lose no digits (Gram matrices of the rows would lose half of them). Factors
# of blocks are merged, so chunks, files and processes make one.
#
# What to use when: `factor` is the loss of least squares for programs and posteriors, `products`
# are for folds and resampling, ``+`` for logs and workers, `joint` for instruments.


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
    data : (B, n) int
        Number of rows with valid torque of each actuator: its joint does not dwell.
    log : (B,) int
        Which log a block comes from.
    instrumented : bool
        Whether the parts hold ``[V W τ]``, with an instrument V for each of the k columns of W.
    prior : (d, k + 1) or None
        Rows ``[W τ]`` of no log: what is known of the values beforehand, weighed like noise.
    """

    columns: Strings
    parts: tuple[ActuatorBlocks, ...]
    counts: np.ndarray
    data: np.ndarray
    log: np.ndarray
    instrumented: bool = False
    prior: Array | None = None

    @staticmethod
    def of_rows(
        columns: Sequence[str],
        W: Array,
        tau: Array,
        log: Array,
        size: int,
        instruments: Array | None = None,
        moves: np.ndarray | None = None,
    ) -> Information:
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
        instruments : (N, n, k), optional
        moves : (N, n) bool, optional
            Where torque is data; elsewhere all of these are zero. Everywhere by default.
        """
        wide = np.concatenate([*([] if instruments is None else [instruments]), W], axis=2)
        first = np.unique(log, return_index=True)[1]
        ends = [*first[1:], len(log)]
        spans = zip(first, ends, strict=True)
        at = [s for a, b in spans for s in range(a, b, size)]
        counts = np.diff([*at, len(log)])
        seen = [np.flatnonzero(own) for own in np.asarray(wide.any(0))]
        blocks = _Blocks(len(at), int(counts.max()), seen)
        moves = np.ones(tau.shape, bool) if moves is None else moves
        blocks.take((wide, tau, moves), 0, np.array(at), 0)
        what = blocks.parts(), counts, blocks.data, np.asarray(log)[at]
        return Information(tuple(columns), *what, instruments is not None)

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
        """Number of rows that are data, of all actuators."""
        return int(self.data.sum())

    @cached_property
    def rows_each(self) -> np.ndarray:
        """Number of rows of each actuator that are data, one at least, (n,)."""
        return np.maximum(self.data.sum(0), 1)

    @cached_property
    def made(self) -> dict[Any, Any]:
        """Cache of quantities computed from the sums over all blocks.

        Fits ask for the same quantities repeatedly.
        """
        return {}

    @property
    def _width(self) -> int:
        return self.size * (1 + self.instrumented)

    @cached_property
    def joint(self) -> Information:
        """The information of ``[V W τ]``, of 2k columns: instruments, then their columns.

        With its factor ``R``, ``(Vᵀ W)⁻¹ Vᵀ τ`` is ``R[:k, k:2k]⁻¹ R[:k, 2k]`` [Janot 2014].
        """
        names = (*(f"instrument of {c}" for c in self.columns), *self.columns)
        prior = None if self.prior is None else np.hstack([self.prior[:, :-1], self.prior])
        return Information(names, self.parts, self.counts, self.data, self.log, prior=prior)

    @property
    def torque(self) -> Array:
        """Each actuator's sum of squares of its torque, (n,)."""
        return self.squares(np.eye(self.size + 1)[:, -1])

    @property
    def variation(self) -> Array:
        """Each actuator's sum of squares of its torque about its mean, (n,): its own scale."""
        total = self.sums[:, -1]
        return np.maximum(self.torque - total**2 / self.rows_each, 0.0)

    @property
    def sums(self) -> Array:
        """Each actuator's sums of the rows ``[W τ]``, (n, k + 1)."""
        parts = self.of_actuators(np.eye(self.size + 1))
        return np.array([part.sums.sum(0) @ own for part, own in parts])

    def of_actuators(self, change: Array) -> Iterator[tuple[ActuatorBlocks, Array]]:
        """Yield the blocks of each actuator with ``[W τ] change`` in their coordinates, (r, q).

        Parameters
        ----------
        change : (k + 1, q)
        """
        for part, own, columns in self._seen:
            seen = change[columns]
            acts = np.flatnonzero(seen.any(0))
            if len(acts) == seen.shape[-1]:
                yield part, own @ seen
                continue
            turned = np.zeros((len(own), seen.shape[-1]))
            turned[:, acts] = own @ seen[:, acts]
            yield part, turned

    def between(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return products of columns over all rows; column k is the torque.

        Parameters
        ----------
        some, others : int
            Columns, (a, 1) and (b,) for products of each with each, else (a,) and (a,) or ().
        """
        out = np.zeros(np.broadcast_shapes(some.shape, others.shape))
        for own in self._products:
            if some.ndim == 2:
                rows = np.flatnonzero(own.acts(some[:, 0]))
                by = np.flatnonzero(own.acts(others)) if len(rows) else rows
                out[np.ix_(rows, by)] += own.outer(some[rows, 0], others[by])
            else:
                out += own.pairs(some, others)
        return out

    def among(self, sets: np.ndarray) -> Array:
        """Return products of the columns of each set (s, k) among themselves, (s, k, k)."""
        out = np.zeros((*sets.shape, sets.shape[1]))
        for own in self._products:
            acts = np.flatnonzero(own.acts(sets).any(1))
            out[acts] += own.among(sets[acts])
        return out

    def acts(self, columns: np.ndarray) -> np.ndarray:
        """Return in which actuators columns (m,) act, (n, m) bool."""
        return np.array([own.acts(columns) for own in self._products])

    def squares(self, change: Array) -> Array:
        """Return each actuator's sum of squares of ``[W τ] change``, (n,) or (n, m).

        Parameters
        ----------
        change : (k + 1,) or (k + 1, m)
        """
        parts = self.of_actuators(change.reshape(len(change), -1))
        squares = [np.square(part.root @ turned).sum(0) for part, turned in parts]
        return np.reshape(squares, (self.actuators, *change.shape[1:]))

    def squares_of_blocks(self, change: Array) -> Array:
        """Return each actuator's sum of squares of ``[W τ] x`` in each block, (…, B, n).

        Parameters
        ----------
        change : (…, B, k + 1) or (k + 1,)
            x of each block, or of all.
        """
        every = self.of_actuators(np.eye(self.size + 1))
        rows = (part.blocks @ (change @ basis.T)[..., None] for part, basis in every)
        squares = [np.square(Z).sum((-2, -1)) for Z in rows]
        return np.stack(squares, -1)

    def products(self, weights: Array, left: Array, right: Array) -> Array:
        """Return ``([W τ] left)ᵀ ([W τ] right)`` of each block, actuators weighted, (B, p, q).

        Parameters
        ----------
        weights : (n,)
        left, right : (k + 1, p) and (k + 1, q)
        """
        out = np.zeros((len(self.counts), left.shape[1], right.shape[1]))
        p = left.shape[1]
        both_sides = np.hstack([left, right])
        both = zip(np.sqrt(weights), self.of_actuators(both_sides), strict=True)
        turned = [(part, weight * turn) for weight, (part, turn) in both]
        acts = np.array([turn.any(0) for _, turn in turned])
        for chain in find_chains(acts[:, :p]):
            joints = np.flatnonzero(acts[:, chain].any(1)).tolist()
            if not joints:
                continue
            rights = np.flatnonzero(acts[joints, p:].any(0))
            columns = np.append(chain, p + rights)
            own = [(turned[j][0], turned[j][1][:, columns]) for j in joints]
            # Rows of all actuators side by side: one product a block, and not one for each.
            size = 8 * len(columns) * (len(columns) + sum(part.blocks.shape[1] for part, _ in own))
            for at in few_at_once(len(out), size):
                Z = np.concatenate([part.blocks[at] @ turn for part, turn in own], axis=1)
                blocks = np.arange(len(out))[at]
                lefts = Z[:, :, : len(chain)]
                out[np.ix_(blocks, chain, rights)] = (
                    lefts.transpose(0, 2, 1) @ Z[:, :, len(chain) :]
                )
        return out

    def factor(self, weights: Array | None = None) -> Array:
        """Return R (k + 1, k + 1), upper triangular, with ``RᵀR = [W τ]ᵀ [W τ]``, prior and all."""
        w = np.ones(self.actuators) if weights is None else np.asarray(weights, float)
        return remember(self.made, w.tobytes(), partial(self._factor, w), 4).copy()

    def _factor(self, weights: Array) -> Array:
        """Return a factor of weighted rows and the prior."""
        roots = np.append(np.sqrt(weights), 1.0)
        R = np.zeros((self.size + 1, self.size + 1))
        corners = []
        for at, rows, owner in self._rows:
            weighted = roots[owner, None] * rows
            padding = np.zeros((len(at), len(at)))
            factor = triangular_factor(np.vstack([weighted, padding]))
            R[np.ix_(at[:-1], at)] = factor[:-1]
            corners.append(factor[-1, -1])
        R[-1, -1] = np.linalg.norm(corners)
        return R

    @cached_property
    def _rows(self) -> list[tuple[np.ndarray, Array, np.ndarray]]:
        """Columns of each chain and the torque, rows of their factors, and whose these are.

        The prior's rows come after those of all actuators; last are rows of the torque alone.
        """
        roots = [part.root @ own for part, own, _ in self._seen]
        places = [columns for *_, columns in self._seen]
        if self.prior is not None:
            roots.append(self.prior)
            places.append(np.arange(self.size + 1))
        owner = np.repeat(np.arange(len(roots)), list(map(len, roots)))
        every = np.zeros((len(owner), self.size + 1))
        for k, (root, columns) in enumerate(zip(roots, places, strict=True)):
            every[np.ix_(owner == k, columns)] = root
        found = []
        for chain in self.chains:
            at = np.append(chain, self.size)
            own = every[:, chain].any(1)
            found.append((at, every[np.ix_(own, at)], owner[own]))
        alone = ~every[:, :-1].any(1)
        return [*found, (np.array([self.size]), every[alone, -1:], owner[alone])]

    @cached_property
    def chains(self) -> list[np.ndarray]:
        """Columns of each chain of the robot: no row, nor the prior, has columns of two chains."""
        every = np.arange(self.size)
        acts = [np.isin(every, columns) for *_, columns in self._seen]
        known = [] if self.prior is None else list(self.prior[:, :-1] != 0)
        return find_chains(np.array([*acts, *known]))

    @cached_property
    def _seen(self) -> list[tuple[ActuatorBlocks, Array, np.ndarray]]:
        """Each actuator's blocks, basis of the columns W that it can see and τ, and which these."""
        instruments = self._width - self.size
        found = []
        for part in self.parts:
            seen = np.append(part.columns >= instruments, True)
            columns = np.append(part.columns - instruments, self.size)[seen]
            found.append((part, part.coordinates[:, seen], columns))
        return found

    @cached_property
    def _products(self) -> list[ColumnProducts]:
        """Return the products of each actuator's columns; instruments take no part."""
        found = []
        for part in self.parts:
            columns = np.append(part.columns + self.size - self._width, self.size)
            columns = columns[columns >= 0]
            place = np.full(self.size + 1, len(columns))
            place[columns] = np.arange(len(columns))
            found.append(ColumnProducts.of(part, place, len(columns)))
        return found

    def reduce(self, M: Array, columns: Sequence[str], held: Array | None = None) -> Information:
        """Return the information of the columns ``W M``, with torque ``τ - W held``.

        Parameters
        ----------
        M : (k, m)
            Zeroed columns are left out, tied ones added; of instruments too.
        columns : sequence of str
            Names of the m new columns.
        held : (k,), optional
            Parameter values that are held fixed.
        """
        k, m = M.shape
        moved = np.zeros((k, 1)) if held is None else -held[:, None]
        last = [np.zeros((1, m)), np.ones((1, 1))]
        own = np.block([[M, moved], last])
        map_ = block_diag(M, own) if self.instrumented else own
        parts = tuple(part.reduce(map_) for part in self.parts)
        prior = None if self.prior is None else self.prior @ own
        return replace(self, columns=tuple(columns), parts=parts, prior=prior)

    def select(self, columns: Sequence[int]) -> Information:
        """Return the information about some columns, the others held at zero."""
        if list(columns) == list(range(self.size)):
            return self
        names = [self.columns[c] for c in columns]
        return self.reduce(np.eye(self.size)[:, list(columns)], names)

    def take(self, kept: np.ndarray) -> Information:
        """Return some of the blocks."""
        parts = tuple(part.take(kept) for part in self.parts)
        what = {"counts": self.counts[kept], "data": self.data[kept], "log": self.log[kept]}
        return replace(self, parts=parts, **what)

    def added_up(self) -> Information:
        """Return the information without its rows, for questions about all blocks together."""
        parts = tuple(replace(part, blocks=part.blocks[:0].copy()) for part in self.parts)
        other = replace(self, parts=parts)
        vars(other).update(_products=self._products)
        return other

    def summed(self, members: Array) -> Information:
        """Return a block for each row of members (F, B): blocks counted so often, added up."""
        weights = np.asarray(members, float)
        every = np.arange(len(members))
        parts = tuple(part.summed(weights) for part in self.parts)
        what = {"counts": weights @ self.counts, "data": weights @ self.data, "log": every}
        return replace(self, parts=parts, **what)

    def weigh(self, weights: Array) -> Information:
        """Return the blocks with weights of their squares; their samples count as before.

        Parameters
        ----------
        weights : (B,) or (n, B)
            Of all actuators, or of each.
        """
        each = np.broadcast_to(weights, (self.actuators, len(self.counts)))
        parts = tuple(part.weigh(w) for part, w in zip(self.parts, each, strict=True))
        return replace(self, parts=parts)

    def merge(self, at: np.ndarray) -> Information:
        """Return blocks that each hold those from one of `at` up to the next."""
        count = len(self.counts)
        if len(at) == count:
            return self
        owner = np.searchsorted(at, np.arange(count), "right") - 1
        what = {"counts": np.add.reduceat(self.counts, at), "log": self.log[at]}
        what["data"] = np.add.reduceat(self.data, at, axis=0)
        return replace(self.summed(owner == np.arange(len(at))[:, None]), **what)


# Gathered from a regression, chunk by chunk, here or on workers.


#: Blocks of time a log is divided into at most; the bootstrap draws whole blocks.
BLOCKS = 256
#: Blocks that would take more [bytes] are fewer, down to so many: robots of many joints.
LARGEST, FEWEST = 2**28, 32


@checked
def gather_information(
    regression: Regression,
    blocks: Annotated[int, at_least(1)] = BLOCKS,
    *,
    transform: Callable[[Chunk], Chunk] | None = None,
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
    transform : callable, optional
        Changes the rows of each chunk, such as `noise.whiten_chunk`. The engine must be able to
        pickle it.
    engine : Engine, optional
        Where stretches of long logs are worked on; here without.
    progress : callable(int, int), optional
    """
    names = tuple(p.name for p in regression.parameters)
    acts = _acting(regression)
    # Fits hold a block's equations of all columns in some four copies.
    widths = acts.sum(1) + 1
    squares = (widths**2).sum()
    room = LARGEST // (8 * max(int(squares), 4 * len(names) ** 2))
    size = max(1, -(-regression.outputs // min(blocks, max(room, FEWEST))))
    edges = [_block_edges(samples, size) for samples in regression.samples]
    pairs = zip(edges, regression.samples, strict=True)
    ends = [np.diff([*own, s.outputs]) for own, s in pairs]
    counts = np.concatenate(ends)
    log = np.repeat(np.arange(len(edges)), list(map(len, edges)))
    longest = int(counts.max())
    missed = True
    while missed:
        every = _Blocks(len(counts), longest, [np.flatnonzero(own) for own in acts])
        gather = partial(
            _gather_part, seen=every.seen, edges=edges, longest=longest, transform=transform
        )
        found = acts
        for first, own, acting in map_parts(gather, regression.parts(), engine, progress):
            found = found | acting
            every.add_all(first, own)
        missed = bool((found & ~acts).any())
        acts = found
    what = every.parts(), counts, every.data, log
    return Information(names, *what, regression.instruments is not None)


def _acting(regression: Regression) -> np.ndarray:
    """Return which columns act in which actuator at random states of the robot, (n, k) bool.

    Columns that act along a measured motion only are added there.
    """
    motion = random_motion(regression.robot, np.random.default_rng(0), 50)
    acts = np.asarray(regression.model.regressor(regression.robot, motion).any(0))
    acts = acts if regression.columns is None else acts[:, regression.columns]
    if regression.instruments is None:
        return acts
    return np.hstack([acts, acts])


def _block_edges(samples: Dataset, size: int) -> Array:
    """Return where blocks of a log begin; none reaches across a long gap."""
    ends = (*samples.starts[1:], samples.outputs)
    pairs = zip(samples.starts, ends, strict=True)
    return np.concatenate([np.arange(a, b, size) for a, b in pairs])


def _gather_part(
    part: LogPart,
    seen: Sequence[np.ndarray],
    edges: Sequence[np.ndarray],
    longest: int,
    transform: Callable[[Chunk], Chunk] | None,
) -> tuple[int, _Blocks, np.ndarray]:
    """Return the first block of a part, its blocks, and which columns act in which actuator."""
    own = edges[part.log]
    before = sum(map(len, edges[: part.log]))
    first = max(int(np.searchsorted(own, part.start, "right")) - 1, 0)
    count = int(np.searchsorted(own, part.start + part.samples.outputs)) - first
    blocks = _Blocks(count, longest, seen)
    acting = np.zeros((len(seen), 1), bool)
    for measured in part.chunks():
        chunk = measured if transform is None else transform(measured)
        acting = acting | np.asarray(chunk.wide.any(0))
        blocks.take((chunk.wide, chunk.tau, chunk.data), chunk.start, own, -first)
    return before + first, blocks, acting
