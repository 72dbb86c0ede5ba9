"""Standard deviations that allow for what residuals remember, and for what motions disagree on.

What scatters between motions enters every interval.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc, chdtri, fdtrc, stdtrit

from identifiability.estimation.bootstrap import Bootstrap, ScoreScatter, bootstrap, scatter_scores
from identifiability.estimation.estimate import forget_noise
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.linalg import ROUNDOFF, sandwich
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS, REACH, holm
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

# Do several motions give the same values? What scatters between them enters every interval.
#
# What a model leaves out is no noise while one motion lasts: it moves the values by as much in
# every block of a log, and by something else in the next log. So the values of each log by itself
# are compared by analysis of variance with unequal variances [Welch 1951], a parameter at a time
# [Holm 1979] and pooled over all of them. Where logs differ by more than each of them knows, the
# excess is a variance between motions [DerSimonian & Laird 1986]. Two or three logs say next to
# nothing about one parameter's, so it is pooled, in units of the sampling variance: model errors,
# like noise, move most what a motion shows least. Only a parameter that moves for sure has one of
# its own.


#: Blocks may be so many autocorrelation times short where longer ones would be too few.
LEAST_MEMORIES: Tolerance = 2.0

#: Stretches over which the scores of one motion scatter, at most: more say little and cost.
MOST_STRETCHES = 24


@frozen
class Motions:
    """Values of L motions, each by itself, and what they say together about k parameters.

    Attributes
    ----------
    which : (L,) int
        Number of each log (or stretch): those that are too short to be fitted are left out.
    values, sd : (L, k)
        Of each motion by itself, and their robust standard deviations; infinite where the motion
        does not determine a parameter.
    dof : (L,)
        Degrees of freedom of `sd`.
    errors : (L, n) [N·m or N]
        Root mean square of each joint's residual under the fit to all motions.
    p : (k,)
        Of each parameter's values being equal, adjusted for their number; 1 where fewer than two
        motions determine it.
    pooled : float
        p-value of all values being equal, by the sum over parameters.
    ratio : float
        Variance of the values over their sampling variance, pooled; 1 where the test finds none.
    ratio_dof : float
        Degrees of freedom of `ratio`: twice its mean squared over its variance.
    between : (k,)
        What the scatter adds to the standard deviations of the fit to all motions, in quadrature;
        a normal interval with it has the width of Student's t. Zero where motions agree.
    """

    which: np.ndarray
    values: Array
    sd: Array
    dof: Array
    errors: Array
    p: Array
    pooled: float
    ratio: float
    ratio_dof: float
    between: Array

    @property
    def moved(self) -> np.ndarray:
        """Parameters whose values differ for sure, (k,) bool."""
        moved: np.ndarray = self.p < Thresholds.sign_level
        return moved

    @property
    def agree(self) -> bool:
        """Whether neither test finds a difference."""
        return not (self.moved.any() or self.pooled < Thresholds.sign_level)

    def away(self, one: int) -> tuple[Array, Array]:
        """Return the weighted mean of all other motions' values, and how many σ one is off, (k,).

        Parameters
        ----------
        one : int
            Place in `which`.
        """
        others = np.arange(len(self.which)) != one
        weight = self.sd[others] ** -2.0
        total = weight.sum(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = (weight * self.values[others]).sum(0) / total
            z = (self.values[one] - mean) / np.sqrt(self.sd[one] ** 2 + 1.0 / total)
        return mean, np.nan_to_num(z)

    def odd(self) -> int:
        """Return the place of the motion that is farthest from the others where values move."""
        at = self.moved if self.moved.any() else np.ones(len(self.p), bool)
        return int(np.argmax([(self.away(one)[1][at] ** 2).sum() for one in range(len(self.sd))]))

    def without(self, one: int) -> float:
        """Return the smallest adjusted p-value of the motions without one."""
        rest = np.arange(len(self.which)) != one
        if rest.sum() < 2:
            return 1.0
        _, p, _ = _welch(self.values[rest], self.sd[rest], self.dof[rest])
        return float(holm(p).min())


def compare_motions(information: Information, fit: Estimate, time: float) -> Motions | None:
    """Return what logs say of each other; None where fewer than two can be fitted.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
        To all of them.
    time : float [samples]
        Autocorrelation time of the residual.
    """
    log = information.log
    if len(np.unique(log)) < 2:
        return None
    needed = len(fit.kept)
    torque = information.torque.sum()
    if fit.rss.sum() <= ROUNDOFF**2 * torque:  # rounding left these, and agrees with nothing
        return None
    found, own, sd, dof, errors = [], [], [], [], []
    for one in np.unique(log) if fit.kept else ():
        part = information.take(log == one)
        if part.rows <= len(fit.kept):  # it determines nothing, and rounding would say what
            continue
        alone = forget_noise(fit.estimator).fit(part)
        if (np.diag(alone.covariance)[alone.determined] < 0.0).any():  # rounding is all there is
            continue
        scores = scatter_scores(
            part, alone, max(time, part.samples / RULES.memories / MOST_STRETCHES)
        )
        if scores is None:
            continue
        # What a few stretches scatter by is uncertain itself: all parameters know more together.
        known = alone.determined & (alone.sigma > 0)
        memory = np.mean((scores.sd[known] / alone.sigma[known]) ** 2) if known.any() else 1.0
        if part.rows < needed * memory:
            continue
        wide = np.maximum(scores.sd, alone.sigma * np.sqrt(memory))
        found.append(int(one))
        own.append(alone)
        sd.append(np.where(fit.determined & (wide > 0), wide, np.inf))
        dof.append(scores.stretches - 1.0)
        errors.append(np.sqrt(part.squares(np.append(-fit.value, 1.0)) / part.weighed_samples))
    if len(found) < 2:
        return None
    values, spread = np.array([e.value for e in own]), np.array(sd)
    ratios, p, d = _welch(values, spread, np.array(dof))
    pooled, ratio, ratio_dof = _pool(p, d, _correlate(own, spread))
    motions = Motions(
        which=np.array(found),
        values=values,
        sd=spread,
        dof=np.array(dof),
        errors=np.array(errors),
        p=holm(p),
        pooled=pooled,
        ratio=ratio,
        ratio_dof=ratio_dof,
        between=np.zeros(information.size),
    )
    if motions.agree:
        return motions
    return replace(motions, between=np.sqrt(_excess(motions, ratios, fit.value)))


def _welch(values: Array, sd: Array, dof: Array) -> tuple[Array, Array, Array]:
    """Return Welch's F of each parameter, its p-value, and motions less one, (k,) each.

    Parameters
    ----------
    values, sd : (L, k)
    dof : (L,)
    """
    weight = sd**-2.0
    total = np.maximum(weight.sum(0), 1e-300)
    count = np.isfinite(sd).sum(0)
    d = np.maximum(count - 1, 0)
    at = np.maximum(d, 1)
    square = (weight * (values - (weight * values).sum(0) / total) ** 2).sum(0)
    lost = ((1 - weight / total) ** 2 * np.isfinite(sd) / dof[:, None]).sum(0)
    wide = np.maximum(count**2 - 1, 3)
    ratio = square / at / (1 + 2 * np.maximum(count - 2, 0) / wide * lost)
    p = np.where(d > 0, fdtrc(at, wide / (3 * np.maximum(lost, 1e-12)), ratio), 1.0)
    return ratio, p, d


def _correlate(own: Sequence[Estimate], sd: Array) -> Array:
    """Return how the values' differences between motions are correlated, (k, k)."""
    total = np.zeros((sd.shape[1], sd.shape[1]))
    for estimate, scale in zip(own, np.where(np.isfinite(sd), sd, 0.0), strict=True):
        sigma = np.where(np.isfinite(estimate.sigma) & (estimate.sigma > 0), estimate.sigma, np.inf)
        share = np.where(np.isfinite(estimate.covariance), estimate.covariance, 0.0)
        total += share * np.outer(scale / sigma, scale / sigma)
    length = np.sqrt(np.diag(total))
    length = np.where(length > 0, length, np.inf)
    found: Array = total / np.outer(length, length)
    return found


