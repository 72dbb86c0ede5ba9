"""Bodies for tests, from their pseudo-inertia."""

import numpy as np

from identifiability.physical.fitted_model import PhysicalSet
from identifiability.physical.pseudo_inertia import to_matrix


def to_vector(J):
    """Return the ten inertial parameters of pseudo-inertia matrices, (..., 4, 4) -> (..., 10)."""
    xx = J[..., 0, 0]
    yy = J[..., 1, 1]
    zz = J[..., 2, 2]
    columns = (yy + zz, -J[..., 0, 1], -J[..., 0, 2], xx + zz, -J[..., 1, 2], xx + yy)
    return np.stack((*columns, J[..., 0, 3], J[..., 1, 3], J[..., 2, 3], J[..., 3, 3]), axis=-1)


def divergence(theta, nominal):
    """Return the log-det divergence of bodies (..., 10) from those of a file, summed."""
    ratio = np.linalg.solve(to_matrix(nominal), to_matrix(theta))
    away = np.trace(ratio, axis1=-2, axis2=-1) - np.linalg.slogdet(ratio)[1] - 4
    return float(away.sum())


def without_bodies(nonnegative):
    """Return the set of what is possible of parameters of which some may not be negative."""
    return PhysicalSet(np.empty((0, 10), int), np.asarray(nonnegative))
