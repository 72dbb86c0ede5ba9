"""Least squares beside values that are known beforehand, with their errors."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import Array
from identifiability.regression.information import Information


def fit_known(
    information: Information,
    free: Estimate,
    root: Array,
    kept: Array | None = None,
    more: Array | None = None,
) -> Array:
    """Return the values (b + m,) of least squares where the first b have known errors.

    Parameters
    ----------
    information : Information
    free : Estimate
        From it, without these: how much each joint scatters, and for how long.
    root : (d, b)
    kept : (b,), optional
        The first b values, where they are not fitted again.
    more : (r, b + m), optional
        Further observations of zero, in units of the noise.
    """
    variance = free.variance * free.times
    least = 1e-12 * float(variance.max()) or 1.0
    R = information.factor(1.0 / np.maximum(variance, least))
    k = information.size
    if more is not None:
        R = np.concatenate([R, np.pad(more, ((0, 0), (0, 1)))])
    known = np.zeros((len(root), k + 1))
    known[:, : root.shape[1]] = root
    both = np.concatenate([R, known])
    if kept is not None:
        b = len(kept)
        return np.concatenate([kept, solve_in_units(R[:, b:k], R[:, k] - R[:, :b] @ kept)])
    return solve_in_units(both[:, :k], both[:, k])


def solve_in_units(A: Array, y: Array) -> Array:
    """Return the least-squares values (k,) of columns (R, k), whatever their units; least norm."""
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    value: Array = np.linalg.lstsq(A / length, y, rcond=1e-9)[0] / length
    return value