def _pool(p: Array, d: Array, correlation: Array) -> tuple[float, float, float]:
    """Return p-value, ratio and degrees of freedom of the sum over correlated parameters.

    Each parameter counts with the χ² that has its p-value; the sum is χ² of as many degrees of
    freedom as its mean and variance ask for [Satterthwaite 1946].

    Parameters
    ----------
    p, d : (k,)
        Not adjusted; motions less one.
    correlation : (k, k)
    """
    mean = float(d.sum())
    if not mean:
        return 1.0, 1.0, np.inf
    square = chdtri(np.maximum(d, 1), np.maximum(p, 1e-300)) * (d > 0)
    variance = 2 * float(np.sqrt(d) @ correlation**2 @ np.sqrt(d))
    dof = 2 * mean**2 / variance
    ratio = float(square.sum()) / mean
    pooled = float(chdtrc(dof, ratio * dof))
    return pooled, ratio if pooled < Thresholds.sign_level else 1.0, dof


def _excess(motions: Motions, ratios: Array, joint: Array) -> Array:
    """Return the variance between motions of each parameter, (k,).

    Parameters
    ----------
    motions : Motions
    ratios : (k,)
        Of variances, of each parameter by itself.
    joint : (k,)
        Values of the fit to all motions.
    """
    weight = motions.sd**-2.0
    total = np.maximum(weight.sum(0), 1e-300)
    count = np.isfinite(motions.sd).sum(0)
    wider = (stdtrit(motions.ratio_dof, ENDS[1]) / REACH) ** 2
    pooled = np.where(count > 1, count / total * (motions.ratio - 1), 0.0)
    unit = np.maximum(count - 1, 0) / np.maximum(total - (weight**2).sum(0) / total, 1e-300)
    own = np.where(motions.moved, unit * np.maximum(ratios - 1, 0.0), 0.0)
    # All motions together may lead to a value that none of them has by itself.
    away = np.abs(motions.values - joint)
    apart = np.where(away > REACH * motions.sd, away / REACH, 0.0).max(0) ** 2
    excess: Array = np.maximum(np.maximum(pooled, own) * wider, apart)
    return excess


