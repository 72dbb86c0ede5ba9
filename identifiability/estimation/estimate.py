"""From information to an estimate, by an estimator that is known by name."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from identifiability.foundation.errors import LogError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.options import EstimatorKind, check_choice, checked
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

from .estimator import Estimate, Estimator
from .evidence import HeldOut
from .noise import Noise
from .rules import RULES, Thresholds

#: An estimator, or its name.
Method = str | Estimator

#: ``ols`` reproduces the literature (one variance for all actuators); ``wls`` is the better one
#: whenever joints differ in size or in the memory of their noise.
ESTIMATORS: dict[str, Estimator] = {e.name: e for e in (Estimator(weighted=False), Estimator())}


def find_estimator(method: Method) -> Estimator:
    """Return the estimator of a name.

    Raises
    ------
    OptionError
        If there is none, with those that there are.
    """
    if isinstance(method, Estimator):
        return method
    check_choice("method", method, tuple(ESTIMATORS))
    return ESTIMATORS[method]


#: ``ls``: least squares. ``iv``: instrumental variables, which noise in the motion does not bias.
#: ``auto``: the latter if any log has a second record of its motion.
Kind = EstimatorKind


def estimate_noise(estimator: Estimator, whole: Information) -> Estimator:
    """Return the estimator with the noise of the logs, for all models of them.

    A model that leaves something out leaves it in the residual, where it looks like noise, slow
    noise above all: a constant torque has an infinite memory. Noise is a property of the logs, so
    it is measured once, with all columns in the model. Where too few outputs are independent to fit
    all columns each model measures its own.

    Parameters
    ----------
    estimator : Estimator
    whole : Information
        About all columns.
    """
    fresh = replace(estimator, noise=None)
    fit = fit_whole(replace(fresh, instruments=False), whole)
    if fit is None:
        return fresh
    return replace(fresh, noise=fit.noise)


def fit_whole(estimator: Estimator, whole: Information) -> Estimate | None:
    """Return the fit of all columns; None where too few outputs are independent for them."""
    fit = estimator.fit(whole)
    independent = float(np.sum(whole.rows_each / fit.times))
    if fit.kept and independent >= Thresholds.outputs_per_parameter * len(fit.kept):
        return fit
    return None


def with_known(information: Information, known: Array, noise: Noise | None = None) -> Information:
    """Return the information with the prior of the values.

    The prior limits the size of random effects, even where the rows have little information on
    them.

    Parameters
    ----------
    information : Information
    known : (d, k)
        Rows about its columns, each of variance 1.
    noise : Noise, optional
        That of the logs; by default what a fit without them leaves.
    """
    if not len(known):
        return replace(information, prior=None)
    if noise is None:
        noise = Estimator().fit(information).noise
    unit = np.sqrt(np.mean(noise.variance * noise.times))  # average of noise of weight 1
    prior = unit * np.column_stack([known, np.zeros(len(known))])
    return replace(information, prior=prior)


@checked
def estimate(information: Information, method: Method = "wls") -> Estimate:
    """Return the estimate.

    Parameters
    ----------
    information : Information
    method : str or Estimator
        ``"wls"`` weights actuators by 1 / (variance × memory) of their noise, ``"ols"`` all alike.
    """
    return find_estimator(method).fit(information)


# Outlying stretches of time: their weight falls with their excess distance from the model.
#
# In a stretch in which the robot was touched, hit a stop, or a sensor failed for longer than a
# sample the residual is far beyond that of all others, and least squares follows it. The mean
# square of the residual of each block of time and actuator is compared with the usual one of its
# log. Huber's weight of it [Huber 1964] is one up to a limit and its inverse beyond. So an outlying
# block counts by its variance, and moves the fit less the farther out it lies. The limit is the
# largest mean square of so many blocks by chance, so logs without outliers are unchanged. Iterated
# to convergence from `Information` alone.
#
# Omitted effects are far from the model as well, for example at each reversal of a joint. Such
# blocks are no accident. Only they have information on that motion, and other motion has them, too.
# So the weights stand only where the fit with them predicts the torque of blocked folds, all of it,
# no worse than the fit without. An accident is in one fold, whose fits have not seen it, and spoils
# all others.


@frozen
class Outliers:
    """Blocks with a reduced weight of an actuator's torque.

    Attributes
    ----------
    log : (m,) int
        Which log each comes from.
    first, last : (m,) int
        Its outputs [first, last) in that log.
    beyond : (m, n)
        Mean square of each actuator's residual there, relative to that of a usual block.
    weight : (m,)
        The least of its actuators' weights.
    moved : (k,)
        Change of each value if the blocks had their full weight, in standard deviations by the
        scatter of all blocks.
    share : float
        Largest residual of these blocks, root mean square, over that of the actuator's torque.
    """

    log: np.ndarray
    first: np.ndarray
    last: np.ndarray
    beyond: Array
    weight: Array
    moved: Array
    share: float = 1.0

    def below(self, weight: float = 0.1) -> Outliers | None:
        """Return the blocks with a reduced weight; None if there are none.

        Bursts of 7 to 30 rows weigh at most .05, the worst rows of twelve sound logs .16.
        """
        less = self.weight < weight
        arrays = vars(self).items()
        rows = {k: v[less] for k, v in arrays if k not in ("moved", "share")}
        return replace(self, **rows) if less.any() else None


def weigh_outliers(
    information: Information, estimator: Estimator
) -> tuple[Information, Outliers | None]:
    """Return the information with Huber weights of its blocks, and the outlying blocks, if any.

    Parameters
    ----------
    information : Information
        About all columns: what a smaller model leaves out is no outlier.
    estimator : Estimator
    """
    if len(information.counts) < RULES.blocks_fewest:
        return information, None
    before = fit = estimator.fit(information)
    weighed = information
    weights = np.ones((information.actuators, len(information.counts)))
    # Until none changes by more than two hundredths.
    for _ in range(30):
        beyond, limit = _measure(information, fit)
        last = weights
        weights = np.minimum(1.0, limit / np.maximum(beyond, limit))
        weighed = information if (weights == 1.0).all() else information.weigh(weights)
        if np.allclose(weights, last, rtol=0.02):
            break
        fit = estimator.fit(weighed)
    out = (weights < 1.0).any(0)
    if not out.any():
        return information, None
    with suppress(LogError):  # too short to be asked
        held_out = HeldOut.of(information, before.noise)
        train = held_out.folds.train.astype(float)
        pairs = ((information, before), (weighed, fit))
        values = [f.estimator.refit(part, f, train) for part, f in pairs]
        if held_out.score(values[1]).error > held_out.score(values[0]).error:
            return information, None
    influence = fit.estimator.influence(weighed, fit)
    scatter = np.sqrt((influence**2).sum(0))
    known = fit.determined & (scatter > 0)
    moved = np.abs(before.value - fit.value) / np.where(known, scatter, np.inf)
    logs = np.unique(information.log)
    weight = weights.min(0)[out]
    stop = np.concatenate([np.cumsum(information.counts[information.log == k]) for k in logs])
    at = information.log[out], (stop - information.counts)[out], stop[out]
    share = float(_residual_shares(information, fit)[:, out].max())
    return weighed, Outliers(*at, beyond.T[out], weight, moved, share)


def _residual_shares(information: Information, fit: Estimate) -> Array:
    """Return each block's residual over the actuator's torque, root mean squares, (n, B)."""
    squares = information.squares_of_blocks(np.append(-fit.value, 1.0)).T
    mean = squares / np.maximum(information.data.T, 1)
    torque = np.maximum(information.torque / information.rows_each, np.finfo(float).tiny)
    return np.sqrt(mean / torque[:, None])


def _measure(information: Information, fit: Estimate) -> tuple[Array, Array]:
    """Return each block's mean square over the usual one of its log, and its limit, (n, B)."""
    squares = information.squares_of_blocks(np.append(-fit.value, 1.0)).T
    rows = information.data.T
    freedom = np.maximum(rows / fit.times[:, None], 1.0)
    beyond = np.zeros(squares.shape)
    floor = ROUNDOFF**2 * information.torque / information.rows_each  # rounding is no noise
    for log in np.unique(information.log):
        own = information.log == log
        mean = squares[:, own] / np.maximum(rows[:, own], 1)
        for a, (x, f, some) in enumerate(zip(mean, freedom[:, own], rows[:, own] > 0, strict=True)):
            if some.any():  # a mean square of noise has this median
                usual = np.median(x[some] * f[some] / chdtri(f[some], 0.5))
                beyond[a, own] = x / max(usual, floor[a], 1e-300)
    chance = chdtri(freedom, 0.5 / squares.size)
    return beyond, chance / freedom
