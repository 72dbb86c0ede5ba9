"""Does the likelihood decide, or the density that the prior happens to have at the edge?

What may not be negative has a flat prior up to the edge, and bodies have one up to those that could
not exist. That density is nobody's knowledge: flat in the square root of an inertia is as good a
choice as flat in the inertia. Far from the edge it does not matter. Near one it does, and where
many meet (rotors of which the file says nothing, thin bodies) a flat prior has next to nothing of
its volume in the corner and takes other values, which are no edge themselves, along.

So a posterior is asked what it would be under priors that differ by powers of the distances to the
edges. To first order a mean moves by its covariance with the logarithm of what the prior is
multiplied by [Gustafson 1996; Kallioinen 2024]: the draws at hand answer, and none is weighed anew.
Intervals get room for that much; where it is more than `SWAY` none is stated.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.physical.feasible_set import PhysicalSet

#: By how much the powers differ, as the root of their sum of squares: one half is the step from
#: flat to flat in the square root, at one edge or shared among several.
POWER = 0.5

#: A mean that moves by more than this share of its standard deviation is the prior's. A value with
#: an edge of its own, and no other, is so where it is less than 2.5 standard deviations away.
SWAY = 0.2

#: Distances below this share of their mean are rounding.
TINY = 1e-9


def log_distances(region: PhysicalSet, phi: Array) -> Array:
    """Return the logarithm of the distance to each edge of a set.

    Parameters
    ----------
    region : PhysicalSet
    phi : (..., p)
        Inside.

    Returns
    -------
    (..., e)
        Of signs and bounds, and of the determinant of each body's matrix.
    """
    rows = phi @ region.rows.T - region.least
    matrices = np.concatenate([region.cone_map, region.ellipsoid_map])
    square = phi @ matrices.reshape(-1, region.size).T
    inside = np.linalg.det(square.reshape(*square.shape[:-1], len(matrices), 4, 4))
    distance = np.concatenate([rows, inside], axis=-1)
    mean = distance.mean(axis=tuple(range(distance.ndim - 1)))
    return np.asarray(np.log(np.maximum(distance, np.maximum(TINY * mean, 1e-300))))


def measure_sway(draws: Array, logs: Array) -> Array:
    """Return how far means may move under other priors, in standard deviations of the draws.

    The worst of all priors that differ by `POWER`. Ensembles are independent, so that products of
    two of them carry no square of their Monte-Carlo error.

    Parameters
    ----------
    draws : (E, K, N, m)
    logs : (E, K, N, e)
        What `log_distances` says of the same draws.

    Returns
    -------
    (m,)
    """
    E, m = draws.shape[0], draws.shape[-1]
    x, g = draws.reshape(E, -1, m), logs.reshape(E, -1, logs.shape[-1])
    x, g = x - x.mean(1, keepdims=True), g - g.mean(1, keepdims=True)
    c = np.swapaxes(x, 1, 2) @ g / x.shape[1]
    square = (c.sum(0) ** 2 - (c**2).sum(0)).sum(-1) / (E * (E - 1))
    sd = draws.reshape(-1, m).std(0)
    moved = POWER * np.sqrt(np.maximum(square, 0.0))
    share: Array = np.divide(moved, sd, out=np.zeros(m), where=sd > 0)
    return share
