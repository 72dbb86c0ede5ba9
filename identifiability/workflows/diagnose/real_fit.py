"""Fits within what a real robot can have [Traversaro 2016]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from identifiability.foundation.names import Array
from identifiability.physical.fitted_model import LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.structure import Structure


def fit_real(structure: Structure, R: Array, positive: Sequence[bool], rows: int) -> Array | None:
    """Return the values (b + m,) of the real robot nearest to the data; None if there is none.

    Parameters
    ----------
    structure : Structure
        Of the b base parameters.
    R : (b + m + 1, b + m + 1)
        Triangular factor of columns and torque, in units of the noise.
    positive : sequence of bool, (m,)
        Of which further columns the sign is known.
    rows : int
    """
    region = physical_set(structure)
    if not len(region.bodies):
        return None
    m, b = len(R) - 1, len(structure.G)
    G = block_diag(structure.G, np.eye(m - b))
    region = replace(
        region,
        nonnegative=np.concatenate([region.nonnegative, np.array(positive, bool)]),
        columns=(*region.columns, *(f"effect {k + 1}" for k in range(m - b))),
    )
    data = LeastSquares(R[:m, :m] @ G, R[:m, m], float(R[m, m] ** 2), float(max(rows - m, 1)))
    reference = np.concatenate([structure.nominal, np.zeros(m - b)])
    try:
        value: Array = G @ Projection(region, reference=reference).solve(data).phi
    except ValueError:
        return None
    return value
