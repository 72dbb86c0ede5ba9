"""Standard deviations from the scatter of scores over stretches of time, column by column.

Residuals remember, but not every parameter suffers alike: what counts is how long the *score* of a
column (column times residual) remembers. Sums of scores over stretches longer than that are
independent, and the scatter of what they do to the values is the variance of the estimate [Liang &
Zeger 1986]; how much that is, the estimator says.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri, stdtrit

from identifiability.estimation.bootstrap import merge_blocks
from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import Array
from identifiability.foundation.shares import ENDS
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
    """

    sd: Array
    stretches: int

    @property
    def widened(self) -> Array:
        """Standard deviations with which a normal interval has the width of Student's t, (k,)."""
        if self.stretches < 2:
            return self.sd
        factor = stdtrit(self.stretches - 1, ENDS[1]) / ndtri(ENDS[1])
        wider: Array = self.sd * factor
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
    return ScoreScatter(np.where(fit.determined, sd, np.inf), B)


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
