"""Instruments combined so that each stands for one direction of the columns.

Instruments are worth as much as they are correlated with W. The canonical correlations r say that
direction by direction: where they are weak the column itself stays, which is least squares. How
much is enough depends on the record. One that was measured again is the motion: what W has beside
it is noise, least squares keeps r² of a value, and a first-stage ``F = N r²/(1 - r²)`` of 104.7 is
enough for intervals of ± 1.96 σ to hold [Lee, McCrary, Moreira, Porter 2022]. One that shares some
noise, or a command, which the robot did not follow to the letter, errs by what 1/r multiplies.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.samples import Record
from identifiability.regression.information import Information

#: A direction follows its instrument from this canonical correlation on, and one that was measured
#: again from this first-stage F on, samples for N: one actuator alone may know of the direction.
STRONG, ENOUGH = 0.9, 104.7

#: Instruments are told apart down to this share of their columns' length.
APART = 1e-8


@frozen
class Combined:
    """Instruments combined so that each stands for one direction of W.

    Attributes
    ----------
    left : (2k, k)
        Coefficients T of the instruments ``[V W] T``, with ``([V W] T)ᵀ W B = I``.
    B : (k, k)
        Directions of the parameters, one a column.
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
    length: Array
    value: Array
    weak: np.ndarray
    lost: Array

    def residual(self) -> Array:
        """Return z with ``τ - W x = [V W τ] z``, (2k + 1,)."""
        return np.concatenate([np.zeros(len(self.value)), -self.value, [1.0]])

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
        inverse: Array = np.linalg.inv(self.B * np.sqrt(self.length**2 + wider))
        return inverse

    def moments(self, information: Information, weights: Array) -> tuple[Array, Array]:
        """Return each block's ``Ẑᵀ W B`` (B, k, k) and ``Ẑᵀ e`` (B, k)."""
        both = self.equations(information, weights)
        return both[:, :, :-1], both[:, :, -1]

    def equations(self, information: Information, weights: Array) -> Array:
        """Return both beside each other, (B, k, k + 1)."""
        k = len(self.value)
        left = np.vstack([self.left, np.zeros((1, k))])
        right = np.zeros((2 * k + 1, k + 1))
        right[k : 2 * k, :k] = self.B
        right[:, k] = self.residual()
        return information.joint.products(weights, left, right)


def combine(
    information: Information, weights: Array, record: Record, plain: Array | None = None
) -> Combined:
    """Return the instruments of independent columns and their values (of `plain`, if given)."""
    make = partial(_combine, information, weights, record, plain)
    if plain is not None:
        return make()
    found: Combined = information.remember((record, weights.tobytes()), make)
    return found


def _combine(
    information: Information, weights: Array, record: Record, plain: Array | None
) -> Combined:
    k, N = information.size, max(information.samples, 1)
    R = information.joint.factor(weights)
    V, (Q, root) = R[:, :k], np.linalg.qr(R[:, k : 2 * k])
    size = np.linalg.norm(V, axis=0)
    size[size == 0] = 1.0
    U, s, Yt = np.linalg.svd(V / size, full_matrices=False)
    own = s > APART * s[0] if len(s) else np.zeros(0, bool)
    U, to_U = U[:, own], (Yt[own].T / s[own]) / size[:, None]  # U = V to_U
    left, strength, Yt = np.linalg.svd(U.T @ Q)  # min(rank, k) correlations
    strength = np.append(strength, np.zeros(k - len(strength)))
    least = np.sqrt(ENOUGH / (N + ENOUGH)) if record == "measured" else STRONG
    weak = strength < least
    good = np.flatnonzero(~weak)
    B = solve_triangular(root, Yt.T)
    T = np.zeros((2 * k, k))
    T[:k, good] = to_U @ left[:, good] / strength[good]
    T[k:, weak] = B[:, weak]
    x = solve_triangular(root, Q.T @ R[:, 2 * k]) if plain is None else plain
    e = R[:, 2 * k] - R[:, k : 2 * k] @ x  # what least squares leaves has digits of its own
    x = x + B[:, good] @ ((U @ left[:, good]).T @ e / strength[good])
    length = np.where(weak, 1.0, 1.0 / np.where(weak, 1.0, strength))
    lost = np.zeros((2, k))
    if record != "command":  # it is another motion, so what it would change is no bias
        # Noise alone correlates by 1/√N.
        lean, seen = np.maximum(strength, 1.0 / np.sqrt(N)), np.zeros(k)
        seen[: left.shape[1]] = (U @ left).T @ e
        lost = np.where(weak, [seen / lean, 1.0 / lean**2 - 1.0], 0.0)
    return Combined(T, B, length, x, weak, lost)
