"""What the user knew before the data: a normal distribution per parameter."""

from typing import Self

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.pseudo_inertia import entry_scale


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

        An entry that is zero by symmetry gets the scale of its kind: ``m ℓ²`` for inertias, ``m ℓ``
        for first moments, ``m`` for the mass, with ``ℓ`` the root mean square distance of the
        material from the frame origin.

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
        mass = np.abs(phi[bodies[:, 9]])
        second = np.abs(phi[bodies[:, [0, 3, 5]]].sum(axis=1)) / 2
        if not ((mass > 0) & (second > 0)).all():
            body = int(np.argmin((mass > 0) & (second > 0)))
            raise ValueError(
                f"prior around CAD: body {body + 1} has no mass or no inertia; expected nominal "
                "values to take a scale from; state mean and sd of this body yourself."
            )
        sd[bodies] = entry_scale(relative * mass, np.sqrt(second / mass))
        return cls(phi, sd)


def _bad(mean: Array, sd: Array) -> str:
    return ", ".join(str(j) for j in np.flatnonzero(~np.isfinite(mean) | ~(sd > 0))[:8])
