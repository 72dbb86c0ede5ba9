"""Refits of a model to all blocks of time and without some, by updates of normal equations.

Parameters are taken away from them one by one.
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

# Refits by updates of normal equations, for estimators whose values solve such.
#
# Coordinates are ``y = R x`` in which the information of everything is the unit matrix.


#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE: Tolerance = 1e-9

#: Updated fits are solved anew once so large a share of the parameters is gone, and where so
#: small a share is left of an inverse, or of a constraint beside those that hold: digits go too.
FEWER: Tolerance = 0.25
LOST: Tolerance = 1e-3

#: What there is one of for each fit.
EACH = ("grams", "right", "delta", "inverses", "largest")


@frozen
class UpdatedRefits:
    """Fits to everything (first) and to the rest of each of F folds, under linear constraints.

    A constraint costs k², for all folds at once. Coordinates are ``y = R x`` in which the
    information of everything is the unit matrix, so nothing is lost by squaring. Where updates
    have lost digits (`FEWER`, `LOST`) all is solved anew.

    Attributes
    ----------
    centre : (k,)
        y of the unconstrained fit to everything.
    grams, right : (F + 1, k, k) and (F + 1, k)
        Normal equations ``grams (y - centre) = right`` of each fit without constraints.
    fixed : (r, k)
        The constraints ``fixed y = 0`` so far.
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
    fixed: Array
    delta: Array
    inverses: Array
    solved: int
    largest: Array

    @staticmethod
    def of(equations: Array, centre: Array, scale: float) -> UpdatedRefits:
        """Return the unconstrained fits.

        Parameters
        ----------
        equations : (F + 1, k + 1, k + 1)
            Gram matrix Z of what each fit rests on; the residual is ``Z (centre - y, scale)``.
        centre : (k,)
        scale : float
            Root of the residual sum of squares of the fit to everything.
        """
        k = len(centre)
        grams, right = equations[:, :k, :k], equations[:, :k, k] * scale
        return UpdatedRefits._solve(centre, grams, right, np.empty((0, k)))

    @staticmethod
    def _solve(centre: Array, grams: Array, right: Array, fixed: Array) -> UpdatedRefits:
        """Return the fits under constraints, from the normal equations of what they leave free."""
        turned = np.linalg.qr(fixed.T, mode="complete")[0]
        gone, free = turned[:, : len(fixed)], turned[:, len(fixed) :]
        C = invert_along(grams, free)
        delta = np.tile(-gone @ (gone.T @ centre), (len(grams), 1))
        for _ in range(2):  # the second time takes away what the ridge did to the first
            delta = delta + _improve(C, grams, right, delta)
        traces = np.trace(C, axis1=1, axis2=2)
        return UpdatedRefits(centre, grams, right, fixed, delta, C, len(fixed), traces)

    @property
    def C(self) -> Array:
        """Inverse information of everything, (k, k)."""
        whole: Array = self.inverses[0]
        return whole

    @property
    def alone(self) -> UpdatedRefits:
        """The fit to everything without the others."""
        own = {name: getattr(self, name)[:1] for name in EACH}
        return replace(self, **own)

    def along(self, fixed: Array, counts: Sequence[int]) -> Array:
        """Return ``y - centre`` of each fit under the first few of constraints, (M, F + 1, k).

        The free directions of nested models are leading ones of a common basis, so the leading
        parts of one triangular factor solve them all, where each fit has one.

        Parameters
        ----------
        fixed : (r, k)
            All constraints ``fixed y = 0``, those so far first.
        counts : sequence of int
            How many of them hold in each of M models.
        """
        k = len(self.centre)
        turn = np.ascontiguousarray(np.linalg.qr(fixed.T, mode="complete")[0][:, ::-1])
        free = np.arange(k)[:, None] < k - np.asarray(counts, int)
        c, out = turn.T @ self.centre, np.empty((len(counts), len(self.grams), k))
        for f, (gram, right) in enumerate(zip(self.grams, self.right, strict=True)):
            A, b = turn.T @ gram @ turn, turn.T @ right
            try:
                root = np.linalg.cholesky(A + RIDGE * np.eye(k))
            except np.linalg.LinAlgError:
                return self._one_by_one(fixed, counts)
            half = solve_triangular(root, np.eye(k), lower=True)
            moved = np.where(free, 0.0, -c[:, None])
            for _ in range(2):  # the second time takes away what the ridge did to the first
                left = np.where(free, b[:, None] - A @ moved, 0.0)
                moved += half.T @ np.where(free, half @ left, 0.0)
            out[:, f] = (turn @ moved).T
        return out

    def _one_by_one(self, fixed: Array, counts: Sequence[int]) -> Array:
        out, refits = np.empty((len(counts), *self.delta.shape)), self
        for place, count in zip(out, counts, strict=True):
            more = fixed[len(refits.fixed) : count]
            refits = refits.constrain(more, more) if len(more) else refits
            place[:] = refits.delta
        return out

    def constrain(self, L: Array, _model: Array) -> UpdatedRefits:
        """Return the fits under more constraints ``L y = 0``, L (r, k) of full rank."""
        fixed, free = np.concatenate([self.fixed, L]), len(self.centre) - self.solved
        gain, C = constrain_inverse(self.inverses, L)
        left = np.trace(C, axis1=1, axis2=2) / self.largest
        if len(fixed) - self.solved >= FEWER * free or min(left.min(), _angle(gain)) < LOST:
            return self._solve(self.centre, self.grams, self.right, fixed)
        delta = self.delta - np.einsum("fij,fj->fi", gain, (self.centre + self.delta) @ L.T)
        delta += _improve(C, self.grams, self.right, delta)
        return replace(self, fixed=fixed, delta=delta, inverses=C)


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


# Refits of a model to all blocks of time and without some, from which parameters are taken away.
#
# Coordinates are ``y = R x`` in which the information of everything is the unit matrix.


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

    def of_rests(self, train: np.ndarray, counts: Array | None = None) -> Array:
        """Return the sums over all blocks, and over those of each fit, (F + 1, k + 1, k + 1).

        Parameters
        ----------
        train : (F, B) bool
            Blocks that each fit rests on.
        counts : (B,), optional
            How often each block is drawn, once each without.
        """
        member = np.vstack([np.ones(train.shape[1]), train])
        weights = np.ones(train.shape[1]) if counts is None else counts
        grams = self.grams
        if isinstance(self.full.estimator, InstrumentalVariables):
            edges = np.flatnonzero((np.diff(member, axis=1, prepend=-1.0) != 0).any(0))
            drawn = self.information if counts is None else self.information.weigh(counts)
            grams = self.full.estimator.equations(drawn.merge(edges), self.full, self.R)
            member, weights = member[:, edges], np.ones(len(edges))
        sums: Array = np.tensordot(member * weights, grams, 1)
        return sums
