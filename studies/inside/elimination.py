"""Pruning: the walk from all parameters down to none, with held-out errors at every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from identifiability.estimation.evidence import Score
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.prune.elimination import Path, find_path, walk
from identifiability.workflows.prune.folds import FoldFits, WhitenedRegression
from identifiability.workflows.prune.moves import Move, propose_moves
from inside.pair import Array, Pair, all_rows, difference, timed


@dataclass(frozen=True)
class RowRefits:
    """Fits to everything and without each fold, each by least squares on all rows.

    Attributes
    ----------
    folds : WhitenedRegression
    Y, target : (R, k), (R,)
        Rows in the coordinates of the folds.
    stretch, joint : (R,) int
        Block and joint of each row.
    own : (R,)
        What the square of a weighted row counts in the units of its joint.
    fixed : (r, k)
        Constraints so far, ``fixed @ y = 0``.
    """

    folds: WhitenedRegression
    Y: Array
    target: Array
    stretch: np.ndarray
    joint: np.ndarray
    own: Array
    fixed: Array

    @cached_property
    def free(self) -> Array:
        """A basis of what the constraints leave free, (k, m)."""
        return null_space(self.fixed, rcond=1e-7)

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
        rest = [self.solve(train[self.stretch]) for train in self.folds.folds.train]
        return np.array([self.solve(), *rest]) - self.folds.centre

    @cached_property
    def C(self) -> Array:
        """Inverse information of everything, (k, k)."""
        part = self.Y @ self.free
        return self.free @ np.linalg.inv(part.T @ part) @ self.free.T

    def constrain(self, L: Array, _model: Array | None = None) -> RowRefits:
        """Return the fits under more constraints."""
        return replace(self, fixed=np.vstack([self.fixed, L]))


class RowFit(FoldFits):
    """The fits that the walk asks for, each from all rows."""

    def _rise(self, L: Array) -> tuple[float, int]:
        then = self.refits.constrain(L)
        return then.rss - self.refits.rss, self.refits.free.shape[1] - then.free.shape[1]

    def costs(self, moves: Sequence[Move]) -> Array:
        """Return the rise of the sum of squares per parameter, move by move."""
        rises = [self._rise(self.rows(m)) for m in moves]
        return np.array([rise / max(rank, 1) for rise, rank in rises])

    @property
    def score(self) -> Score:
        """What the model predicts of each fold; its squares are all that is compared."""
        rows, y, test = self.refits, self.y[1:], self.whitened.folds.test[self.refits.stretch]
        residual = rows.target - np.einsum("rk,rk->r", rows.Y, y[test])
        squares = np.zeros((len(y), int(rows.joint.max()) + 1))
        np.add.at(squares, (test, rows.joint), rows.own * residual**2)
        return replace(super().score, squares=squares)


def measure(analysis: Analysis, repeats: int) -> Pair:
    """Walk down the unpruned model, from Gram matrices and from rows."""
    full = analysis.full
    information = full.submodel.reduce(analysis.information)
    suggested = propose_moves(analysis.structure, full.submodel.columns)
    nonnegative = np.asarray(full.submodel.nonnegative)

    search = find_path(information, nonnegative, suggested=suggested)
    ours, path = timed(lambda: walk(search.whitened.fit(), search.plan), repeats)

    folds, kept = search.whitened, list(search.full.kept)
    rows = all_rows(analysis, full.submodel, information)
    W, tau = rows.weighted(search.full.weights)
    samples, n = rows.tau.shape
    stretch, joint = np.repeat(rows.block, n), np.tile(np.arange(n), samples)
    own = np.tile(1.0 / search.full.weights, samples)
    none = np.empty((0, folds.size))
    some = folds.fit()

    def naive() -> Path:
        refits = RowRefits(folds, W[:, kept] @ folds.inverse, tau, stretch, joint, own, none)
        return walk(RowFit(folds, some.partition, some.tests, some.seen, refits), search.plan)

    slow, other = timed(naive)
    return Pair(
        "pruning", "every candidate and every fold refitted to all rows",
        f"{len(path.steps)} models of up to {folds.size} parameters, {folds.folds.count} folds",
        ours, slow, _apart(path, other), 1e-6, "held-out errors; the moves must be the same",
    )  # fmt: skip


def _apart(a: Path, b: Path) -> float:
    """Return the largest relative difference of held-out errors; infinite for other moves."""
    moves = [
        [s.move and (s.move.kind, s.move.zero, s.move.tie) for s in path.steps] for path in (a, b)
    ]
    if moves[0] != moves[1]:
        return float("inf")
    return difference([s.score.squares for s in a.steps], [s.score.squares for s in b.steps])
