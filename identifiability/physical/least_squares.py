"""What the data say about the parameters: a compressed least-squares problem."""

import numpy as np
from numpy.typing import NDArray

from identifiability.foundation.values import frozen

Floats = NDArray[np.float64]


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

    R: Floats
    z: Floats
    rss_min: float
    dof: float

    def __post_init__(self) -> None:
        R, z = np.array(self.R, float), np.array(self.z, float)
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
        for name, array in (("R", R), ("z", z)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

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

    def rss(self, phi: Floats) -> Floats:
        """Residual sum of squares of parameter vectors.

        Parameters
        ----------
        phi : (..., p)

        Returns
        -------
        (...) [torque²]
        """
        residual = np.asarray(phi) @ self.R.T - self.z
        total: Floats = np.einsum("...r,...r->...", residual, residual) + self.rss_min
        return total
