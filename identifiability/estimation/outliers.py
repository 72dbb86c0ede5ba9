"""Outlying stretches of time: weighed down as far as they are farther from the model than chance.

In a stretch in which the robot was touched, hit a stop, or a sensor failed for longer than a sample
the residual is far beyond that of all others, and least squares follows it. The mean square of what
a fit leaves of each block of time and actuator is compared with the usual one of its log; Huber's
weight of it [Huber 1964], one up to a limit and its inverse beyond, makes what lies far out count
by its own variance, as `estimate.weigh_logs` does with whole logs, so that it moves the less the
farther out it lies. The limit is what the largest of so many blocks is by chance, so logs without
outliers are as they were. Iterated to convergence from `Information` alone.

Far from the model is also what the model leaves out: where a joint turns round, say, again and
again. Such blocks are no accident but the only ones that say how the robot moves there, and other
motion has them, too. So the weights stand only where the fit with them predicts the torque of
blocked folds, all of it, no worse than the fit without. An accident is in one fold, whose fits have
not seen it, and spoils all others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtri

from identifiability.estimation.bootstrap import FEWEST_BLOCKS
from identifiability.estimation.estimator import NOTHING, Estimate, Estimator
from identifiability.estimation.evidence import Folds, Score
from identifiability.foundation.errors import LogError
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
    if not out.any() or not _predicts(information, (before, fit), weighed):
        return information, None
    scatter = np.sqrt((fit.estimator.influence(weighed, fit) ** 2).sum(0))
    known = fit.determined & (scatter > 0)
    moved = np.abs(before.value - fit.value) / np.where(known, scatter, np.inf)
    stop = _ends(information)
    return weighed, Outliers(
        information.log[out], (stop - information.counts)[out], stop[out], beyond.T[out], moved
    )


def _predicts(information: Information, fits: Sequence[Estimate], weighed: Information) -> bool:
    """Return whether fits to folds of weighed blocks err no more than those to the blocks.

    Parameters
    ----------
    information : Information
    fits : sequence of Estimate
        To the information, and to it with weights.
    weighed : Information
    """
    try:
        folds = Folds.of(information, float(fits[0].times.max()))
    except LogError:  # too short to be asked
        return True
    tests = folds.test == np.arange(folds.count)[:, None]
    errors = []
    for part, fit in zip((information, weighed), fits, strict=True):
        values = fit.estimator.refit(part, fit, folds.train.astype(float))
        each = [information.squares_of_blocks(np.append(-v, 1.0)[:, None]) for v in values]
        squares = np.array([x @ own for x, own in zip(each, tests, strict=True)])
        errors.append(Score.of_errors(squares, information.variation, folds.ratio).error)
    return not errors[1] > errors[0]


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
