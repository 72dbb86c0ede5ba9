"""Stretches of time that no model follows and that nevertheless decide what values are found.

A stretch in which the robot was touched, hit a stop, or a sensor failed for longer than a sample
has a residual far beyond that of all others. Least squares follows it: what its scores do to the
values is compared with the scatter of what all other stretches do to them [Cook 1977]. As a single
wrong sample it must not decide: it is left out of the fit, and named. Stretches that are too much
of the logs to be an accident stay, and are named too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.bootstrap import FEWEST_BLOCKS, merge_blocks
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Samples of a block, at least: the mean square of fewer varies too much by itself.
LEAST = 4

#: The mean square of a residual is far beyond the usual one from so many times on.
BEYOND = 100.0

#: It is also so large, as a share of the rms of the torque: what filters and encoders leave of
#: exact logs is far from nothing at reversals only.
LARGE = 0.1

#: Values that move by so many standard deviations are decided.
DECIDES = 1.5

#: What a far stretch did to the fit hides others: they are looked for anew so often, and no more
#: than this share of the samples is left out.
ROUNDS, MOST = 5, 0.05


@frozen
class Decisive:
    """Blocks that are far from the model and decide a value.

    Attributes
    ----------
    log : (m,) int
        Which log each block comes from.
    first, last : (m,) int
        Its outputs [first, last) in that log.
    beyond : (n,)
        Largest mean square of each actuator's residual there, in those of the usual block.
    parameter : int
        Whose value moves most.
    moved : float
        By how many standard deviations, as the other blocks have them.
    """

    log: np.ndarray
    first: np.ndarray
    last: np.ndarray
    beyond: Array
    parameter: int
    moved: float


def leave_out_bursts(
    information: Information, estimator: Estimator
) -> tuple[Information, Decisive | None]:
    """Return the information with no weight where a stretch would decide, and that stretch if any.

    Parameters
    ----------
    information : Information
        About all columns: what a smaller model leaves out is no burst.
    estimator : Estimator
    """
    kept, first = information, None
    gone = np.zeros(len(information.counts), bool)
    for _ in range(ROUNDS):
        found = find_decisive(kept, estimator.fit(kept))
        if found is None:
            break
        gone |= _inside(information, found)
        if information.counts[gone].sum() > MOST * information.samples:
            return information, None
        kept, first = information.weigh(1.0 - gone), first or found
    if first is None:
        return information, None
    stop = _ends(information)[gone]
    start = stop - information.counts[gone]
    return kept, replace(first, log=information.log[gone], first=start, last=stop)


def _inside(information: Information, found: Decisive) -> np.ndarray:
    """Return the blocks that lie in what was found, (B,) bool."""
    stop = _ends(information)[:, None]
    start = stop - information.counts[:, None]
    own = (information.log[:, None] == found.log) & (start >= found.first) & (stop <= found.last)
    inside: np.ndarray = own.any(1)
    return inside


def _ends(information: Information) -> np.ndarray:
    """Return the output of its log before which each block ends, (B,) int."""
    logs = np.unique(information.log)
    return np.concatenate([np.cumsum(information.counts[information.log == k]) for k in logs])


def find_decisive(information: Information, fit: Estimate) -> Decisive | None:
    """Return the blocks that are far from the model if they decide a value.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    short = information.counts.min(initial=0) < LEAST
    merged = merge_blocks(information, LEAST) if short else information
    if len(merged.counts) < FEWEST_BLOCKS or not fit.kept:
        return None
    beyond = _block_squares(merged, fit)
    far = (beyond > BEYOND).any(1)
    if not far.any() or (~far).sum() < FEWEST_BLOCKS:
        return None
    influence = fit.estimator.influence(merged, fit)
    scatter = np.sqrt((influence[~far] ** 2).sum(0))
    known = fit.determined & (scatter > 0)
    moved = np.abs(influence[far].sum(0)) / np.where(known, scatter, np.inf)
    at = int(np.argmax(moved))
    if moved[at] <= DECIDES:
        return None
    last = _ends(merged)
    return Decisive(
        merged.log[far],
        (last - merged.counts)[far],
        last[far],
        beyond[far].max(0),
        at,
        float(moved[at]),
    )


def _block_squares(information: Information, fit: Estimate) -> Array:
    """Return each block's mean square residual over that of the usual block, (B, n).

    The usual one is taken as so large that what is beyond it is also `LARGE`.
    """
    z = np.append(-fit.value, 1.0)[:, None]
    sums = information.squares_of_blocks(z).T
    mean = sums / np.maximum(information.data, 1)
    torque = information.torque / information.rows_each
    usual = np.maximum(np.median(mean, axis=0), (LARGE**2 / BEYOND) * torque)
    shares: Array = mean / np.where(usual > 0, usual, np.inf)
    return shares
