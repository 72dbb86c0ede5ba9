"""Fits of nested models to all blocks of time and without some.

Coordinates are ``y = R x`` in which the information of everything is the unit matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.least_squares import OrdinaryLeastSquares
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE: Tolerance = 1e-9


class Refits(Protocol):
    """Fits of one model to everything (first) and to the rest of each of F folds."""

    @property
    def grams(self) -> Array:
        """Curvature of each fit's loss, (F + 1, k, k)."""

    @property
    def whole(self) -> Array:
        """``y - centre`` of the fit of all columns to everything, (k,)."""

    def along(self, turn: Array, free: np.ndarray, models: Sequence[Array]) -> Array:
        """Return ``y - centre`` of each fit of M nested models, (M, F + 1, k).

        Parameters
        ----------
        turn : (k, k)
            Orthonormal; its first columns span what a model leaves free.
        free : (M,) int
            How many.
        models : sequence of (k, m)
            The same as models: the columns of each are ``W model``.
        """


@frozen
class SolvedRefits:
    """Fits by normal equations.

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

    def along(self, turn: Array, free: np.ndarray, models: Sequence[Array]) -> Array:
        """Return ``y - centre`` of each fit of nested models; see `Refits.along`.

        The leading parts of one triangular factor solve them all, where each fit has one.
        """
        k, out = len(self.centre), np.empty((len(models), *self.right.shape))
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
class AskedRefits:
    """Fits for which the estimator is asked anew whenever the model gets smaller.

    Attributes
    ----------
    asked : Asked
        With the blocks that are drawn.
    counts : (F + 1, B) of 0 and 1
        Which blocks each fit is to.
    curvature : (k, k)
        Of the first fit's loss.
    """

    asked: Asked
    counts: Array
    curvature: Array

    @property
    def grams(self) -> Array:
        """Curvature of each fit's loss, by how much of the logs it rests on, (F + 1, k, k)."""
        share = self.counts @ self.asked.information.counts / self.asked.information.samples
        each: Array = np.multiply.outer(share, self.curvature)
        return each

    @property
    def whole(self) -> Array:
        """``y - centre`` of the fit of all columns to everything, (k,)."""
        first: Array = self.asked.delta(self.counts[:1], np.eye(len(self.curvature)))[0]
        return first

    def along(self, _turn: Array, _free: np.ndarray, models: Sequence[Array]) -> Array:
        """Return ``y - centre`` of each fit of nested models; see `Refits.along`."""
        return np.stack([self.asked.delta(self.counts, model) for model in models])


@frozen
class Asked:
    """What asks an estimator for refits that it has ways of its own for.

    Attributes
    ----------
    estimator : Estimator
    information : Information
        About k independent columns.
    inverse : (k, k)
        ``x = inverse @ y``.
    centre : (k,)
    """

    estimator: Estimator
    information: Information
    inverse: Array
    centre: Array

    def start(self, train: np.ndarray, counts: Array | None = None) -> AskedRefits:
        """Return the fits to all blocks, and to those of each fold's rest.

        Parameters
        ----------
        train : (F, B) bool
            Blocks that each fit rests on.
        counts : (B,), optional
            How often each block is drawn, once each without.
        """
        k, blocks = self.information.size, train.shape[1]
        drawn = np.repeat(np.arange(blocks), 1 if counts is None else counts.astype(int))
        kept = np.vstack([np.ones(blocks), train])[:, drawn]
        edges = np.flatnonzero((np.diff(kept, axis=1, prepend=-1) != 0).any(0))
        whole = replace(self, information=self.information.take(drawn).merge(edges))
        fit = self.estimator.fit(whole.information)
        F = self.estimator.loss(whole.information, fit)[:, :k] @ self.inverse
        return AskedRefits(whole, kept[:, edges], F.T @ F)

    def delta(self, counts: Array, model: Array) -> Array:
        """Return ``y - centre`` of refits of the model ``W model``, (R, k).

        Parameters
        ----------
        counts : (R, B)
            How often each block counts.
        model : (k, m)
        """
        if not model.size:
            return np.tile(-self.centre, (len(counts), 1))
        names = [self.information.columns[k] for k in model.argmax(0)]
        part = self.information.reduce(model, names)
        fit = self.estimator.fit(part)
        values = self.estimator.refit(part, fit, counts)
        values = np.where(np.isfinite(values), values, fit.value)  # what determines none leaves it
        y: Array = np.linalg.solve(self.inverse, model @ values.T).T
        return y - self.centre


@frozen
class Equations:
    """Normal equations for `SolvedRefits`.

    Attributes
    ----------
    information : Information
        About k independent columns.
    full : Estimate
    R : (k + 1, k + 1)
        Its loss; equations are in ``R x``.
    grams : (B, k + 1, k + 1)
        Those of each block by least squares; of none by instruments, which are combined anew for
        each resampled log: those of the log would leave its weak directions less than no
        information.
    """

    information: Information
    full: Estimate
    R: Array
    grams: Array

    @staticmethod
    def of(information: Information, full: Estimate, R: Array, inverse: Array) -> Equations | None:
        """Return them; None for an estimator that has refits of its own.

        Parameters
        ----------
        information, full, R
            As the attributes.
        inverse : (k + 1, k + 1)
            Of R: Gram matrices of ``[W τ] R⁻¹`` are the equations of least squares.
        """
        estimator = full.estimator
        if isinstance(estimator, InstrumentalVariables):
            return Equations(information, full, R, np.empty((0, *R.shape)))
        if getattr(type(estimator), "refit", None) is not OrdinaryLeastSquares.refit:
            return None
        grams = information.products(full.weights, inverse, inverse)
        return Equations(information, full, R, grams)

    def start(self, train: np.ndarray, counts: Array | None = None) -> SolvedRefits:
        """Return the fits to all blocks, and to those of each fold's rest; as `Asked.start`."""
        member = np.vstack([np.ones(train.shape[1]), train])
        weights = np.ones(train.shape[1]) if counts is None else counts
        grams, k = self.grams, len(self.R) - 1
        if isinstance(self.full.estimator, InstrumentalVariables):
            edges = np.flatnonzero((np.diff(member, axis=1, prepend=-1.0) != 0).any(0))
            drawn = self.information if counts is None else self.information.weigh(counts)
            grams = self.full.estimator.equations(drawn.merge(edges), self.full, self.R)
            member, weights = member[:, edges], np.ones(len(edges))
        sums = np.tensordot(member * weights, grams, 1)
        # Gram matrices of Z where the residual is Z (centre - y, scale), scale its root of squares.
        return SolvedRefits(self.R[:k, k], sums[:, :k, :k], sums[:, :k, k] * self.R[k, k])
