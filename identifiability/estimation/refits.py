"""Refits of a model to all blocks of time and without some, from which parameters are taken away.

Coordinates are ``y = R x`` in which the information of everything is the unit matrix.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.least_squares import OrdinaryLeastSquares
from identifiability.estimation.updated_refits import invert_along
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information


class Refits(Protocol):
    """R fits of one model, each to the blocks that it counts."""

    @property
    def delta(self) -> Array:
        """``y - centre`` of each fit, (R, k)."""

    @property
    def grams(self) -> Array:
        """Curvature of each fit's loss without constraints, (R, k, k)."""

    @property
    def C(self) -> Array:
        """Inverse curvature of the first fit's loss under the constraints so far, (k, k)."""

    def constrain(self, L: Array, model: Array) -> Refits:
        """Return the fits under more constraints.

        Parameters
        ----------
        L : (r, k)
            ``L y = 0``, of full rank.
        model : (k, m)
            The same as a model: its columns are ``W model`` under all constraints so far.
        """


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

    def start(self, counts: Array, kept: Array) -> AskedRefits:
        """Return the fits of all columns.

        Parameters
        ----------
        counts : (B,)
            How often each block of the information is drawn.
        kept : (R, B) of 0 and 1
            Which blocks each fit is to; the first to all.
        """
        drawn = np.repeat(np.arange(len(counts)), counts.astype(int))
        kept = kept[:, drawn]
        edges = np.flatnonzero((np.diff(kept, axis=1, prepend=-1) != 0).any(0))
        whole = replace(self, information=self.information.take(drawn).merge(edges))
        k = self.information.size
        fit = self.estimator.fit(whole.information)
        F = self.estimator.loss(whole.information, fit)[:, :k] @ self.inverse
        delta = whole.delta(kept[:, edges], np.eye(k))
        return AskedRefits(whole, kept[:, edges], delta, F.T @ F, invert_along(F.T @ F, np.eye(k)))

    def delta(self, counts: Array, model: Array) -> Array:
        """Return ``y - centre`` of refits of the model ``W model``, (R, k).

        Parameters
        ----------
        counts : (R, B)
            How often each block counts.
        model : (k, m)
        """
        names = [self.information.columns[k] for k in model.argmax(0)]
        part = self.information.reduce(model, names)
        fit = self.estimator.fit(part)
        values = self.estimator.refit(part, fit, counts)
        values = np.where(np.isfinite(values), values, fit.value)  # what determines none leaves it
        y: Array = np.linalg.solve(self.inverse, model @ values.T).T
        return y - self.centre


@frozen
class AskedRefits:
    """Fits for which the estimator is asked anew whenever the model gets smaller.

    Attributes
    ----------
    asked : Asked
    counts : (R, B) of 0 and 1
        Which blocks each fit is to.
    delta : (R, k)
    curvature : (k, k)
        Of the first fit's loss without constraints.
    C : (k, k)
    """

    asked: Asked
    counts: Array
    delta: Array
    curvature: Array
    C: Array

    @property
    def grams(self) -> Array:
        """Curvature of each fit's loss, by how much of the logs it rests on, (R, k, k)."""
        share = self.counts @ self.asked.information.counts / self.asked.information.samples
        each: Array = np.multiply.outer(share, self.curvature)
        return each

    def constrain(self, _L: Array, model: Array) -> AskedRefits:
        """Return the fits of a smaller model; see `Refits.constrain`."""
        free = np.linalg.qr(np.linalg.solve(self.asked.inverse, model))[0]
        delta, C = self.asked.delta(self.counts, model), invert_along(self.curvature, free)
        return replace(self, delta=delta, C=C)


@frozen
class Equations:
    """Normal equations for `UpdatedRefits`.

    Attributes
    ----------
    information : Information
        About k independent columns.
    full : Estimate
        By instruments, or by least squares.
    R : (k + 1, k + 1)
        Its loss; equations are in ``R x``.
    grams : (B, k + 1, k + 1), or without any blocks (0, k + 1, k + 1)
        Those of each block by least squares; instruments are combined anew for each resampled log.
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
        own = getattr(type(estimator), "refit", None)
        if own is not OrdinaryLeastSquares.refit:
            return None
        grams = information.products(full.weights, inverse, inverse)
        return Equations(information, full, R, grams)

    def of_rests(self, train: np.ndarray, counts: Array | None = None) -> Array:
        """Return the sums over all blocks, and over those of each fit, (F + 1, k + 1, k + 1).

        Parameters
        ----------
        train : (F, B) bool
            Blocks that each fit rests on.
        counts : (B,), optional
            How often each block is drawn, once each without.
        """
        estimator = self.full.estimator
        member = np.vstack([np.ones(train.shape[1]), train])
        if isinstance(estimator, InstrumentalVariables):
            drawn = self.information if counts is None else self.information.weigh(counts)
            edges = np.flatnonzero((np.diff(member, axis=1, prepend=-1.0) != 0).any(0))
            moments = estimator.moments(
                drawn.merge(edges), self.full, self.R, anew=counts is not None
            )
            return np.asarray(np.tensordot(member[:, edges], moments, 1))
        weights = np.ones(train.shape[1]) if counts is None else counts
        sums: Array = np.tensordot(member * weights, self.grams, 1)
        return sums
