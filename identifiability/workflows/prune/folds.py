"""Held-out errors of many models of one regression, from `Information` alone.

Every model is the full one under linear constraints (a column zero, two columns equal), so it is
reached from the full fit by an update that costs k², for all folds at once. The coordinates are
those in which the full information is the unit matrix: nothing is lost by squaring.

Two things make up the error of a model on motion that it was not fitted to. Stretches of the log
that a fit has not seen show what the model lacks and what noise does to it along *this* motion. A
log is one path through the joints' ranges, though: what the fits to its parts disagree on weighs
more on another. So the scatter of the fits (jackknife) is also weighed on states in which all
joints take positions, velocities and accelerations within the ranges of the log independently.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Stretches of time that errors are counted over; with one log also the folds.
STRETCHES = 16

#: Fewest stretches of a log among several.
FEWEST = 4

#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE = 1e-9

#: A constraint whose share of its first variance is below this holds already.
HELD = 1e-10


#: From this many logs on, whole logs are left out; fewer are divided into stretches.
FEWEST_LOGS = 4


@frozen
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
        Root of the full fit's residual sum of squares.
    blocks : (B, k + 1, k + 1)
        Gram matrices of the blocks; residual ``Z (centre - y, scale)``.
    stretch : (B,) int
        Stretch that a block belongs to.
    fold : (S,) int
        Fold that a stretch belongs to.
    unseen : (k, k)
        Gram matrix of as many states drawn from the ranges of the log; zero without.
    nonnegative : (k,) bool
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

    @property
    def size(self) -> int:
        """Number of columns k."""
        return len(self.columns)

    def whiten(self, rows: Array) -> Array:
        """Return constraints ``L x = 0`` (r, k) in the coordinates y, rows of unit length."""
        L = rows @ self.inverse
        unit: Array = L / np.linalg.norm(L, axis=1, keepdims=True)
        return unit

    def fit(self, counts: Array | None = None) -> Fit:
        """Return the unconstrained fits to everything and to each fold's rest.

        Parameters
        ----------
        counts : (B,), optional
            How often each block counts, for a bootstrap replicate.
        """
        weights = np.ones(len(self.blocks)) if counts is None else counts
        S, F = len(self.fold), int(self.fold.max()) + 1
        member = np.zeros((S, len(self.blocks)))
        member[self.stretch, np.arange(len(self.blocks))] = weights
        shape = (-1, self.size + 1, self.size + 1)
        parts = (member @ self.blocks.reshape(len(self.blocks), -1)).reshape(shape)
        of_fold = np.zeros((F, S))
        of_fold[self.fold, np.arange(S)] = 1.0
        held = (of_fold @ parts.reshape(S, -1)).reshape(shape)
        whole = held.sum(0)
        A = np.concatenate([whole[None], whole - held])
        k = self.size
        C = np.linalg.inv(A[:, :k, :k] + RIDGE * np.eye(k))
        delta = np.einsum("fij,fj->fi", C, A[:, :k, k]) * self.scale
        return Fit(self, parts, delta, 0.5 * (C + C.transpose(0, 2, 1)))


@frozen
class Fit:
    """Fits of one model to everything (first) and to the rest of each fold.

    Attributes
    ----------
    folds : Folds
    parts : (S, k + 1, k + 1)
        Gram matrix of each stretch.
    delta : (F + 1, k)
        ``y - centre``.
    C : (F + 1, k, k)
        Inverse information under the constraints so far.
    """

    folds: Folds
    parts: Array
    delta: Array
    C: Array

    @property
    def values(self) -> Array:
        """Parameters of each fit, (F + 1, k)."""
        x: Array = (self.folds.centre + self.delta) @ self.folds.inverse.T
        return x

    def cost(self, L: Array) -> tuple[float, int]:
        """Return the rise of the sum of squares under more constraints L y = 0, and their rank."""
        d = L @ (self.folds.centre + self.delta[0])
        values, vectors = np.linalg.eigh(L @ self.C[0] @ L.T)
        free = values > HELD
        return float(((vectors.T @ d)[free] ** 2 / values[free]).sum()), int(free.sum())

    def costs(self, L: Array) -> tuple[Array, np.ndarray]:
        """Return the same for each row of L by itself: rises (c,) and whether it is free (c,)."""
        d = L @ (self.folds.centre + self.delta[0])
        variance = np.einsum("ci,ij,cj->c", L, self.C[0], L)
        free = variance > HELD
        return np.where(free, d**2 / np.where(free, variance, 1.0), 0.0), free

    def constrain(self, L: Array) -> Fit:
        """Return the fits under more constraints L y = 0."""
        values, vectors = np.linalg.eigh(L @ self.C[0] @ L.T)
        L = vectors[:, values > HELD].T @ L
        if not len(L):
            return self
        CL = self.C @ L.T
        gain = CL @ np.linalg.inv(L @ CL)
        miss = (self.folds.centre + self.delta) @ L.T
        delta = self.delta - np.einsum("fij,fj->fi", gain, miss)
        return Fit(self.folds, self.parts, delta, self.C - gain @ CL.transpose(0, 2, 1))

    def jackknife(self, L: Array) -> tuple[Array, Array]:
        """Return ``L y`` (r,) and its covariance by leaving out folds (r, r)."""
        y = (self.folds.centre + self.delta) @ L.T
        F = len(y) - 1
        apart = y[1:] - y[1:].mean(0)
        return y[0], (F - 1) / F * apart.T @ apart

    def errors(self) -> Errors:
        """Return the held-out errors."""
        f = self.folds
        z = np.column_stack([-self.delta[1:], np.full(len(self.delta) - 1, f.scale)])[f.fold]
        held = np.einsum("si,sij,sj->s", z, self.parts, z)
        apart = self.delta[1:] - self.delta[1:].mean(0)
        F = len(apart)
        scatter = (F - 1) / F * np.einsum("fi,ij,fj->f", apart, f.unseen, apart)
        return Errors(held, scatter)

    def violations(self) -> int:
        """Return how many free parameters have a sign that physics forbids."""
        x = self.values[0]
        tiny = 1e-9 * np.linalg.norm(self.folds.inverse, axis=1) * max(
            float(np.linalg.norm(self.folds.centre)), 1e-300
        )  # fmt: skip
        return int((self.folds.nonnegative & (x < -tiny)).sum())


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
    information: Information,
    weights: Array,
    nonnegative: np.ndarray,
    unseen: Array | None = None,
) -> Folds:
    """Return the folds of a regression whose columns are independent.

    Parameters
    ----------
    information : Information
    weights : (n,)
        Of the actuators.
    nonnegative : (k,) bool
    unseen : (m, n, k), optional
        Regressor at states that are not in the logs.
    """
    k = information.size
    R = information.factor(weights)
    length = float(np.linalg.norm(R[:, k]))
    R[k, k] = max(abs(R[k, k]), 1e-9 * length, 1e-300)
    inverse = np.linalg.inv(R)
    change = information.basis @ inverse
    stretch, fold = _divide(information)
    return Folds(
        information.columns, inverse[:k, :k], R[:k, k].copy(), float(R[k, k]),
        change.T @ information.blocks(weights) @ change, stretch, fold,
        _unseen_gram(unseen, inverse[:k, :k], weights, information.samples),
        np.asarray(nonnegative, bool),
    )  # fmt: skip


def _unseen_gram(unseen: Array | None, inverse: Array, weights: Array, samples: int) -> Array:
    k = len(inverse)
    if unseen is None or not len(unseen):
        return np.zeros((k, k))
    Z = unseen @ inverse
    gram: Array = np.einsum("map,maq,a->pq", Z, Z, weights) * (samples / len(unseen))
    return gram


def _divide(information: Information) -> tuple[np.ndarray, np.ndarray]:
    """Return the stretch of each block and the fold of each stretch."""
    logs = np.unique(information.log)
    stretch = np.empty(len(information.counts), int)
    fold: list[int] = []
    for k, log in enumerate(logs):
        rows = np.flatnonzero(information.log == log)
        share = information.counts[rows].sum() / information.samples
        wanted = STRETCHES if len(logs) == 1 else max(FEWEST, round(STRETCHES * share))
        pieces = min(wanted, len(rows))
        stretch[rows] = len(fold) + np.arange(len(rows)) * pieces // len(rows)
        # Two or three folds cannot contradict anything: then stretches of the logs are the folds.
        whole = len(logs) >= FEWEST_LOGS
        fold += [k] * pieces if whole else list(range(len(fold), len(fold) + pieces))
    return stretch, np.array(fold)