# Standard deviations that allow for what residuals remember: by resampling and by scores.


@frozen
class Uncertainty:
    """Standard deviations of one model's parameters by every road.

    Attributes
    ----------
    white : (k,)
        Under independent residuals.
    bootstrap : Bootstrap or None
        Refits on resampled blocks; None if there are too few blocks.
    scores : ScoreScatter or None
        Scatter of each column's scores over stretches of time; None if there are too few.
    times : (n,)
        Autocorrelation time of each actuator's noise, that of the fit [samples].
    block : float
        Block length of the bootstrap [samples].
    note : str
        Why something is missing, if it is.
    motions : Motions or None
        What logs by themselves say of each other; None of one log, or of too short ones.
    late : (L, k) or None
        What one standard deviation of the delay of a log's commands moves, which all its samples
        share.
    bias : (w, k) or None
        What the bias that noise in the motion leaves may move, which resampling keeps.
    real : (1, k) or None
        How far the nearest real robot lies, where the estimate does not surely predict better: of
        two that are not told apart, labels hold over both.
    """

    white: Array
    bootstrap: Bootstrap | None
    scores: ScoreScatter | None
    times: Array
    block: float
    note: str = ""
    motions: Motions | None = None
    late: Array | None = None
    bias: Array | None = None
    real: Array | None = None

    @property
    def shared(self) -> Array:
        """What moves all samples alike, which none of them can show, (w, k)."""
        rows = [x for x in (self.late, self.bias, self.real) if x is not None]
        return np.vstack(rows) if rows else np.empty((0, len(self.white)))

    @property
    def robust(self) -> Array:
        """What noise, delays, logs, noise in the motion and physics leave open, (k,)."""
        together: Array = np.linalg.norm([self.scatter, *self.shared], axis=0)
        return together

    @property
    def scatter(self) -> Array:
        """What scores scatter by, which allows for autocorrelation, and what logs add, (k,).

        Infinite where scores could not be asked: a formula is believed only as far as its model of
        the noise, and few samples do not show that. Resampling is a check beside it.
        """
        wide = np.inf if self.scores is None else self.scores.widened
        largest = np.where(np.isfinite(self.white), wide, np.inf)
        return largest if self.motions is None else np.hypot(largest, self.motions.between)

    def why_unjudged(self, rules: Thresholds) -> tuple[str, ...]:
        """Return why nothing can be said of each parameter, or nothing where it can, (k,).

        Parameters
        ----------
        rules : Thresholds
        """
        if self.bootstrap is None or self.scores is None:
            why = self.note or "Too few blocks of time to say how values scatter: give longer logs."
            return (why,) * len(self.white)
        least = rules.outputs_per_parameter
        return tuple(
            ""
            if freedom >= least
            else (
                f"The logs have only {freedom:.1f} independent outputs that say how much its value "
                f"scatters, fewer than {least:g}: give longer or more logs, or a higher cut-off."
            )
            for freedom in self.scores.freedom
        )


