"""Pruning: the walk from all parameters down to none, with held-out errors at every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from identifiability.workflows.analyze import Analysis
from identifiability.workflows.prune.elimination import Path, walk
from identifiability.workflows.prune.folds import Errors, Fit, Folds
from identifiability.workflows.prune.moves import Move
from identifiability.workflows.prune.proposals import propose_moves
from identifiability.workflows.prune.search import find_path
from inside.pair import Array, Pair, all_rows, difference, timed


@dataclass(frozen=True)
class RowRefits:
    """Fits to everything and without each fold, each by least squares on all rows.

    Attributes
    ----------
    folds : Folds
    Y, target : (R, k), (R,)
        Rows in the coordinates of the folds.
    stretch, joint : (R,) int
    own : (R,)
        What the square of a weighted row counts on its joint's own scale.
    held : (r, k)
        Constraints so far, ``held @ y = 0``.
    """

    folds: Folds
    Y: Array
    target: Array
    stretch: np.ndarray
    joint: np.ndarray
    own: Array
    held: Array

    @cached_property
    def free(self) -> Array:
        """A basis of what the constraints leave free, (k, m)."""
        return null_space(self.held, rcond=1e-7)

    def solve(self, rows: np.ndarray | slice = slice(None)) -> Array:
        """Return the fit to some rows, (k,)."""
        part = self.Y[rows] @ self.free
        return self.free @ np.linalg.lstsq(part, self.target[rows], rcond=None)[0]

    @property
    def rss(self) -> float:
        """The residual sum of squares of the fit to everything."""
        residual = self.target - self.Y @ self.solve()
        return float(residual @ residual)

    @cached_property
    def delta(self) -> Array:
        """Each fit less that of all columns, (F + 1, k)."""
        fold = self.folds.fold[self.stretch]
        rest = [self.solve(fold != k) for k in range(self.folds.count)]
        return np.array([self.solve(), *rest]) - self.folds.centre

    @cached_property
    def C(self) -> Array:
        """Inverse information of everything, (k, k)."""
        part = self.Y @ self.free
        return self.free @ np.linalg.inv(part.T @ part) @ self.free.T

    def constrain(self, L: Array, _model: Array | None = None) -> RowRefits:
        """Return the fits under more constraints."""
        return replace(self, held=np.vstack([self.held, L]))


class RowFit(Fit):
    """The fits that the walk asks for, each from all rows."""

    def _rise(self, L: Array) -> tuple[float, int]:
        then = self.refits.constrain(L)
        return then.rss - self.refits.rss, self.refits.free.shape[1] - then.free.shape[1]

    def costs(self, moves: Sequence[Move]) -> Array:
        """Return the rise of the sum of squares per parameter, move by move."""
        rises = [self._rise(self.rows(m)) for m in moves]
        return np.array([rise / max(rank, 1) for rise, rank in rises])

    def errors(self) -> Errors:
        """Return the held-out errors."""
        rows, y = self.refits, self.y[1:]
        residual = rows.target - np.einsum("rk,rk->r", rows.Y, y[self.folds.fold[rows.stretch]])
        shape = (len(self.folds.fold), int(rows.joint.max()) + 1)
        held = np.zeros(shape)
        np.add.at(held, (rows.stretch, rows.joint), rows.own * residual**2)
        return Errors(held, super().errors().scatter)


def measure(analysis: Analysis, repeats: int) -> Pair:
    """Walk down the unpruned model, from Gram matrices and from rows."""
    full = analysis.full
    information = full.rung.reduce(analysis.information)
    suggested = propose_moves(analysis.structure, full.rung.columns)
    nonnegative = np.asarray(full.rung.nonnegative)

    search = find_path(information, nonnegative, suggested=suggested)
    ours, path = timed(lambda: walk(search.folds.fit(), search.plan), repeats)

    folds, kept = search.folds, list(search.full.kept)
    rows = all_rows(analysis, full.rung, information)
    W, tau = rows.weighted(search.full.weights)
    samples, n = rows.tau.shape
    stretch, joint = np.repeat(folds.stretch[rows.block], n), np.tile(np.arange(n), samples)
    scale = 1.0 / (n * (rows.tau**2).sum(0))  # all joints alike in all
    own = np.tile(scale / search.full.weights, samples)
    none = np.empty((0, folds.size))
    some = folds.fit()

    def naive() -> Path:
        refits = RowRefits(folds, W[:, kept] @ folds.inverse, tau, stretch, joint, own, none)
        return walk(RowFit(folds, some.partition, some.scored, refits), search.plan)

    slow, other = timed(naive)
    return Pair(
        "pruning", "every candidate and every fold refitted to all rows",
        f"{len(path.steps)} models of up to {folds.size} parameters, {folds.fold.max() + 1} folds",
        ours, slow, _apart(path, other), 1e-6, "held-out errors; the moves must be the same",
    )  # fmt: skip


def _apart(a: Path, b: Path) -> float:
    """Return the largest relative difference of held-out errors; infinite for other moves."""
    moves = [
        [s.move and (s.move.kind, s.move.zero, s.move.tie) for s in path.steps] for path in (a, b)
    ]
    if moves[0] != moves[1]:
        return float("inf")
    return difference([s.errors.by_joint for s in a.steps], [s.errors.by_joint for s in b.steps])
