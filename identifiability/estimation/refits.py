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
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE = 1e-9

#: Updated fits are solved anew once so large a share of the parameters is gone, and where so
#: small a share is left of an inverse, or of a constraint beside those that hold: digits go too.
FEWER, LOST = 0.25, 1e-3


class Refits(Protocol):
    """R fits of one model, each to the blocks that it counts."""

    @property
    def delta(self) -> Array:
        """``y - centre`` of each fit, (R, k)."""

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

    def constrain(self, _L: Array, model: Array) -> AskedRefits:
        """Return the fits of a smaller model; see `Refits.constrain`."""
        free = np.linalg.qr(np.linalg.solve(self.asked.inverse, model))[0]
        delta, C = self.asked.delta(self.counts, model), invert_along(self.curvature, free)
        return replace(self, delta=delta, C=C)


def normal_equations(
    information: Information, full: Estimate, R: Array, blocks: Array
) -> Array | None:
    """Return each block's normal equations for `UpdatedRefits`, (B, k + 1, k + 1).

    None for an estimator that has refits of its own.

    Parameters
    ----------
    information : Information
        About k independent columns.
    full : Estimate
    R : (k + 1, k + 1)
        Its loss; equations are in ``R x``.
    blocks : (B, k + 1, k + 1)
        Gram matrices of ``[W τ] R⁻¹``, which are those of least squares.
    """
    estimator = full.estimator
    if isinstance(estimator, InstrumentalVariables):
        return estimator.moments(information, full, R)
    own = getattr(type(estimator), "refit", None)
    return blocks if own is OrdinaryLeastSquares.refit else None


@frozen
class UpdatedRefits:
    """Fits to everything (first) and without each of F folds, under linear constraints.

    A constraint costs k², for all folds at once. Coordinates are ``y = R x`` in which the
    information of everything is the unit matrix, so nothing is lost by squaring. Where updates
    have lost digits (`FEWER`, `LOST`) all is solved anew.

    Attributes
    ----------
    centre : (k,)
        y of the unconstrained fit to everything.
    grams, right : (F + 1, k, k) and (F + 1, k)
        Normal equations ``grams (y - centre) = right`` of each fit without constraints.
    held : (r, k)
        The constraints ``held y = 0`` so far.
    delta : (F + 1, k)
        ``y - centre`` of each fit.
    inverses : (F + 1, k, k)
        Inverse information of each fit under the constraints.
    solved : int
        Number of constraints when all was solved last.
    largest : (F + 1,)
        Trace of each inverse then.
    """

    centre: Array
    grams: Array
    right: Array
    held: Array
    delta: Array
    inverses: Array
    solved: int
    largest: Array

    @staticmethod
    def of(held: Array, centre: Array, scale: float) -> UpdatedRefits:
        """Return the unconstrained fits.

        Parameters
        ----------
        held : (F, k + 1, k + 1)
            Gram matrix Z of each fold; the residual is ``Z (centre - y, scale)``.
        centre : (k,)
        scale : float
            Root of the residual sum of squares of the fit to everything.
        """
        k = len(centre)
        whole = held.sum(0)
        A = np.concatenate([whole[None], whole - held])
        return UpdatedRefits._solve(centre, A[:, :k, :k], A[:, :k, k] * scale, np.empty((0, k)))

    @staticmethod
    def _solve(centre: Array, grams: Array, right: Array, held: Array) -> UpdatedRefits:
        """Return the fits under constraints, from the normal equations of what they leave free."""
        turned = np.linalg.qr(held.T, mode="complete")[0]
        gone, free = turned[:, : len(held)], turned[:, len(held) :]
        C = invert_along(grams, free)
        delta = np.tile(-gone @ (gone.T @ centre), (len(grams), 1))
        for _ in range(2):  # the second time takes away what the ridge did to the first
            delta = delta + _improve(C, grams, right, delta)
        traces = np.trace(C, axis1=1, axis2=2)
        return UpdatedRefits(centre, grams, right, held, delta, C, len(held), traces)

    @property
    def C(self) -> Array:
        """Inverse information of everything, (k, k)."""
        whole: Array = self.inverses[0]
        return whole

    def constrain(self, L: Array, _model: Array) -> UpdatedRefits:
        """Return the fits under more constraints ``L y = 0``, L (r, k) of full rank."""
        held, free = np.concatenate([self.held, L]), len(self.centre) - self.solved
        gain, C = constrain_inverse(self.inverses, L)
        left = np.trace(C, axis1=1, axis2=2) / self.largest
        if len(held) - self.solved >= FEWER * free or min(left.min(), _angle(gain)) < LOST:
            return self._solve(self.centre, self.grams, self.right, held)
        delta = self.delta - np.einsum("fij,fj->fi", gain, (self.centre + self.delta) @ L.T)
        delta += _improve(C, self.grams, self.right, delta)
        return replace(self, held=held, delta=delta, inverses=C)


def _angle(gain: Array) -> float:
    """Return the least share of a constraint, squared, that did not hold already."""
    return float(1.0 / (gain**2).sum(-2).max())


def _improve(C: Array, grams: Array, right: Array, delta: Array) -> Array:
    """Return the step from almost solved normal equations to their solution, (F, k)."""
    left = right[..., None] - grams @ delta[..., None]
    step: Array = (C @ left)[..., 0]
    return step


def invert_along(grams: Array, free: Array) -> Array:
    """Return the inverse information (..., k, k) of fits that may move along some directions.

    Parameters
    ----------
    grams : (..., k, k)
        Information.
    free : (k, m)
        Orthonormal.
    """
    C = np.linalg.inv(free.T @ grams @ free + RIDGE * np.eye(free.shape[1]))
    along: Array = free @ (0.5 * (C + C.swapaxes(-1, -2))) @ free.T
    return along


def constrain_inverse(C: Array, L: Array) -> tuple[Array, Array]:
    """Return how values follow ``L y`` and the inverse information once ``L y = 0``.

    Parameters
    ----------
    C : (..., k, k)
        Inverse information.
    L : (r, k)
        Constraints of full rank.
    """
    CL = C @ L.T
    gain: Array = CL @ np.linalg.inv(L @ CL)
    after: Array = C - gain @ CL.swapaxes(-1, -2)
    return gain, after
