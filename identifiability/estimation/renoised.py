"""Least squares corrected by the map that noise in the motion makes of true values.

Where positions alone were measured there is no second record: derivatives share the positions'
noise. What noise does can be tried instead. Along a smoothed motion, torque is what any values say;
the same motion with new noise of the log's own size is what would be measured; least squares makes
``B θ`` of the values θ. The log's own noise did the same to its own, so ``B⁻¹ θ̂`` is closer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.estimation.estimator import Correction, Estimate, correct
from identifiability.estimation.least_squares import OrdinaryLeastSquares, WeightedLeastSquares
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Directions of which noise leaves less than this share stay with least squares: what is known of
#: the noise is not enough to multiply them by more.
LEFT = 0.5


@frozen
class RenoisedLeastSquares:
    """Least squares, and the inverse of what new noise makes of it.

    Information without an echo is fitted by least squares.

    Attributes
    ----------
    base : OrdinaryLeastSquares or WeightedLeastSquares
    """

    base: OrdinaryLeastSquares = WeightedLeastSquares()
    name: str = "renoised"

    @property
    def description(self) -> str:
        """What it is, in the words of a report."""
        return (
            f"least squares ({self.base.name} weights), corrected by what new noise of the "
            "motion's own size does to it"
        )

    def fit(self, information: Information) -> Estimate:
        """Return the estimate; it says what least squares gives."""
        plain = self.base.fit(information)
        kept = list(plain.kept)
        if information.echo is None or not kept:
            return plain
        part = information.select(kept)
        B, directions, weak = _shrinkage(part, plain.weights)
        value, H = np.linalg.solve(B, plain.value[kept]), np.linalg.inv(B)
        own = plain.covariance[np.ix_(kept, kept)]
        # Of what is determined alone; the rest has no variance.
        covariance = H @ np.where(np.isfinite(own), own, 0.0) @ H.T
        rss = part.squares(np.append(-value, 1.0))
        mended = Correction.of(plain, directions, weak)
        return correct(plain, self, value, covariance, rss, mended)

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the corrected values for weighted sums of blocks, (R, k)."""
        values = self.base.refit(information, fit, counts)
        return values @ self._correction(information, fit).T

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return by how much each block moves the corrected values, (B, k)."""
        moved = self.base.influence(information, _plain(fit))
        return moved @ self._correction(information, fit).T

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return the triangular factor of least squares at what noise makes of values."""
        F = self.base.loss(information, fit)
        k = information.size
        F[:, :k] = F[:, :k] @ np.linalg.inv(self._correction(information, fit))
        return triangular_factor(F)

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return what the fit finds of torque without noise, for each of b parameters, (k, b)."""
        P = self.base.project(information, fit, M)
        if information.echo is None:
            return P
        b, k = M.shape
        R = information.echo.joint.factor(fit.weights)
        V, W = R[:, :b], R[:, b : 2 * b]
        B, *_ = _shrinkage(information.reduce(M, [""] * k), fit.weights)
        # Of its own columns it finds what they are.
        moved = np.linalg.lstsq(V @ M, W - W @ M @ P, rcond=None)[0]
        seen: Array = P + np.linalg.solve(B, moved)
        return seen

    def _correction(self, information: Information, fit: Estimate) -> Array:
        """Return what turns values of least squares into corrected ones, (k, k)."""
        H = np.eye(information.size)
        kept = list(fit.kept)
        if information.echo is not None and kept:
            B, *_ = _shrinkage(information.select(kept), fit.weights)
            H[np.ix_(kept, kept)] = np.linalg.inv(B)
        return H


def _plain(fit: Estimate) -> Estimate:
    """Return the estimate by least squares beneath a corrected one."""
    return fit if fit.correction is None else replace(fit, value=fit.correction.least_squares)


def _shrinkage(information: Information, weights: Array) -> tuple[Array, Array, np.ndarray]:
    """Return what noise makes of independent columns' values, (k, k), and in which directions.

    Directions (k, k) are of unit information, one a column; in the weak ones (k,) nothing is
    mended.
    """
    k, echo = information.size, information.echo
    assert echo is not None
    R = echo.joint.factor(weights)
    B = solve_triangular(R[:k, :k], R[:k, k : 2 * k])
    root = information.factor(weights)[:k, :k]
    U, s, Yt = np.linalg.svd(root @ B @ np.linalg.inv(root))
    weak = s < LEFT
    B = np.linalg.solve(root, (U * np.where(weak, 1.0, s)) @ Yt @ root)
    return B, np.linalg.solve(root, U), weak
