"""Least squares without the bias of noise in the motion, by instruments.

Noise in q, dq and ddq makes the columns of W noisy. Least squares takes that for motion and pulls
values towards zero, and more data do not help. The difference to least squares is the bias that
would have been believed [Hausman 1978].
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import Estimate, correct
from identifiability.estimation.least_squares import (
    OrdinaryLeastSquares,
    WeightedLeastSquares,
    correct_leverage,
    noise_scale,
)
from identifiability.foundation.linalg import few_at_once, solve_each, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Columns are told apart down to this share of their length.
APART: Tolerance = 1e-8

#: Directions that follow noise-free columns by less than this share stay with least squares: what
#: is known of the noise is not enough to multiply them by more.
WEAK: Tolerance = 0.5

# Instrumental variables: instruments V, the same columns along a second record of the motion whose
# noise is another one, are correlated with the motion and not with the noise: ``(Vᵀ W)⁻¹ Vᵀ τ``
# converges to what noise-free columns would give [Janot, Vandanjon, Gautier 2014]. They are worth
# as much as they are correlated with W, which canonical correlations say direction by direction.


@frozen
class Combined:
    """Instruments combined so that each stands for one direction of W.

    Attributes
    ----------
    left : (2k, k)
        Coefficients T of the instruments ``[V W] T``, with ``([V W] T)ᵀ W B = I``.
    B, inverse : (k, k)
        Directions of the parameters, one a column, and what parameters are in them.
    length : (k,)
        Lengths of the instruments, which are at right angles: 1 over the canonical correlation,
        or 1 where the direction stays with least squares.
    value : (k,)
    weak : (k,) bool
        Directions that stay with least squares.
    lost : (2, k)
        What instruments would change in these, and its variance under noise of variance 1.
    """

    left: Array
    B: Array
    inverse: Array
    length: Array
    value: Array
    weak: np.ndarray
    lost: Array

    def bias(self, scale: float) -> Array:
        """Return the mean square bias that least squares may have in each direction, (k,).

        It is what instruments would change, as far as noise of that variance lets it be known.
        """
        moved, variance = self.lost
        square: Array = moved**2 + scale * variance
        return square

    def root(self, scale: float) -> Array:
        """Return D (k, k), ``scale (DᵀD)⁻¹`` being the covariance of the values with their bias."""
        wider = self.bias(scale) / scale if scale > 0 else 0.0
        root: Array = self.inverse / np.sqrt(self.length**2 + wider)[:, None]
        return root

    def moments(self, information: Information, weights: Array) -> tuple[Array, Array]:
        """Return each block's ``Ẑᵀ W B`` (B, k, k) and ``Ẑᵀ e`` (B, k)."""
        k = len(self.value)
        left = np.vstack([self.left, np.zeros((1, k))])
        right = np.zeros((2 * k + 1, k + 1))
        right[k : 2 * k, :k], right[k:, k] = self.B, np.append(-self.value, 1.0)
        both = information.joint.products(weights, left, right)
        return both[:, :, :k], both[:, :, k]


def combine(information: Information, weights: Array) -> Combined:
    """Return the instruments of independent columns and their values."""

    def make() -> Combined:
        k, N = information.size, max(information.samples, 1)
        R = information.joint.factor(weights)
        V, (Q, root) = R[:k, :k], np.linalg.qr(R[:, k : 2 * k])
        to_V, to_W = _inverse(V), _inverse(root)
        left, strength, Yt = np.linalg.svd(V @ to_V @ Q[:k])
        weak = strength < WEAK
        B, share = to_W @ Yt.T, np.where(weak, 1.0, strength)
        T = np.vstack([np.where(weak, 0.0, to_V @ left / share), np.where(weak, B, 0.0)])
        x = to_W @ (Q.T @ R[:, 2 * k])
        moved = left.T @ (R[:k, 2 * k] - R[:k, k : 2 * k] @ x)
        x = x + B @ np.where(weak, 0.0, moved / share)
        lean = np.maximum(strength, 1.0 / np.sqrt(N))  # noise alone correlates by that
        lost = np.where(weak, [moved / lean, 1.0 / lean**2 - 1.0], 0.0)
        return Combined(T, B, Yt @ root, 1.0 / share, x, weak, lost)

    found: Combined = information.remember(("instruments", weights.tobytes()), make)
    return found


