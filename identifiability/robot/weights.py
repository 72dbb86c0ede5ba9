"""The ten parameters of a body from its mass, centre and moments of inertia."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected
from identifiability.robot.locking import least_eigenvalue

Point = Annotated[Sequence[float] | np.ndarray, Expected("three numbers, x, y and z")]
Moments = Annotated[
    Sequence[float] | Sequence[Sequence[float]] | np.ndarray,
    Expected("three moments of inertia about the centre, or a symmetric (3, 3) of them"),
]

#: By how much of its largest number a body may fail to be possible; what rounding does.
ROUNDING = 1e-12


def ten_parameters(mass: float, centre: Point, inertia: Moments) -> Array:
    """Return the parameters of a body in the order of `INERTIAL_KINDS`, (10,).

    Parameters
    ----------
    mass : float [kg]
    centre : (3,) [m]
        Its centre of mass, in the frame of the joint that moves it.
    inertia : (3,) or (3, 3) [kg·m²]
        About the centre, along the axes of that frame.

    Raises
    ------
    RobotError
        If no real body has them.
    """
    c, about = np.asarray(centre, float), np.asarray(inertia, float)
    about = np.diag(about) if about.shape == (3,) else about
    given = [mass, *c.ravel(), *about.ravel()]
    if c.shape != (3,) or about.shape != (3, 3) or not np.isfinite(given).all():
        raise RobotError(
            "A body has a mass, a centre of three numbers and an inertia of three moments or a "
            "(3, 3) tensor about that centre; give finite numbers."
        )
    tensor = about + mass * (c @ c * np.eye(3) - np.outer(c, c))
    first = mass * c
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor
    theta = np.array([mass, *first, xx, xy, yy, xz, yz, zz])
    if not np.allclose(about, about.T, rtol=ROUNDING) or mass < 0 or not possible(theta):
        raise RobotError(
            f"No real body has a mass of {mass:g} kg and these moments of inertia about its "
            "centre: the largest is at most the sum of the others, and none is below zero."
        )
    return theta


def possible(theta: Array) -> bool:
    """Whether some real body has these ten parameters."""
    least: float = least_eigenvalue(theta)
    return least >= -ROUNDING * float(np.abs(theta).max())
