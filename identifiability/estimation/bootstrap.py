"""Refits on resampled blocks of time, from `Information` alone.

Residuals of robots are autocorrelated; drawing whole blocks of consecutive samples, regressor and
torque together, keeps the correlation inside a block and makes no model of it [Künsch 1989]. A
replicate is a weighted sum of the blocks' Gram matrices, so its cost does not know the number of
samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import LEVEL
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Fewer blocks than this say nothing about the spread between blocks.
FEWEST_BLOCKS = 8


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

    def stretch(self, value: Array, factor: Array) -> Bootstrap:
        """Return the values farther from those of the fit.

        Parameters
        ----------
        value, factor : (k,)
        """
        return replace(self, values=value + factor * (self.values - value))

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
        Samples a block; see `noise.block_length`.

    Raises
    ------
    IdentifiabilityError
        If there are too few blocks to resample.
    """
    merged = merge_blocks(information, length)
    blocks = len(merged.counts)
    if blocks < FEWEST_BLOCKS:
        raise IdentifiabilityError(
            f"The residual is correlated over {length:.0f} samples, so {information.samples} "
            f"samples make only {blocks} independent blocks; the bootstrap needs {FEWEST_BLOCKS}: "
            "give longer or more logs, or a higher cut-off."
        )
    counts = draw_blocks(blocks, replicates, rng)
    values = estimate.estimator.refit(merged, estimate, counts)
    good = np.isfinite(values).all(1)
    return Bootstrap(information.columns, values[good], blocks)
