"""What the data say about the parameters: a compressed least-squares problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information


@frozen
class LeastSquares:
    """Residual sum of squares of a linear model, ``‖R phi − z‖² + rss_min``.

    The three hundred thousand rows of a log enter the physical and the Bayesian stages only through
    these numbers. `R` may have a null space, and it is never squared: ``RᵀR`` loses half the
    digits.

    Attributes
    ----------
    R : (r, p) [torque / parameter], weighted rows
    z : (r,) [torque], weighted
    rss_min : float [torque²]
        Residual sum of squares that no parameter vector can remove.
    dof : float
        Samples minus rank: ``rss_min / dof`` estimates the noise variance.

    Raises
    ------
    ValueError
        When shapes disagree or a number is not finite.
    """

    R: Array
    z: Array
    rss_min: float
    dof: float

    def __post_init__(self) -> None:
        R, z = self.R, self.z
        if R.ndim != 2 or z.shape != R.shape[:1]:
            raise ValueError(
                f"least-squares problem: R {R.shape} and z {z.shape} were given; "
                "expected R (r, p) and z (r,) with the same r; compress [W tau] in one go."
            )
        if not (np.isfinite(R).all() and np.isfinite(z).all()):
            raise ValueError(
                "least-squares problem: R or z holds a number that is not finite; "
                "drop the samples whose motion or torque is missing before compressing."
            )
        if not (self.rss_min >= 0 and self.dof > 0):
            raise ValueError(
                f"least-squares problem: rss_min {self.rss_min:g} and dof {self.dof:g} were given; "
                "expected rss_min ≥ 0 and dof > 0; use more samples than the model has base "
                "parameters."
            )

    @staticmethod
    def of_fit(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the loss that an estimate made least, in its own k parameters.

        Parameters
        ----------
        information : Information
            That was fitted.
        estimate : Estimate
        """
        F = estimate.estimator.loss(information, estimate)
        variance = float(estimate.weights @ estimate.rss) / max(estimate.dof, 1)
        rss = max(float(F[-1, -1] ** 2), variance * 1e-12)
        return LeastSquares(F[:-1, :-1], F[:-1, -1], rss, max(float(estimate.dof), 1.0))

    @staticmethod
    def likelihood(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the same for a posterior: it counts as many rows as are independent.

        To it data without noise have a little of it.
        """
        tau = float(np.linalg.norm(estimate.estimator.loss(information, estimate)[:, -1]))
        rss = max(float(estimate.weights @ estimate.rss), (1e-9 * tau) ** 2)
        dof = max(information.rows / estimate.memory - len(estimate.kept), 1.0)
        return replace(LeastSquares.of_fit(information, estimate), rss_min=rss, dof=dof)

    def through(self, to_x: Array) -> LeastSquares:
        """Return the problem in other parameters phi, of which these are ``to_x (p, q) phi``."""
        return replace(self, R=self.R @ to_x)

    def beside(self, rows: Array, aim: Array) -> LeastSquares:
        """Return the problem with further squares ``rows (m, p) phi − aim (m,)`` [torque]."""
        return replace(self, R=np.vstack([self.R, rows]), z=np.concatenate([self.z, aim]))

    @property
    def variance(self) -> float:
        """Estimate of the noise variance [torque²]."""
        return self.rss_min / self.dof

    @property
    def unit(self) -> float:
        """Residual that counts as one: the noise sd [torque], never below 1e-6 of the signal."""
        return float(
            max(np.sqrt(self.variance), 1e-6 * np.linalg.norm(self.z), np.finfo(float).tiny)
        )

    def rss(self, phi: Array) -> Array:
        """Residual sum of squares (...) [torque²] of parameter vectors ``phi (..., p)``."""
        residual = np.asarray(phi) @ self.R.T - self.z
        total: Array = np.einsum("...r,...r->...", residual, residual) + self.rss_min
        return total
