"""Standard deviations from the scatter of scores over stretches of time, column by column.

Residuals remember, but not every parameter suffers alike: what counts is how long the *score* of a
column (column times residual) remembers. Sums of scores over stretches longer than that are
independent, and the scatter of what they do to the values is the variance of the estimate [Liang &
Zeger 1986]; how much that is, the estimator says.

How many independent outputs such a standard deviation rests on differs from parameter to parameter:
a few stretches may determine one almost alone, and what a fit takes of noise there is gone from the
residual. These are the degrees of freedom of its Student's t [Bell & McCaffrey 2002], so intervals
grow smoothly where logs get too short for a model, direction by direction.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri, stdtrit

from identifiability.estimation.bootstrap import merge_blocks
from identifiability.estimation.estimator import Estimate
from identifiability.foundation.linalg import unit_coordinates
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: A stretch is so many autocorrelation times long, as long as there are `FEWEST` of them.
MEMORIES, FEWEST = 5.0, 12

#: By how much stretches get shorter while there are too few.
SHORTER = 0.9


@frozen
class ScoreScatter:
    """Standard deviations of an estimate from the scatter of its scores.

    Attributes
    ----------
    sd : (k,)
        Infinite where the estimate is not determined.
    stretches : int
    freedom : (k,)
        Degrees of freedom of each: independent outputs that its scatter was seen in.
    """

    sd: Array
    stretches: int
    freedom: Array

    @property
    def widened(self) -> Array:
        """Standard deviations with which a normal interval has the width of Student's t, (k,)."""
        wider: Array = self.sd * stdtrit(self.freedom, ENDS[1]) / ndtri(ENDS[1])
        return wider


def scatter_scores(information: Information, fit: Estimate, time: float) -> ScoreScatter | None:
    """Return the standard deviations of a fit by the scatter of its scores; None without blocks.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    time : float [samples]
        Autocorrelation time of the residual.
    """
    least = min(MEMORIES * time, information.samples / FEWEST)
    merged = merge_blocks(information, least)
    while len(merged.counts) < min(FEWEST, len(information.counts)):  # logs cut stretches short
        least *= SHORTER
        merged = merge_blocks(information, least)
    B = len(merged.counts)
    if B < FEWEST or not fit.kept:
        return None
    variance = (fit.estimator.influence(merged, fit) ** 2).sum(0)
    length = merged.samples / B
    sd = np.sqrt(variance * longer(variance, fit, length))
    return ScoreScatter(np.where(fit.determined, sd, np.inf), B, count_freedom(merged, fit))


def count_freedom(information: Information, fit: Estimate) -> Array:
    """Return the degrees of freedom of each parameter's scatter over blocks, (k,).

    By the mean and the variance of the sum of squares of what blocks do to the value, if what the
    fit leaves is that of white noise [Bell & McCaffrey 2002; Satterthwaite 1946]; one at least.

    Parameters
    ----------
    information : Information
        About the fitted columns, in blocks that are independent.
    fit : Estimate
    """
    kept = list(fit.kept)
    k, part = len(kept), information.select(fit.kept)
    to_x = unit_coordinates(part.factor(fit.weights)[:k, :k])
    change = np.vstack([to_x, np.zeros((1, k))])
    # Block a scatters with b as ``t' (δ_ab A_a - A_a A_b) t`` in the direction t of a parameter.
    Q = part.products(fit.weights, change, change) @ to_x.T
    own, taken = np.einsum("ip,bip->bp", to_x.T, Q), (Q * Q).sum(1)
    few = "aip,bip->pab" if len(Q) < k else "aip,ajp->pij"
    both = (np.einsum(few, Q, Q, optimize=True) ** 2).sum((1, 2))
    mean, variance = (own - taken).sum(0), (own**2 - 2 * own * taken).sum(0) + both
    freedom = np.ones(information.size)
    freedom[kept] = np.maximum(mean**2 / np.maximum(variance, 1e-300), 1.0)
    return freedom


def _white(fit: Estimate) -> Array:
    square = np.diag(fit.covariance)
    return np.where(np.isfinite(square) & (square > 0), square, np.inf)


def longer(variance: Array, fit: Estimate, length: float) -> Array:
    """Return by how much the variance of longer stretches would be larger, (k,).

    Parameters
    ----------
    variance : (k,)
        Of the values of a fit, from the scatter over stretches.
    fit : Estimate
    length : float [samples]
        Of the stretches.

    Of scores with autocorrelation time τ, sums over stretches of length L have τ (1 - τ/2L) times
    the variance of white ones; beyond that, stretches are too short to say.
    """
    share = np.clip(variance / _white(fit) / length, 1e-12, 0.5)
    factor: Array = (1.0 - np.sqrt(1.0 - 2.0 * share)) / share
    return factor