@frozen
class InstrumentalVariables:
    """Instrumental variables in the directions in which instruments are strong.

    Information without instruments is fitted by least squares.

    Attributes
    ----------
    base : OrdinaryLeastSquares or WeightedLeastSquares
        Gives the weights of the actuators, and the directions without a strong instrument.
    name, description : str
    """

    base: OrdinaryLeastSquares = WeightedLeastSquares()
    name: str = "iv"
    description: str = "instrumental variables"

    def fit(self, information: Information) -> Estimate:
        """Return the estimate; it says what least squares gives."""
        plain = self.base.fit(information)
        kept = list(plain.kept)
        if not information.instrumented or not kept:
            return plain
        part = information.select(kept)
        found = combine(part, plain.weights)
        rss = part.squares(np.append(-found.value, 1.0))
        scale = noise_scale(part, plain.weights, plain.times, rss)
        # Under independent residuals, whatever the weights know.
        Z = part.joint.factor(plain.weights / plain.times)[:, : 2 * part.size] @ found.left
        covariance = scale * found.B @ Z.T @ Z @ found.B.T
        bias = (found.B * np.sqrt(found.bias(scale)))[:, found.weak]
        return correct(plain, self, found.value, covariance, rss, bias)

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the values of the same instruments for weighted sums of blocks, (R, k)."""
        kept, k = list(fit.kept), len(fit.kept)
        part = information.select(kept)
        found = combine(part, fit.weights)
        both = np.dstack(found.moments(part, fit.weights))
        flat, values = both.reshape(len(both), -1), np.zeros((len(counts), information.size))
        for at in few_at_once(len(counts), both[0].nbytes):
            sums = (counts[at] @ flat).reshape(-1, k, k + 1)
            values[at, kept] = found.value + solve_each(sums) @ found.B.T
        return values

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return the leverage-corrected score of each block's instruments, (B, k)."""
        kept = list(fit.kept)
        part = information.select(kept)
        found = combine(part, fit.weights)
        A, c = found.moments(part, fit.weights)
        moved = np.zeros((len(c), information.size))
        moved[:, kept] = correct_leverage(c, A) @ found.B.T
        return moved

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return the triangular factor of what instruments see of the residual, (k + 1, k + 1).

        Its square is the estimate's distance in the unit of its own covariance, on top of the
        residual sum of squares.
        """
        kept, k = list(fit.kept), information.size
        part = information.select(kept)
        scale = noise_scale(part, fit.weights, fit.times, fit.rss)
        F = np.zeros((k + 1, k + 1))
        F[: len(kept), kept] = combine(part, fit.weights).root(scale)
        F[:k, k] = F[:k, :k] @ fit.value
        F[k, k] = np.sqrt(fit.weights @ fit.rss)
        return triangular_factor(F)

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return what least squares finds of torque without noise, (k, b)."""
        return self.base.project(information, fit, M)

    def equations(self, information: Information, fit: Estimate, R: Array) -> Array:
        """Return the normal equations of each block, (B, k + 1, k + 1).

        Parameters
        ----------
        information : Information
            About k independent columns.
        fit : Estimate
        R : (k + 1, k + 1)
            The loss; equations are in ``R x``, less those of the fit, in units of ``R[k, k]``.
            They are made symmetric, as their sum is.
        """
        k = information.size
        found = replace(combine(information, fit.weights), value=fit.value[list(fit.kept)])
        A, c = found.moments(information, fit.weights)
        to_y = R[:k, :k] @ found.B  # of directions into coordinates of the loss
        turned = to_y @ A @ np.linalg.inv(to_y)
        out = np.zeros((len(A), k + 1, k + 1))
        out[:, :k, :k] = 0.5 * (turned + turned.swapaxes(1, 2))
        out[:, :k, k] = out[:, k, :k] = c @ to_y.T / R[k, k]
        return out


def _inverse(root: Array) -> Array:
    """Return the inverse of a triangular factor (k, k), of what it determines.

    A fold of a short log need not determine what the whole does.
    """
    scale = np.linalg.norm(root, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    inverse: Array = np.linalg.pinv(root / scale, rcond=APART) / scale[:, None]
    return inverse
