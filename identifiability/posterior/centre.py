"""The middle of a posterior with its boundary, and how wide it is there.

Both come from the density times a logarithmic barrier [Nesterov 1994]. Where the data push against
the boundary at a rate d the barrier's optimum is 1/d away from it and 1/d wide, and so is the
posterior; between two walls it is in the middle and a third of the gap wide. No draws are needed.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.posterior.cone import Cone
from identifiability.posterior.target import Diagonal

#: Newton's method stops when it may still gain this much of the logarithm of the density, and
#: after so many steps; it needs ten to thirty.
GAIN, STEPS = 1e-3, 200

#: Rounds of noise variance and parameters in turn.
ROUNDS = 3


def find_centre(model: Diagonal, region: Cone, start: Array) -> tuple[Array, Array]:
    """Find the optimum of density and barrier.

    Parameters
    ----------
    model : Diagonal
        Of one data set.
    region : Cone
    start : (p,)
        Inside the region.

    Returns
    -------
    centre : (p,)
    root : (p, p)
        ``root rootᵀ`` is about the covariance of the posterior.
    """
    eta, root = start, np.eye(len(start))
    for _ in range(ROUNDS):
        v = model.typical_variance(eta[None])
        mean, sd = model.conditional(v)
        eta, root = _climb(mean[0], sd[0], region, eta)
    return eta, root


def _climb(mean: Array, sd: Array, region: Cone, eta: Array) -> tuple[Array, Array]:
    """Newton's method for a Gaussian and the barrier, which are self-concordant together."""
    value, slope, bend = _cost(eta, mean, sd, region)
    for _ in range(STEPS):
        root = np.linalg.inv(np.linalg.qr(bend, mode="r"))
        step = root @ (root.T @ slope)
        gain = float(slope @ step)
        if gain < GAIN:
            break
        # A step this short stays inside and gains; a longer one is tried first.
        share, safe = 1.0, 1 / (1 + np.sqrt(gain))
        while True:
            new = _cost(eta - share * step, mean, sd, region)
            if share <= safe or new[0] < value - 0.1 * share * gain:
                break
            share = max(share / 2, safe)
        eta = eta - share * step
        value, slope, bend = new
    return eta, root


def _cost(eta: Array, mean: Array, sd: Array, region: Cone) -> tuple[float, Array, Array]:
    """Minus the logarithm of density and barrier, its slope, and a root of its bend."""
    value, slope, bend = region.barrier(eta)
    off = (eta - mean) / sd
    return value + float(off @ off) / 2, slope + off / sd, np.vstack([np.diag(1 / sd), bend])
