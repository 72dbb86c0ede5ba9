"""Outlying stretches of time: weighed down as far as they are farther from the model than chance.

In a stretch in which the robot was touched, hit a stop, or a sensor failed for longer than a sample
the residual is far beyond that of all others, and least squares follows it. The mean square of what
a fit leaves of each block of time and actuator is compared with the usual one of its log; Huber's
weight of it [Huber 1964], one up to a limit and its inverse beyond, makes what lies far out count
by its own variance, as `estimate.weigh_logs` does with whole logs, so that it moves the less the
farther out it lies. The limit is what the largest of so many blocks is by chance, so logs without
outliers are as they were. Iterated to convergence from `Information` alone.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from identifiability.estimation.bootstrap import FEWEST_BLOCKS
from identifiability.estimation.estimator import NOTHING, Estimate, Estimator
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Weights are iterated until none changes by more than this share, but no oftener than so.
SETTLED, ROUNDS = 0.02, 30


@frozen
class Outliers:
    """Blocks of which an actuator's torque is weighed down.

    Attributes
    ----------
    log : (m,) int
        Which log each comes from.
    first, last : (m,) int
        Its outputs [first, last) in that log.
    beyond : (m, n)
        Mean square of each actuator's residual there, in those of the usual block.
    moved : (k,)
        By how much each value moves with their whole weight, in the standard deviations that the
        scatter of all blocks gives.
    """

    log: np.ndarray
    first: np.ndarray
    last: np.ndarray
    beyond: Array
    moved: Array


def weigh_outliers(
    information: Information, estimator: Estimator
) -> tuple[Information, Outliers | None]:
    """Return the information with Huber weights of its blocks, and those that lie out, if any.

    Parameters
    ----------
    information : Information
        About all columns: what a smaller model leaves out is no outlier.
    estimator : Estimator
    """
    if len(information.counts) < FEWEST_BLOCKS:
        return information, None
    before = fit = estimator.fit(information)
    weighed, weights = information, np.ones((information.actuators, len(information.counts)))
    for _ in range(ROUNDS):
        beyond, limit = _measure(information, fit)
        last, weights = weights, np.minimum(1.0, limit / np.maximum(beyond, limit))
        weighed = information if (weights == 1.0).all() else information.weigh(weights)
        if np.abs(np.log(weights / last)).max() < SETTLED:
            break
        fit = estimator.fit(weighed)
    out = (weights < 1.0).any(0)
    if not out.any():
        return information, None
    scatter = np.sqrt((fit.estimator.influence(weighed, fit) ** 2).sum(0))
    known = fit.determined & (scatter > 0)
    moved = np.abs(before.value - fit.value) / np.where(known, scatter, np.inf)
    stop = _ends(information)
    return weighed, Outliers(
        information.log[out], (stop - information.counts)[out], stop[out], beyond.T[out], moved
    )


def _measure(information: Information, fit: Estimate) -> tuple[Array, Array]:
    """Return each block's mean square over the usual one of its log, and its limit, (n, B)."""
    squares = information.squares_of_blocks(np.append(-fit.value, 1.0)[:, None])
    rows = information.data.T
    freedom = np.maximum(rows / fit.times[:, None], 1.0)
    beyond = np.zeros(squares.shape)
    floor = NOTHING**2 * information.torque / information.rows_each  # rounding is no noise
    for log in np.unique(information.log):
        own = information.log == log
        mean = squares[:, own] / np.maximum(rows[:, own], 1)
        for a, (x, f, some) in enumerate(zip(mean, freedom[:, own], rows[:, own] > 0, strict=True)):
            if some.any():  # a mean square of noise has this median
                usual = np.median(x[some] * f[some] / chdtri(f[some], 0.5))
                beyond[a, own] = x / max(usual, floor[a], 1e-300)
    chance = chdtri(freedom, 0.5 / squares.size)
    return beyond, chance / freedom


def _ends(information: Information) -> np.ndarray:
    """Return the output of its log before which each block ends, (B,) int."""
    logs = np.unique(information.log)
    return np.concatenate([np.cumsum(information.counts[information.log == k]) for k in logs])
