"""Fits of nested models to all blocks of time and without some.

Coordinates are ``y = R x`` in which the information of everything is the unit matrix.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.estimation.estimator import Estimate, combine
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE: Tolerance = 1e-9


@frozen
class Refits:
    """Fits of one model to everything (first) and to the rest of each of F folds.

    Attributes
    ----------
    centre : (k,)
        y of the fit of all columns to everything.
    grams, right : (F + 1, k, k) and (F + 1, k)
        ``grams (y - centre) = right`` of each fit without constraints.
    """

    centre: Array
    grams: Array
    right: Array

    @property
    def whole(self) -> Array:
        """``y - centre`` of the fit of all columns to everything, (k,)."""
        k = len(self.centre)
        return np.asarray(np.linalg.solve(self.grams[0] + RIDGE * np.eye(k), self.right[0]))

    def along(self, turn: Array, free: np.ndarray) -> Array:
        """Return ``y - centre`` of each fit of M nested models, (M, F + 1, k).

        The leading parts of one triangular factor solve them all.

        Parameters
        ----------
        turn : (k, k)
            Orthonormal; its first columns span what a model leaves free.
        free : (M,) int
            How many.
        """
        k, out = len(self.centre), np.empty((len(free), *self.right.shape))
        inside, c = np.arange(k)[:, None] < free, turn.T @ self.centre
        for f, (gram, right) in enumerate(zip(self.grams, self.right, strict=True)):
            A, b = turn.T @ gram @ turn, turn.T @ right
            half = solve_triangular(_root(A), np.eye(k), lower=True)
            moved = np.where(inside, 0.0, -c[:, None])
            for _ in range(2):  # the second time takes away what the ridge did to the first
                left = np.where(inside, b[:, None] - A @ moved, 0.0)
                moved += half.T @ np.where(inside, half @ left, 0.0)
            out[:, f] = (turn @ moved).T
        return out


def _root(A: Array) -> Array:
    """Return the lower triangular factor of curvature, which rounding may leave indefinite."""
    ridge = RIDGE * np.eye(len(A))
    try:
        return np.linalg.cholesky(A + ridge)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(A)
        return np.linalg.cholesky((vectors * np.maximum(values, 0.0)) @ vectors.T + ridge)


@frozen
class Equations:
    """Normal equations for `Refits`.

    Attributes
    ----------
    information : Information
        About k independent columns.
    full : Estimate
    R : (k + 1, k + 1)
        Its loss; equations are in ``R x``.
    grams : (B, k + 1, k + 1)
        Those of each block by least squares; of none by instruments, which are combined when they
        are asked for.
    """

    information: Information
    full: Estimate
    R: Array
    grams: Array

    @staticmethod
    def of(information: Information, full: Estimate, R: Array, inverse: Array) -> Equations:
        """Return them.

        Parameters
        ----------
        information, full, R
            As the attributes.
        inverse : (k + 1, k + 1)
            Of R: Gram matrices of ``[W τ] R⁻¹`` are the equations of least squares.
        """
        if full.estimator.instruments:
            return Equations(information, full, R, np.empty((0, *R.shape)))
        grams = information.products(full.weights, inverse, inverse)
        return Equations(information, full, R, grams)

    def start(self, train: np.ndarray) -> Refits:
        """Return the fits to all blocks, and to those of each fold's rest.

        Parameters
        ----------
        train : (F, B) bool
            Blocks that each fit rests on.
        """
        member = np.vstack([np.ones(train.shape[1]), train])
        grams, k = self.grams, len(self.R) - 1
        if self.full.estimator.instruments:
            edges = np.flatnonzero((np.diff(member, axis=1, prepend=-1.0) != 0).any(0))
            grams, member = self._by_instruments(self.information.merge(edges)), member[:, edges]
        sums = np.tensordot(member, grams, 1)
        # Gram matrices of Z where the residual is Z (centre - y, scale), scale its root of squares.
        return Refits(self.R[:k, k], sums[:, :k, :k], sums[:, :k, k] * self.R[k, k])

    def _by_instruments(self, information: Information) -> Array:
        """Return the normal equations of each block, (B, k + 1, k + 1).

        They are in ``R x``, less those of the fit, in units of ``R[k, k]``, and made symmetric, as
        their sum is.
        """
        k, R, fit = information.size, self.R, self.full
        found = replace(combine(information, fit.weights), value=fit.value[list(fit.kept)])
        A, c = found.moments(information, fit.weights)
        to_y = R[:k, :k] @ found.B  # of directions into coordinates of the loss
        turned = to_y @ A @ np.linalg.inv(to_y)
        out = np.zeros((len(A), k + 1, k + 1))
        out[:, :k, :k] = 0.5 * (turned + turned.swapaxes(1, 2))
        out[:, :k, k] = out[:, k, :k] = c @ to_y.T / R[k, k]
        return out
