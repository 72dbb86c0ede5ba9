"""`Information`: all that a regression says about its parameters, independent of its length.

`ActuatorBlocks` hold what the rows of one actuator say, over the columns that it can see.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from functools import cached_property, partial, reduce
from itertools import groupby
from operator import add, attrgetter
from typing import Annotated, Any

import numpy as np
from scipy.linalg import block_diag, solve_triangular
from scipy.linalg.blas import dtrmm

from identifiability.foundation.engines import Engine, Steps
from identifiability.foundation.linalg import NEARLY, few_at_once, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.options import at_least, checked
from identifiability.foundation.values import frozen, remember
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.regression import Chunk, LogPart, Regression, map_parts

# `ActuatorBlocks`: what the rows of one actuator say, over the columns that it can see.
#
# In a tree the torque of a joint depends on the bodies that it moves alone, so most entries of a
# Gram matrix over all columns would be zeros; and a block of few samples is smaller as rows than
# as their Gram matrix.


@frozen
class ActuatorBlocks:
    """Blocks of one actuator's ``[W τ]`` in a basis of its own.

    Attributes
    ----------
    columns : (v,) int
        Columns that it can see, ascending; all others are zero in its rows.
    basis : (r, v + 1) or None
        ``[W τ] = Z basis`` over these columns and the torque; None where Z are these themselves.
    blocks : (B, m, r) or (B, r, r)
        Rows Z of each block where there are m < r (filled up with zeros), else ``Zᵀ Z``.
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
        return np.eye(len(self.columns) + 1) if self.basis is None else self.basis

    @cached_property
    def total(self) -> Array:
        """Products of the columns and the torque over all blocks, (v + 1, v + 1)."""
        if self.squared and self.basis is None:
            return np.asarray(self.blocks.sum(0))
        rows = self.root @ self.coordinates
        return np.asarray(rows.T @ rows)

    @property
    def squared(self) -> bool:
        """Whether Gram matrices are held, not rows."""
        return bool(self.blocks.shape[1] == self.blocks.shape[2])

    @cached_property
    def root(self) -> Array:
        """A factor of ``Zᵀ Z`` over all blocks, (r, r) or fewer rows."""
        rows = self.blocks.reshape(-1, self.blocks.shape[2])
        # Rows that take more [bytes] are squared for their factor: columns of a basis are
        # at right angles, so that nothing is lost, and a triangular factor takes three
        # times as long.
        if self.squared or rows.nbytes > (2**22):
            gram = self.blocks.sum(0) if self.squared else rows.T @ rows
            values, vectors = np.linalg.eigh(gram)
            return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)
        root = rows[:0]
        for at in few_at_once(len(rows), rows[:1].nbytes):
            root = triangular_factor(np.vstack([root, rows[at]]))
        return root

    def __getstate__(self) -> dict[str, Any]:
        """Return its fields: what follows from them is neither sent to workers nor part of keys."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def products(self, left: Array, right: Array, at: slice) -> Array:
        """Return ``(Z left)ᵀ (Z right)`` of some blocks, (b, p, q), for (r, p) and (r, q)."""
        Z = self.blocks[at]
        one = left.T if self.squared else (Z @ left).transpose(0, 2, 1)
        found: Array = one @ (Z @ right)
        return found

    def widen(self, size: int) -> Array:
        """Return the basis over all `size` columns and the torque, (r, size + 1)."""
        wide = np.zeros((len(self.coordinates), size + 1))
        wide[:, [*self.columns, size]] = self.coordinates
        return wide

    def reduce(self, map_: Array) -> ActuatorBlocks:
        """Return the blocks of ``[W τ] map_``, for a map (k + 1, m + 1) that keeps the torque."""
        k, m = np.subtract(map_.shape, 1)
        columns = np.flatnonzero(map_[self.columns, :m].any(0))
        basis = self.coordinates @ map_[np.ix_([*self.columns, k], [*columns, m])]
        # Blocks stay in a basis that is larger than what is asked of them by up to this
        # factor: to turn all of them costs more than to look at them many times.
        if len(basis) > 1.25 * basis.shape[1]:
            return self.turned(*np.linalg.qr(basis), columns)
        reduced = replace(self, columns=columns, basis=basis)
        vars(reduced)["root"] = self.root
        return reduced

    def turned(self, Q: Array, basis: Array, columns: np.ndarray) -> ActuatorBlocks:
        """Return the blocks of ``Z Q``, in another basis."""
        few = not self.squared and self.blocks.shape[1] < Q.shape[1]
        out = self.blocks @ Q if few else self.products(Q, Q, slice(None))
        turned = ActuatorBlocks(columns, basis, out, self.sums @ Q)
        if "root" in vars(self):  # that of all rows anew would cost a pass over them
            vars(turned)["root"] = triangular_factor(self.root @ Q)
        return turned

    def take(self, kept: np.ndarray) -> ActuatorBlocks:
        """Return some of the blocks."""
        return replace(self, blocks=self.blocks[kept], sums=self.sums[kept])

    def weigh(self, weights: Array) -> ActuatorBlocks:
        """Return the blocks with weights (B,) of their squares."""
        root = np.sqrt(weights)
        blocks = (weights if self.squared else root)[:, None, None] * self.blocks
        return replace(self, blocks=blocks, sums=root[:, None] * self.sums)

    def summed(self, members: Array) -> ActuatorBlocks:
        """Return a block for each row of members (F, B): blocks counted so often, added up."""
        if self.squared:
            blocks = np.tensordot(members, self.blocks, 1)
        else:
            root, r = np.sqrt(members), self.blocks.shape[2]
            rows = ((w[w > 0, None, None] * self.blocks[w > 0]).reshape(-1, r) for w in root)
            blocks = np.stack([Z.T @ Z for Z in rows])
        return replace(self, blocks=blocks, sums=members @ self.sums)

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
    out = np.zeros((len(at), min(most, r), r))
    for place, a, b in zip(out, at.tolist(), ends.tolist(), strict=True):
        fill(place, hold(rows[a:b]))
    return out


def merge_kept(one: Array, other: Array) -> Array:
    """Return what is held of the rows of both."""
    if max(len(one), len(other)) < one.shape[1]:
        return hold(np.vstack([one, other]))
    return _gram(one) + _gram(other)


def stack(held: Sequence[Array]) -> Array:
    """Return what is held of each block as one array, (B, m, r) or (B, r, r)."""
    out = np.zeros((len(held), max(map(len, held)), held[0].shape[1]))
    for place, one in zip(out, held, strict=True):
        fill(place, one)
    return out


def fill(place: Array, held: Array) -> None:
    """Put what is held of a block into its place (m, r), full of zeros, or (r, r)."""
    held = _gram(held) if len(place) == place.shape[1] else held
    place[: len(held)] = held


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
    return triangular_factor(np.vstack([part, NEARLY * np.diag(length)]))


def invert_basis(basis: Array) -> Array:
    """Return the inverse of a basis, (v + 1, v + 1)."""
    inverse: Array = solve_triangular(basis, np.eye(len(basis)))
    return inverse


# `Information`: all that a regression says about its parameters, independent of its length.
#
# The sufficient statistic of the linear model per block of time and per actuator: Gram matrices of
# ``[W τ]`` (or the rows themselves while they are fewer), over the columns that the actuator can
# see and in a basis that makes them well conditioned. A basis is a triangular factor of a
# subsample of the actuator's rows, so ``[W τ] basis⁻¹`` has columns of about unit length and right
# angles, and nothing is lost by squaring (plain Gram matrices lose half the digits, QR of all rows
# costs five times as much). Adding is concatenation of blocks, so chunks, files and processes are
# one sum.
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
        Those of them at which torque of an actuator is data: its joint does not dwell.
    log : (B,) int
        Which log a block comes from.
    instrumented : bool
        Whether the parts hold ``[V W τ]``, with instruments V that stand for the k columns of W.
    """

    columns: tuple[str, ...]
    parts: tuple[ActuatorBlocks, ...]
    counts: np.ndarray
    data: np.ndarray
    log: np.ndarray
    instrumented: bool = False

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
        wide = (W,) if instruments is None else (instruments, W)
        first = np.unique(log, return_index=True)[1]
        ends = [*first[1:], len(log)]
        at = np.array([s for a, b in zip(first, ends, strict=True) for s in range(a, b, size)])
        parts = []
        for a in range(tau.shape[1]):
            rows = np.column_stack([*(x[:, a] for x in wide), tau[:, a]])
            seen = np.flatnonzero(rows[:, :-1].any(0))
            basis = choose_basis(rows, seen)
            Z = rows[:, [*seen, -1]] @ invert_basis(basis)
            sums = np.add.reduceat(Z, at, axis=0)
            parts.append(ActuatorBlocks(seen, basis, hold_blocks(Z, at), sums))
        counts = np.diff([*at, len(log)])
        log, has = np.asarray(log)[at], instruments is not None
        some = np.ones(tau.shape, int) if moves is None else moves.astype(int)
        data = np.add.reduceat(some, at, axis=0)
        return Information(tuple(columns), tuple(parts), counts, data, log, has)

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
        rows: np.ndarray = np.maximum(self.data.sum(0), 1)
        return rows

    @cached_property
    def _made(self) -> dict[Any, Any]:
        return {}

    def remember(self, key: Any, make: Callable[[], Any]) -> Any:
        """Return what is made of the sums over all blocks: a fit asks for the same many times."""
        # How much of what is made of the sums over all blocks is kept.
        return remember(self._made, key, make, 4)

    @property
    def _width(self) -> int:
        return self.size * (1 + self.instrumented)

    def __getstate__(self) -> dict[str, Any]:
        """Return its fields: what follows from them is neither sent to workers nor part of keys."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @cached_property
    def joint(self) -> Information:
        """The information of ``[V W τ]``, of 2k columns: instruments, then those they stand for.

        With its factor ``R``, ``(Vᵀ W)⁻¹ Vᵀ τ`` is ``R[:k, k:2k]⁻¹ R[:k, 2k]`` [Janot 2014].
        """
        names = (*(f"instrument of {c}" for c in self.columns), *self.columns)
        return Information(names, self.parts, self.counts, self.data, self.log)

    @property
    def torque(self) -> Array:
        """Each actuator's sum of squares of its torque, (n,)."""
        return self.squares(np.eye(self.size + 1)[:, -1])

    @property
    def variation(self) -> Array:
        """Each actuator's sum of squares of its torque about its mean, (n,): its own scale."""
        parts = self.of_actuators(np.eye(self.size + 1)[:, [-1]])
        total = np.array([part.sums.sum(0) @ own[:, 0] for part, own in parts])
        about: Array = np.maximum(self.torque - total**2 / self.rows_each, 0.0)
        return about

    def of_actuators(self, change: Array) -> Iterator[tuple[ActuatorBlocks, Array]]:
        """Yield the blocks of each actuator with ``[W τ] change`` in their coordinates, (r, q).

        Parameters
        ----------
        change : (k + 1, q)
        """
        for part in self.parts:
            own, columns = self._own(part)
            yield part, own @ change[[*columns, self.size]]

    @cached_property
    def _places(self) -> list[np.ndarray]:
        """Where each column, and the torque, is among those of an actuator; else -1, (k + 1,)."""
        places = [np.full(self.size + 1, -1) for _ in self.parts]
        for place, part in zip(places, self.parts, strict=True):
            place[[*part.columns, self.size]] = np.arange(len(part.columns) + 1)
        return places

    def between(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return products of some columns (a,) with others (b,) over all rows; k is the torque."""
        out = np.zeros((len(some), len(others)))
        for place, part in zip(self._places, self.parts, strict=True):
            a, b = place[some], place[others]
            here, there = np.flatnonzero(a >= 0), np.flatnonzero(b >= 0)
            if len(here) and len(there):
                out[np.ix_(here, there)] += part.total[np.ix_(a[here], b[there])]
        return out

    def within(self, sets: np.ndarray) -> Array:
        """Return products of sets of columns (s, k) among themselves, (s, k, k)."""
        out = np.zeros((*sets.shape, sets.shape[1]))
        for place, part in zip(self._places, self.parts, strict=True):
            at = place[sets]
            act = np.flatnonzero((at >= 0).any(1))
            if len(act):
                at = at[act]
                on = (at >= 0).astype(float)
                own = part.total[np.maximum(at, 0)[:, :, None], np.maximum(at, 0)[:, None, :]]
                out[act] += own * on[:, :, None] * on[:, None, :]
        return out

    def squares(self, change: Array) -> Array:
        """Return each actuator's sum of squares of ``[W τ] change``, (n,) or (n, m).

        Parameters
        ----------
        change : (k + 1,) or (k + 1, m)
        """
        rows = (F @ change[[*columns, self.size]] for columns, F in self._factors)
        return np.array([np.square(own).sum(0) for own in rows])

    def squares_of_blocks(self, change: Array) -> Array:
        """Return each actuator's sum of squares of ``[W τ] x`` in each block, (…, B, n).

        Parameters
        ----------
        change : (…, B, k + 1) or (k + 1,)
            x of each block, or of all.
        """
        out = []
        for part, basis in self.of_actuators(np.eye(self.size + 1)):
            own = (change @ basis.T)[..., None]
            Z = part.blocks @ own
            out.append((Z * own if part.squared else Z * Z).sum((-2, -1)))
        return np.stack(out, -1)

    def products(self, weights: Array, left: Array, right: Array) -> Array:
        """Return ``([W τ] left)ᵀ ([W τ] right)`` of each block, actuators weighted, (B, p, q).

        Parameters
        ----------
        weights : (n,)
        left, right : (k + 1, p) and (k + 1, q)
        """
        out = np.zeros((len(self.counts), left.shape[1], right.shape[1]))
        p = left.shape[1]
        inside = p <= right.shape[1] and np.array_equal(left, right[:, :p])
        both = zip(weights, self.of_actuators(left), self.of_actuators(right), strict=True)
        rows: list[tuple[ActuatorBlocks, Array]] = []
        for weight, (part, one), (_, other) in both:
            if not part.squared:
                turn = other if inside else np.hstack([one, other])
                rows.append((part, np.sqrt(weight) * turn))
                continue
            for at in few_at_once(len(out), out[:1].nbytes + part.blocks[:1].nbytes):
                out[at] += part.products(weight * one, other, at)
        # Rows of all actuators beside each other: one product a block, and not one for each.
        own = sum(part.blocks[:1].nbytes for part, _ in rows)
        for at in few_at_once(len(out) if rows else 0, 2 * (out[:1].nbytes + own)):
            Z = np.concatenate([part.blocks[at] @ turn for part, turn in rows], axis=1)
            out[at] += Z[:, :, :p].transpose(0, 2, 1) @ Z[:, :, 0 if inside else p :]
        return out

    def factor(self, weights: Array | None = None) -> Array:
        """Return R (k + 1, k + 1), upper triangular, with ``RᵀR = [W τ]ᵀ [W τ]``."""
        w = np.ones(self.actuators) if weights is None else np.asarray(weights, float)
        found: Array = self.remember(w.tobytes(), partial(self._factor, w)).copy()
        return found

    @cached_property
    def _factors(self) -> list[tuple[np.ndarray, Array]]:
        """Columns W (v,) that each actuator can see, and a triangular factor (…, v + 1) of them."""
        found = []
        for part in self.parts:
            own, columns = self._own(part)
            found.append((columns, triangular_factor(part.root @ own)))
        return found

    def _factor(self, weights: Array) -> Array:
        """Return a factor of weighted rows."""
        every = zip(np.sqrt(weights), self._factors, strict=True)
        rows = [w * _spread(F, columns, self.size) for w, (columns, F) in every]
        return triangular_factor(np.vstack([*rows, np.zeros((self.size + 1, self.size + 1))]))

    def _own(self, part: ActuatorBlocks) -> tuple[Array, np.ndarray]:
        """Return an actuator's basis of the columns W that it can see, and which these are."""
        instruments = self._width - self.size
        seen = part.columns >= instruments
        return part.coordinates[:, np.append(seen, True)], part.columns[seen] - instruments

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
        own = np.zeros((k + 1, m + 1))
        own[:k, :m] = M
        own[k, m] = 1.0
        if held is not None:
            own[:k, m] = -held
        map_ = block_diag(M, own) if self.instrumented else own
        parts = tuple(part.reduce(map_) for part in self.parts)
        return replace(self, columns=tuple(columns), parts=parts)

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

    def summed(self, members: Array) -> Information:
        """Return a block for each row of members (F, B): blocks counted so often, added up."""
        weights, every = np.asarray(members, float), np.arange(len(members))
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
        merged = replace(self.summed(owner == np.arange(len(at))[:, None]), **what)
        for own, part in zip(merged.parts, self.parts, strict=True):  # sums over all are the same
            vars(own)["root"] = part.root
        return merged

    def __add__(self, other: Information) -> Information:
        """Return the information of both; blocks and logs stay apart."""
        if (self.columns, self.instrumented) != (other.columns, other.instrumented):
            raise ValueError("only information about the same columns can be added")
        later = other.log + (self.log.max(initial=-1) + 1)
        return Information(
            self.columns,
            tuple(a.join(b) for a, b in zip(self.parts, other.parts, strict=True)),
            np.concatenate([self.counts, other.counts]),
            np.concatenate([self.data, other.data]),
            np.concatenate([self.log, later]),
            self.instrumented,
        )


def _spread(F: Array, columns: np.ndarray, size: int) -> Array:
    """Return the rows (r, v + 1) of some columns and the torque over so many columns."""
    wide = np.zeros((len(F), size + 1))
    wide[:, [*columns, size]] = F
    return wide


# Gathered from a regression, chunk by chunk, here or on workers.


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
