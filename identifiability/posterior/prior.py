"""What the user knew before the data: a normal distribution per parameter."""

from typing import Self

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: A body is at least this thick, as a share of its second moment, where a scale is taken from it.
THIN = 1e-3


@frozen
class Prior:
    """Independent normal priors; an infinite sd is a flat one.

    Attributes
    ----------
    mean : (p,)
    sd : (p,) > 0, may be infinite where the data determine the parameter

    Raises
    ------
    ValueError
        When shapes disagree or an sd is not positive.
    """

    mean: Array
    sd: Array

    def __post_init__(self) -> None:
        """Check and freeze."""
        mean, sd = self.mean, self.sd
        if mean.ndim != 1 or mean.shape != sd.shape:
            raise ValueError(
                f"prior: mean {mean.shape} and sd {sd.shape} were given; "
                "expected one of each per parameter."
            )
        if not (np.isfinite(mean).all() and (sd > 0).all()):
            raise ValueError(
                f"prior: mean or sd of parameters {_bad(mean, sd)} is not usable; "
                "expected a finite mean and sd > 0; use sd = inf where nothing is known."
            )

    @classmethod
    def flat(cls, size: int) -> Self:
        """Know nothing: proper only for parameters that the data determine.

        Parameters
        ----------
        size : int
        """
        return cls(np.zeros(size), np.full(size, np.inf))

    @classmethod
    def around(cls, phi: Array, bodies: np.ndarray, relative: float, floor: Array) -> Self:
        """Around a nominal robot, each sd a share of the body's own scale.

        Moments of inertia and the mass have their own size. Products of inertia and first moments
        have the most that a body may have: ``√(Σxx Σyy)`` and ``√(m Σxx)`` with the second moment
        Σ of the material along each axis. A scale alike along all axes would give a rod's prior
        the width of a ball's: bodies that can exist, around a thin one, are then almost all
        thicker, and that pulls what the data measure too (1.3 standard deviations on an arm).

        Parameters
        ----------
        phi : (p,)
        bodies : (nb, 10) int
        relative : float
        floor : (p,)
            sd of the other parameters that are zero in `phi`; the rest get ``relative · |phi|``.
        """
        size = np.abs(phi)
        sd = np.where(size > 0, relative * size, floor)
        theta = phi[bodies]
        mass, inertia = np.abs(theta[:, 9]), np.abs(theta[:, [0, 3, 5]])
        second = inertia.sum(axis=1)[:, None] / 2
        if not ((mass > 0) & (second[:, 0] > 0)).all():
            body = int(np.argmin((mass > 0) & (second[:, 0] > 0)))
            raise ValueError(
                f"prior around CAD: body {body + 1} has no mass or no inertia; expected nominal "
                "values to take a scale from; state mean and sd of this body yourself."
            )
        along = np.maximum(second - inertia, THIN * second)
        root = np.sqrt(np.column_stack([along, mass]))
        size = root[:, [0, 0, 0, 1, 1, 2, 0, 1, 2, 3]] * root[:, [0, 1, 2, 1, 2, 2, 3, 3, 3, 3]]
        size[:, [0, 3, 5]] = np.maximum(inertia, THIN * second)
        sd[bodies] = relative * size
        return cls(phi, sd)


def _bad(mean: Array, sd: Array) -> str:
    return ", ".join(str(j) for j in np.flatnonzero(~np.isfinite(mean) | ~(sd > 0))[:8])
