"""Refits by updates of normal equations, for estimators whose values solve such.

Coordinates are ``y = R x`` in which the information of everything is the unit matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Keeps a fold solvable in which a column never acts; columns have about unit length.
RIDGE = 1e-9

#: Updated fits are solved anew once so large a share of the parameters is gone, and where so
#: small a share is left of an inverse, or of a constraint beside those that hold: digits go too.
FEWER, LOST = 0.25, 1e-3

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

    @property
    def alone(self) -> UpdatedRefits:
        """The fit to everything without the others."""
        own = {name: getattr(self, name)[:1] for name in EACH}
        return replace(self, **own)

    def along(self, held: Array, counts: Sequence[int]) -> Array:
        """Return ``y - centre`` of each fit under the first few of constraints, (M, F + 1, k).

        The free directions of nested models are leading ones of a common basis, so the leading
        parts of one triangular factor solve them all, where each fit has one.

        Parameters
        ----------
        held : (r, k)
            All constraints ``held y = 0``, those so far first.
        counts : sequence of int
            How many of them hold in each of M models.
        """
        k = len(self.centre)
        turn = np.ascontiguousarray(np.linalg.qr(held.T, mode="complete")[0][:, ::-1])
        free = np.arange(k)[:, None] < k - np.asarray(counts, int)
        c, out = turn.T @ self.centre, np.empty((len(counts), len(self.grams), k))
        for f, (gram, right) in enumerate(zip(self.grams, self.right, strict=True)):
            A, b = turn.T @ gram @ turn, turn.T @ right
            try:
                root = np.linalg.cholesky(A + RIDGE * np.eye(k))
            except np.linalg.LinAlgError:
                return self._one_by_one(held, counts)
            half = solve_triangular(root, np.eye(k), lower=True)
            moved = np.where(free, 0.0, -c[:, None])
            for _ in range(2):  # the second time takes away what the ridge did to the first
                left = np.where(free, b[:, None] - A @ moved, 0.0)
                moved += half.T @ np.where(free, half @ left, 0.0)
            out[:, f] = (turn @ moved).T
        return out

    def _one_by_one(self, held: Array, counts: Sequence[int]) -> Array:
        out, refits = np.empty((len(counts), *self.delta.shape)), self
        for place, count in zip(out, counts, strict=True):
            more = held[len(refits.held) : count]
            refits = refits.constrain(more, more) if len(more) else refits
            place[:] = refits.delta
        return out

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
