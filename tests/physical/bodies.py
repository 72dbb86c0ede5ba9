"""Bodies for tests, from their pseudo-inertia."""

import numpy as np


def to_vector(J):
    """Return the ten inertial parameters of pseudo-inertia matrices, (..., 4, 4) -> (..., 10)."""
    xx = J[..., 0, 0]
    yy = J[..., 1, 1]
    zz = J[..., 2, 2]
    columns = (yy + zz, -J[..., 0, 1], -J[..., 0, 2], xx + zz, -J[..., 1, 2], xx + yy)
    return np.stack((*columns, J[..., 0, 3], J[..., 1, 3], J[..., 2, 3], J[..., 3, 3]), axis=-1)
