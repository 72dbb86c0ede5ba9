"""Standard deviations of values from blocks of time: refits on resampled blocks, and scores.

All from `Information` alone; scores scatter over stretches of time, column by column.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.rules import RULES
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.linalg import unit_coordinates
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS, LEVEL
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

# Refits on resampled blocks of time, from `Information` alone.
#
# Residuals of robots are autocorrelated; drawing whole blocks of consecutive samples, regressor
# and torque together, keeps the correlation inside a block and makes no model of it [Künsch 1989].
# A replicate is a weighted sum of the blocks' Gram matrices, so its cost does not know the number
# of samples.


@frozen
class Bootstrap:
    """Parameter values of refits.

    Attributes
    ----------
    columns : tuple of str
    values : (replicates, k)
        Columns that the estimate dropped are zero.
    blocks : int
        Number of blocks that were drawn from.
    """

    columns: tuple[str, ...]
    values: Array
    blocks: int

    @property
    def sd(self) -> Array:
        """Standard deviation of each parameter, (k,): half the width of the central 68 %.

        Where blocks are few, some replicates hold too few different ones to be solved well.
        """
        low, high = np.quantile(self.values, ndtr([-1.0, 1.0]), axis=0)
        spread: Array = 0.5 * (high - low)
        return spread

    @property
    def correlation(self) -> Array:
        """Correlation of the parameters, (k, k)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            rho = np.corrcoef(self.values, rowvar=False)
        whole: Array = np.nan_to_num(np.atleast_2d(rho))
        return whole

    def interval(self, level: float = LEVEL) -> Array:
        """Return percentile intervals, (k, 2)."""
        tail = 0.5 * (1 - level)
        bounds: Array = np.quantile(self.values, [tail, 1 - tail], axis=0).T
        return bounds


def merge_blocks(information: Information, length: float) -> Information:
    """Return the information with blocks of at least `length` samples, none across logs.

    Parameters
    ----------
    information : Information
    length : float
        Samples; blocks shorter than that are added to the next ones of their log.
    """
    starts, counts = [], []
    for log in np.unique(information.log):
        rows = np.flatnonzero(information.log == log)
        total = int(information.counts[rows].sum())
        wanted = max(1, int(total // max(length, 1.0)))
        reached = np.cumsum(information.counts[rows])
        # Boundaries nearest to an even division, so that no short block is left at the end.
        edges = np.searchsorted(reached, np.arange(1, wanted) * total / wanted) + 1
        first = np.unique(np.concatenate([[0], np.minimum(edges, len(rows) - 1)]))
        starts.append(rows[first])
        counts.append(len(first))
    return information.merge(np.concatenate(starts))


def draw_blocks(blocks: int, replicates: int, rng: np.random.Generator) -> Array:
    """Return how often each block is drawn in each replicate, (replicates, blocks)."""
    draws: Array = rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=replicates)
    return draws.astype(float)


def bootstrap(
    information: Information,
    estimate: Estimate,
    rng: np.random.Generator,
    *,
    replicates: int = 1000,
    length: float = 1.0,
) -> Bootstrap:
    """Refit on resampled blocks.

    Parameters
    ----------
    information : Information
        About the columns of `estimate`.
    estimate : Estimate
        Its estimator refits the columns that it kept.
    rng : numpy.random.Generator
    replicates : int
    length : float
        Samples a block.

    Raises
    ------
    IdentifiabilityError
        If there are too few blocks to resample.
    """
    merged = merge_blocks(information, length)
    blocks = len(merged.counts)
    if blocks < RULES.blocks_fewest:
        raise IdentifiabilityError(
            f"The residual is correlated over {length:.0f} samples, so {information.samples} "
            f"samples make only {blocks} independent blocks; the bootstrap needs "
            f"{RULES.blocks_fewest}: give longer or more logs, or a higher cut-off."
        )
    counts = draw_blocks(blocks, replicates, rng)
    values = estimate.estimator.refit(merged, estimate, counts)
    good = np.isfinite(values).all(1)
    return Bootstrap(information.columns, values[good], blocks)


# Standard deviations from the scatter of scores over stretches of time, column by column.
#
# Residuals remember, but not every parameter suffers alike: what counts is how long the *score* of
# a column (column times residual) remembers. Sums of scores over stretches longer than that are
# independent, and the scatter of what they do to the values is the variance of the estimate [Liang
# & Zeger 1986]; how much that is, the estimator says.
#
# How many independent outputs such a standard deviation rests on differs from parameter to
# parameter: a few stretches may determine one almost alone, and what a fit takes of noise there is
# gone from the residual. These are the degrees of freedom of its Student's t [Bell & McCaffrey
# 2002], so intervals grow smoothly where logs get too short for a model, direction by direction.


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
    least = min(RULES.memories * time, information.samples / RULES.stretches_fewest)
    merged = merge_blocks(information, least)
    fewest = min(RULES.stretches_fewest, len(information.counts))
    while len(merged.counts) < fewest:  # logs cut stretches short
        # By how much stretches get shorter while there are too few.
        least *= 0.9
        merged = merge_blocks(information, least)
    B = len(merged.counts)
    if not fit.kept or RULES.stretches_fewest > B:
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
