"""The Gaussian algebra: values, likelihood and predictions of a linear model by its products.

The normal equations ``P x = h`` of whitened rows contain all information: P are products of
columns, with the precision of the prior, and h those with the torque. This module answers all
questions about a linear model: values, their covariance, the marginal likelihood of the torque, and
predictions.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dtrtri

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen


@frozen
class Normal:
    """Values of a linear model by its normal equations.

    Attributes
    ----------
    factor : (k, k)
        L, lower triangular, with ``L Lᵀ = P``.
    half : (k,)
        ``L⁻¹ h``.
    """

    factor: Array
    half: Array

    @staticmethod
    def of(P: Array, h: Array) -> Normal:
        """Return the values of P (k, k), positive definite, and h (k,)."""
        L = np.linalg.cholesky(P)
        return Normal(L, solve_triangular(L, h, lower=True))

    @staticmethod
    def ridged(P: Array, h: Array) -> Normal:
        """Return the same of a curvature that rounding or instruments may leave indefinite."""
        ridge = ROUNDOFF * np.eye(len(P))  # columns have about unit length
        try:
            return Normal.of(P + ridge, h)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(P)
            return Normal.of((vectors * np.maximum(values, 0.0)) @ vectors.T + ridge, h)

    @cached_property
    def root(self) -> Array:
        """Inverse of the factor, (k, k): the covariance is ``rootᵀ root``."""
        return dtrtri(self.factor, lower=1)[0] if len(self.factor) else self.factor

    @property
    def value(self) -> Array:
        """The values, (k,)."""
        return solve_triangular(self.factor, self.half, lower=True, trans="T")

    @property
    def covariance(self) -> Array:
        """Their covariance, (k, k)."""
        return self.root.T @ self.root

    @property
    def evidence(self) -> float:
        """Marginal log-likelihood of the torque, up to a constant that all models share."""
        log_determinant = np.log(np.diag(self.factor)).sum()
        return float(0.5 * self.half @ self.half - log_determinant)
