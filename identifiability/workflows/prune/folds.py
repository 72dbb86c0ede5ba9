"""Held-out errors of many models of one regression, from `Information` alone.

Every model is the full one under linear constraints (a column zero, two columns equal); its fits
to everything and without each fold are the estimator's own (`estimation.refits`). The coordinates
are those in which the full information is the unit matrix: nothing is lost by squaring.

Two things make up the error of a model on motion that it was not fitted to. Stretches of the log
that a fit has not seen show what the model lacks and what noise does to it along *this* motion. A
log is one path through the joints' ranges, though: what the fits to its parts disagree on weighs
more on another. So the scatter of the fits (jackknife) is also weighed on states in which all
joints take positions, velocities and accelerations within the ranges of the log independently.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.refits import Asked, Refits, UpdatedRefits, normal_equations
from identifiability.estimation.torque_errors import divide_blocks
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.moves import Move, Partition

#: A constraint whose share of its first variance is below this holds already.
HELD = 1e-10


@frozen(kw_only=True)
class Folds:
    """Blocks of a regression in coordinates ``y = R x`` in which the full information is I.

    Attributes
    ----------
    columns : tuple of str
    inverse : (k, k)
        ``x = inverse @ y``.
    centre : (k,)
        y of the full fit.
    scale : float
        Root of its residual sum of squares.
    blocks : (B, k + 1, k + 1)
        Gram matrices of the blocks; residual ``Z (centre - y, scale)``.
    stretch : (B,) int
        Stretch that a block belongs to.
    fold : (S,) int
        Fold that a stretch belongs to.
    unseen : (k, k)
        Gram matrix of as many states drawn from the ranges of the log; zero without.
    nonnegative : (k,) bool
    samples : int
        Of the logs.
    asked : Asked or None
        What refits; None where updates of `moments` do.
    moments : (B, k + 1, k + 1)
        Normal equations by block; of least squares the `blocks`.
    """

    columns: tuple[str, ...]
    inverse: Array
    centre: Array
    scale: float
    blocks: Array
    stretch: np.ndarray
    fold: np.ndarray
    unseen: Array
    nonnegative: np.ndarray
    samples: int
    asked: Asked | None
    moments: Array

    @property
    def size(self) -> int:
        """Number of columns k."""
        return len(self.columns)

    @property
    def count(self) -> int:
        """Number of folds F."""
        return int(self.fold.max()) + 1

    def whiten(self, rows: Array) -> Array:
        """Return constraints ``L x = 0`` (r, k) in the coordinates y, rows of unit length."""
        L = rows @ self.inverse
        unit: Array = L / np.linalg.norm(L, axis=1, keepdims=True)
        return unit

    def fit(self, counts: Array | None = None) -> Fit:
        """Return the fits of all columns to everything and to each fold's rest.

        Parameters
        ----------
        counts : (B,), optional
            How often each block counts, for a bootstrap replicate.
        """
        weights = np.ones(len(self.blocks)) if counts is None else counts
        S, F = len(self.fold), self.count
        member = np.zeros((S, len(self.blocks)))
        member[self.stretch, np.arange(len(self.blocks))] = weights
        shape = (-1, self.size + 1, self.size + 1)
        pair = (self.blocks, self.moments)
        parts, moments = ((member @ x.reshape(len(x), -1)).reshape(shape) for x in pair)
        of_fold = (np.arange(F)[:, None] == self.fold).astype(float)
        refits: Refits
        if self.asked is None:
            held = (of_fold @ moments.reshape(S, -1)).reshape(shape)
            refits = UpdatedRefits.of(held, self.centre, self.scale)
        else:
            left_out = np.vstack([np.zeros(S), of_fold])[:, self.stretch]
            refits = self.asked.start(weights, 1.0 - left_out)
        return Fit(self, Partition.of(self.columns), parts, refits)


@frozen
class Fit:
    """Fits of one model to everything (first) and to the rest of each of F folds.

    Attributes
    ----------
    folds : Folds
    partition : Partition
        What became of each column.
    parts : (S, k + 1, k + 1)
        Gram matrix of each stretch.
    refits : Refits
    """

    folds: Folds
    partition: Partition
    parts: Array
    refits: Refits

    @property
    def y(self) -> Array:
        """Parameters of each fit in the coordinates of the folds, (F + 1, k)."""
        return self.folds.centre + self.refits.delta

    @property
    def values(self) -> Array:
        """Parameters of each fit, (F + 1, k)."""
        x: Array = self.y @ self.folds.inverse.T
        return x

    def rows(self, move: Move) -> Array:
        """Return what a move denies, ``L y = 0`` with L (r, k); none if it is void."""
        return self.folds.whiten(self.partition.rows(move))

    def after(self, move: Move) -> Fit:
        """Return the fits of the model after a move."""
        L, partition = self.rows(move), self.partition.apply(move)
        values, vectors = np.linalg.eigh(L @ self.refits.C @ L.T)
        L = vectors[:, values > HELD].T @ L
        refits = self.refits.constrain(L, partition.matrix) if len(L) else self.refits
        return replace(self, partition=partition, refits=refits)

    def costs(self, moves: Sequence[Move]) -> Array:
        """Return the rise of the estimator's loss per parameter that each move takes away."""
        rows = [self.partition.rows(m) for m in moves]
        if not rows:
            return np.empty(0)
        L = self.folds.whiten(np.concatenate(rows))
        d = L @ self.y[0]
        variance = np.einsum("ci,ij,cj->c", L, self.refits.C, L)
        free = variance > HELD
        single = np.where(free, d**2 / np.where(free, variance, 1.0), 0.0)
        costs, at = [], 0
        for r in rows:
            if len(r) == 1:
                costs.append(float(single[at]))
            else:
                rise, rank = self._rise(L[at : at + len(r)])
                costs.append(rise / max(rank, 1))
            at += len(r)
        return np.array(costs)

    def cost(self, move: Move) -> float:
        """Return the rise of the estimator's loss under a move; the sum of squares has no other."""
        return self._rise(self.rows(move))[0]

    def _rise(self, L: Array) -> tuple[float, int]:
        """Return the rise of the loss under more constraints L y = 0, and their rank."""
        d = L @ self.y[0]
        values, vectors = np.linalg.eigh(L @ self.refits.C @ L.T)
        free = values > HELD
        return float(((vectors.T @ d)[free] ** 2 / values[free]).sum()), int(free.sum())

    def jackknife(self, move: Move) -> tuple[Array, Array]:
        """Return what a move denies (r,) and its covariance by leaving out folds (r, r)."""
        y = self.y @ self.rows(move).T
        F = len(y) - 1
        apart = y[1:] - y[1:].mean(0)
        return y[0], (F - 1) / F * apart.T @ apart

    def errors(self) -> Errors:
        """Return the held-out errors."""
        f, delta = self.folds, self.refits.delta[1:]
        F = len(delta)
        z = np.column_stack([-delta, np.full(F, f.scale)])[f.fold]
        held = np.einsum("si,sij,sj->s", z, self.parts, z)
        apart = delta - delta.mean(0)
        scatter = (F - 1) / F * np.einsum("fi,ij,fj->f", apart, f.unseen, apart)
        return Errors(held, scatter)

    def violations(self) -> int:
        """Return how many free parameters have a sign that physics forbids."""
        size = max(float(np.linalg.norm(self.folds.centre)), 1e-300)
        tiny = 1e-9 * np.linalg.norm(self.folds.inverse, axis=1) * size
        return int((self.folds.nonnegative & (self.values[0] < -tiny)).sum())


