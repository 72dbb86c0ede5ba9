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
from functools import cached_property

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.layout import divide_blocks
from identifiability.estimation.refits import Asked, Equations, Refits
from identifiability.estimation.torque_errors import joint_weights
from identifiability.estimation.updated_refits import UpdatedRefits
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.errors import (
    Errors,
    Scored,
    Unseen,
    factor_unseen,
    measure_errors,
    score_joints,
)
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
    scored : tuple of (ActuatorBlocks, (r, v), (r,))
        Blocks of each joint without instruments, and their coordinates of the v columns that it
        can see and of the full fit's residual, on the joint's own scale: fits weigh joints by
        their noise, but that says nothing of how much an error matters.
    stretch : (B,) int
        Stretch that a block belongs to.
    fold : (S,) int
        Fold that a stretch belongs to.
    unseen : tuple of ((r, v), (v,) int)
        Factor of the Gram matrix of as many states drawn from the ranges of the log, each joint on
        its own scale, and the columns that act on it there; without any r = 0.
    nonnegative : (k,) bool
    samples : int
        Of the logs.
    refitter : Equations or Asked
        What refits: updates of normal equations, those of least squares being the Gram matrix of
        ``Z`` where the residual is ``Z (centre - y, scale)``; or the estimator.
    """

    columns: tuple[str, ...]
    inverse: Array
    centre: Array
    scale: float
    scored: Scored
    stretch: np.ndarray
    fold: np.ndarray
    unseen: Unseen
    nonnegative: np.ndarray
    samples: int
    refitter: Equations | Asked

    @property
    def size(self) -> int:
        """Number of columns k."""
        return len(self.columns)

    @property
    def count(self) -> int:
        """Number of folds F."""
        return int(self.fold.max()) + 1

    def errors(self, grams: Sequence[Array], delta: Array) -> list[Errors]:
        """Return the held-out errors of M models, ``y - centre`` (M, F + 1, k) of their fits."""
        moved = delta[:, 1:] @ self.inverse.T
        return measure_errors(self.scored, self.unseen, grams, self.fold, moved)

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
        weights = np.ones(len(self.stretch)) if counts is None else counts
        of_joint = [part.merge_weighted(self.stretch, weights) for part, *_ in self.scored]
        fold = self.fold[self.stretch]
        refits: Refits
        if isinstance(self.refitter, Equations):
            held = self.refitter.of_folds(fold, counts)
            refits = UpdatedRefits.of(held, self.centre, self.scale)
        else:
            left_out = np.vstack([np.zeros(len(fold)), np.arange(self.count)[:, None] == fold])
            refits = self.refitter.start(weights, 1.0 - left_out)
        return Fit(self, Partition.of(self.columns), tuple(of_joint), refits)


@frozen
class Fit:
    """Fits of one model to everything (first) and to the rest of each of F folds.

    Attributes
    ----------
    folds : Folds
    partition : Partition
        What became of each column.
    scored : tuple of (S, r, r)
        Gram matrix of each stretch, of each joint.
    refits : Refits
    """

    folds: Folds
    partition: Partition
    scored: tuple[Array, ...]
    refits: Refits

    @property
    def y(self) -> Array:
        """Parameters of each fit in the coordinates of the folds, (F + 1, k)."""
        return self.folds.centre + self.refits.delta

    @cached_property
    def values(self) -> Array:
        """Parameters of each fit, (F + 1, k)."""
        x: Array = self.y @ self.folds.inverse.T
        return x

    @property
    def alone(self) -> Fit:
        """The fit to everything without the others."""
        assert isinstance(self.refits, UpdatedRefits)
        return replace(self, refits=self.refits.alone)

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
        variance = ((L @ self.refits.C) * L).sum(1)
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
        return self._errors

    @cached_property
    def _errors(self) -> Errors:
        return self.folds.errors(self.scored, self.refits.delta[None])[0]

    def along(self, held: Array, models: Sequence[tuple[Partition, int]]) -> list[Fit]:
        """Return the fits of nested models, for what they say and not for more moves.

        Parameters
        ----------
        held : (r, k)
            All constraints ``held y = 0``, those of this fit first.
        models : sequence of (Partition, int)
            And how many of the constraints hold in each.
        """
        refits = self.refits
        assert isinstance(refits, UpdatedRefits)
        delta = refits.along(held, [count for _, count in models])
        fits = [
            replace(self, partition=p, refits=replace(refits, held=held[:r], delta=d))
            for (p, r), d in zip(models, delta, strict=True)
        ]
        measured = self.folds.errors(self.scored, delta)
        for fit, errors in zip(fits, measured, strict=True):
            vars(fit)["_errors"] = errors  # those of all models at once are a tenth of the work
        return fits

    def violations(self) -> int:
        """Return how many free parameters have a sign that physics forbids."""
        size = max(float(np.linalg.norm(self.folds.centre)), 1e-300)
        tiny = 1e-9 * np.linalg.norm(self.folds.inverse, axis=1) * size
        return int((self.folds.nonnegative & (self.values[0] < -tiny)).sum())


def gather_folds(
    information: Information,
    full: Estimate,
    nonnegative: np.ndarray,
    unseen: Array | None = None,
    variation: Array | None = None,
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
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean (`torque_errors.joint_weights`); by default the
        torque's sum of squares.
    """
    k = information.size
    squares = information.torque if variation is None else variation
    scale = joint_weights(squares)
    R = full.estimator.loss(information, full)
    length = float(np.linalg.norm(R[:, k]))
    R[k, k] = max(abs(R[k, k]), 1e-9 * length, 1e-300)
    inverse = np.linalg.inv(R)
    stretch, fold = divide_blocks(information.log, information.counts)
    centre, turned = R[:k, k].copy(), inverse[:k, :k]
    equations = Equations.of(information, full, R, inverse)
    return Folds(
        columns=information.columns,
        inverse=turned,
        centre=centre,
        scale=float(R[k, k]),
        scored=score_joints(information, np.sqrt(scale), inverse[:, k] * R[k, k]),
        stretch=stretch,
        fold=fold,
        unseen=factor_unseen(unseen, scale, information.samples),
        nonnegative=np.asarray(nonnegative, bool),
        samples=information.samples,
        refitter=equations or Asked(full.estimator, information, turned, centre),
    )
