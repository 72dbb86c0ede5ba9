"""Least squares without the bias of noise in the motion, by instruments.

Noise in q, dq and ddq makes the columns of W noisy. Least squares takes that for motion and pulls
values towards zero, and more data do not help. The difference to least squares is the bias that
would have been believed [Hausman 1978].
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.linalg import few_at_once
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


# What a block of time does to a fit, as if it had not pulled the fit towards itself.


#: What a block leaves of a direction that it determines almost alone is raised to this.
ALONE: Tolerance = 0.05


def correct_leverage(scores: Array, shares: Array) -> Array:
    """Return scores as if each block had not pulled the fit towards itself, (B, k).

    Parameters
    ----------
    scores : (B, k)
    shares : (B, k, k)
        Of each block in the whole information, which is the unit matrix; made symmetric.
    """
    corrected = np.empty(scores.shape)
    for at in few_at_once(len(scores), shares[:1].nbytes):
        own = 0.5 * (shares[at] + shares[at].swapaxes(1, 2))
        values, vectors = np.linalg.eigh(np.eye(scores.shape[1]) - own)
        lever = 1.0 / np.sqrt(np.maximum(values, ALONE))
        corrected[at] = np.einsum(
            "bij,bj,bkj,bk->bi", vectors, lever, vectors, scores[at], optimize=True
        )
    return corrected


def _inverse(root: Array) -> Array:
    """Return the inverse of a triangular factor (k, k), of what it determines.

    A fold of a short log need not determine what the whole does.
    """
    scale = np.linalg.norm(root, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    inverse: Array = np.linalg.pinv(root / scale, rcond=APART) / scale[:, None]
    return inverse