@frozen
class Errors:
    """Sums of squares on motion that the fits have not seen.

    Attributes
    ----------
    held : (S,) [weighted torque²]
        Of each stretch under the fit to the others.
    scatter : (F,) [weighted torque²]
        What the scatter of the fits does on states drawn from the ranges of the log, by fold.
    """

    held: Array
    scatter: Array

    @property
    def total(self) -> float:
        """The sum of both."""
        return float(self.held.sum() + self.scatter.sum())

    @property
    def standard_error(self) -> float:
        """Standard error of the total, from the scatter over stretches and folds."""
        return _spread(self.held, self.scatter)

    def above(self, other: Errors) -> tuple[float, float]:
        """Return by how much the total is larger than another's, and the SE of that."""
        held, scatter = self.held - other.held, self.scatter - other.scatter
        return float(held.sum() + scatter.sum()), _spread(held, scatter)


def _spread(held: Array, scatter: Array) -> float:
    # With one log, stretches and folds are the same pieces and their errors rise together.
    if len(held) == len(scatter):
        return float((held + scatter).std(ddof=1) * np.sqrt(len(held)))
    variances = [x.var(ddof=1) * len(x) for x in (held, scatter) if len(x) > 1]
    return float(np.sqrt(sum(variances)))


def gather_folds(
    information: Information, full: Estimate, nonnegative: np.ndarray, unseen: Array | None = None
) -> Folds:
    """Return the folds of a regression whose columns are independent.

    Parameters
    ----------
    information : Information
    full : Estimate
        Whose weights (n,) the actuators have, and whose estimator refits.
    nonnegative : (k,) bool
    unseen : (m, n, k), optional
        Regressor at states that are not in the logs.
    """
    k = information.size
    R = full.estimator.loss(information, full)
    length = float(np.linalg.norm(R[:, k]))
    R[k, k] = max(abs(R[k, k]), 1e-9 * length, 1e-300)
    inverse = np.linalg.inv(R)
    change = information.basis @ inverse
    stretch, fold = divide_blocks(information.log, information.counts)
    centre, turned = R[:k, k].copy(), inverse[:k, :k]
    blocks = change.T @ information.blocks(full.weights) @ change
    moments = normal_equations(information, full, R, blocks)
    return Folds(
        columns=information.columns,
        inverse=turned,
        centre=centre,
        scale=float(R[k, k]),
        blocks=blocks,
        moments=blocks if moments is None else moments,
        stretch=stretch,
        fold=fold,
        unseen=_unseen_gram(unseen, turned, full.weights, information.samples),
        nonnegative=np.asarray(nonnegative, bool),
        samples=information.samples,
        asked=Asked(full.estimator, information, turned, centre) if moments is None else None,
    )


def _unseen_gram(unseen: Array | None, inverse: Array, weights: Array, samples: int) -> Array:
    k = len(inverse)
    if unseen is None or not len(unseen):
        return np.zeros((k, k))
    Z = unseen @ inverse
    gram: Array = np.einsum("map,maq,a->pq", Z, Z, weights) * (samples / len(unseen))
    return gram
