"""Pruning: the walk from all parameters down to none, with held-out errors at every step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import null_space

from identifiability.workflows.analyze import Analysis
from identifiability.workflows.prune.elimination import Path, walk
from identifiability.workflows.prune.folds import Errors, Fit
from identifiability.workflows.prune.proposals import propose_moves
from identifiability.workflows.prune.search import find_path
from inside.pair import Array, Pair, all_rows, difference, timed


@dataclass(frozen=True)
class RowFit(Fit):
    """The fits that the walk asks for, each by least squares on all rows.

    Attributes
    ----------
    Y, target : (R, k), (R,)
        Rows in the walk's coordinates.
    stretch : (R,) int
    held : (r, k)
        Constraints so far, ``held @ y = 0``.
    """

    Y: Array
    target: Array
    stretch: np.ndarray
    held: Array

    def _solve(self, free: Array, rows: np.ndarray | slice = slice(None)) -> Array:
        z = np.linalg.lstsq(self.Y[rows] @ free, self.target[rows], rcond=None)[0]
        return free @ z

    def _rss(self, y: Array) -> float:
        residual = self.target - self.Y @ y
        return float(residual @ residual)

    def _free(self, L: Array) -> Array:
        return null_space(np.vstack([self.held, L]), rcond=1e-7)

    def cost(self, L: Array) -> tuple[float, int]:
        """Return the rise of the sum of squares under more constraints, and their rank."""
        now = self._free(np.empty((0, self.held.shape[1])))
        then = self._free(L)
        rise = self._rss(self._solve(then)) - self._rss(self._solve(now))
        return rise, now.shape[1] - then.shape[1]

    def costs(self, L: Array) -> tuple[Array, np.ndarray]:
        """Return the same for each row of L by itself."""
        found = [self.cost(row[None]) for row in L]
        return np.array([c for c, _ in found]), np.array([r > 0 for _, r in found])

    def constrain(self, L: Array) -> Fit:
        """Return the fits under more constraints."""
        held = np.vstack([self.held, L])
        free = null_space(held, rcond=1e-7)
        folds = self.folds
        rest = [folds.fold[self.stretch] != fold for fold in range(int(folds.fold.max()) + 1)]
        y = [self._solve(free), *(self._solve(free, rows) for rows in rest)]
        C = free @ np.linalg.inv(free.T @ self.Y.T @ self.Y @ free) @ free.T
        return replace(self, held=held, delta=np.array(y) - folds.centre, C=C[None])

    def errors(self) -> Errors:
        """Return the held-out errors."""
        held = []
        for s, fold in enumerate(self.folds.fold):
            rows = self.stretch == s
            y = self.folds.centre + self.delta[1 + fold]
            held.append(float(((self.target[rows] - self.Y[rows] @ y) ** 2).sum()))
        return Errors(np.array(held), super().errors().scatter)


def measure(analysis: Analysis, repeats: int) -> Pair:
    """Walk down the unpruned model, from Gram matrices and from rows."""
    full = analysis.full
    information = full.rung.reduce(analysis.information)
    suggested = propose_moves(analysis.structure, full.rung.columns)
    nonnegative = np.asarray(full.rung.nonnegative)

    search = find_path(information, nonnegative, suggested=suggested)
    ours, path = timed(lambda: walk(search.folds.fit(), search.start, search.plan), repeats)

    folds, kept = search.folds, list(search.full.kept)
    rows = all_rows(analysis, full.rung, information)
    W, tau = rows.weighted(search.full.weights)
    stretch = np.repeat(folds.stretch[rows.block], rows.tau.shape[1])
    some = folds.fit()
    start = RowFit(
        folds, some.parts, some.delta, some.C, W[:, kept] @ folds.inverse, tau, stretch,
        np.empty((0, folds.size)),
    )  # fmt: skip

    def naive() -> Path:
        return walk(start.constrain(np.empty((0, folds.size))), search.start, search.plan)

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
    return difference([s.errors.total for s in a.steps], [s.errors.total for s in b.steps])