def assess_uncertainty(
    information: Information, fit: Estimate, rng: np.random.Generator, replicates: int
) -> Uncertainty:
    """Return the standard deviations of a fit by every road.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap; 0 for none.
    """
    memory, short = float(fit.times.max()), information.samples / (2 * RULES.blocks_fewest)
    length = RULES.memories * memory
    if information.samples < RULES.blocks_fewest * length:
        length = max(LEAST_MEMORIES * memory, short)
    drawn, note = None, ""
    if not replicates:
        note = "No logs were resampled: ask for some replicates."
    elif fit.kept:
        try:
            drawn = bootstrap(information, fit, rng, replicates=replicates, length=length)
        except IdentifiabilityError as error:
            note = str(error)
    scores = scatter_scores(information, fit, fit.memory)
    motions = compare_motions(information, fit, fit.memory)
    mended = fit.correction
    bias = None if mended is None or not len(mended.bias) else mended.bias
    roads = drawn, scores, fit.times, length, note
    return Uncertainty(fit.sigma, *roads, motions, bias=bias)


def remembering_covariance(information: Information, fit: Estimate) -> Array:
    """Return the covariance of the kept columns under noise that remembers, (kept, kept).

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    k = len(fit.kept)
    part = information.select(fit.kept)
    noise = fit.weights**2 * fit.variance * fit.times
    return sandwich(part.factor(fit.weights)[:k, :k], part.factor(noise)[:, :k])


def recurrence(
    fit: Estimate, uncertainty: Uncertainty, rules: Thresholds, omitted: Array | float = 0.0
) -> Array:
    """Return the share of replicates in which a parameter would be called well known, (k,).

    Parameters
    ----------
    fit : Estimate
    uncertainty : Uncertainty
    rules : Thresholds
    omitted : (k,)
        How far values may lie from their labels by what the model leaves out.
    """
    if uncertainty.bootstrap is None:
        return np.full(len(fit.columns), np.nan)
    values = uncertainty.bootstrap.values
    sigma = np.hypot(uncertainty.robust, omitted)
    known = sigma <= rules.sigma_share * np.abs(values)
    share: Array = (known & (np.sign(values) == np.sign(fit.value))).mean(0)
    return share
