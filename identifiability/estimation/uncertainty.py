"""Standard deviations that allow for what residuals remember: by formula, resampling, scores."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.bootstrap import FEWEST_BLOCKS, Bootstrap, bootstrap
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.motions import Motions, compare_motions
from identifiability.estimation.noise.autocorrelation import autocorrelation_time, block_length
from identifiability.estimation.noise.residual_noise import ROUNDING
from identifiability.estimation.scores import MEMORIES, ScoreScatter, scatter_scores
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information


@frozen
class Uncertainty:
    """Standard deviations of one model's parameters by every road.

    Attributes
    ----------
    white : (k,)
        Under independent residuals.
    inflated : (k,)
        The same times the root of the residual's autocorrelation time.
    bootstrap : Bootstrap or None
        Refits on resampled blocks; None if there are too few blocks.
    scores : ScoreScatter or None
        Scatter of each column's scores over stretches of time; None if there are too few.
    times : (n,)
        Autocorrelation time of each actuator's residual [samples].
    block : float
        Block length of the bootstrap [samples].
    independent : float
        Outputs of all actuators that count as independent: samples over `times`, summed.
    note : str
        Why something is missing, if it is.
    motions : Motions or None
        What logs by themselves say of each other; None of one log, or of too short ones.
    """

    white: Array
    inflated: Array
    bootstrap: Bootstrap | None
    scores: ScoreScatter | None
    times: Array
    block: float
    independent: float
    note: str = ""
    motions: Motions | None = None

    @property
    def robust(self) -> Array:
        """The largest of the estimates that allow for autocorrelation, and what logs add, (k,).

        Infinite where neither resampling nor scores could be asked: a formula alone is believed
        only as far as its model of the noise, and few samples do not show that.
        """
        if self.bootstrap is None and self.scores is None:
            return np.full(len(self.white), np.inf)
        largest = self.inflated
        if self.bootstrap is not None:
            largest = np.maximum(largest, self.bootstrap.sd)
        if self.scores is not None:
            largest = np.maximum(largest, self.scores.widened)
        return largest if self.motions is None else np.hypot(largest, self.motions.between)

    def why_unjudged(self, parameters: int, rules: Thresholds) -> str:
        """Return why nothing can be said of a model's parameters, or nothing if it can.

        Parameters
        ----------
        parameters : int
            That the fit determined.
        rules : Thresholds
        """
        least = rules.outputs_per_parameter
        if self.independent < least * parameters:
            return (
                f"The logs have only {self.independent:.0f} independent outputs for {parameters} "
                f"parameters, fewer than {least:g} for each: give a longer log or a higher cut-off."
            )
        if parameters and (self.bootstrap is None or self.scores is None):
            return self.note or "Too few blocks of time to say how they scatter: give longer logs."
        return ""


def assess_uncertainty(
    information: Information,
    fit: Estimate,
    residual: Array,
    series: np.ndarray,
    rng: np.random.Generator,
    replicates: int,
) -> Uncertainty:
    """Return the standard deviations of a fit by every road.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    residual : (N, n)
    series : (N,) int
        Which stretch of consecutive samples a residual comes from.
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap; 0 for none.
    """
    times, length = residual_times(residual, series)
    torque = information.squares(information.basis[:, -1])
    rounded = fit.rss <= (ROUNDING * np.sqrt(torque)) ** 2
    times = np.where(rounded, 1.0, times)  # what rounding left has no memory to speak of
    return resample(information, fit, times, length, rng, replicates)


def resample(
    information: Information,
    fit: Estimate,
    times: Array,
    length: float,
    rng: np.random.Generator,
    replicates: int,
) -> Uncertainty:
    """Return the standard deviations of a fit whose residual's memory is known.

    Parameters
    ----------
    information, fit, rng, replicates
        As in `assess_uncertainty`.
    times : (n,) [samples]
        Autocorrelation time of each actuator's residual.
    length : float [samples]
        Block length of the bootstrap, unless that leaves few blocks and the residual forgets
        sooner.
    """
    # The automatic choice is itself uncertain where it leaves few blocks: then what the residual
    # remembers is enough.
    most = max(MEMORIES * float(times.max()), information.samples / (2 * FEWEST_BLOCKS))
    length = min(length, most)
    time = _mean_time(times, fit)
    inflated = fit.sigma * float(np.sqrt(time))
    drawn, note = None, ""
    if not replicates:
        note = "No logs were resampled: ask for some replicates."
    elif fit.kept:
        try:
            drawn = bootstrap(information, fit, rng, replicates=replicates, length=length)
        except IdentifiabilityError as error:
            note = str(error)
    scores = scatter_scores(information, fit, time)
    independent = float(np.sum(information.samples / times))
    motions = compare_motions(information, fit, time)
    return Uncertainty(
        fit.sigma, inflated, drawn, scores, times, length, independent, note, motions
    )


def residual_times(residual: Array, series: np.ndarray) -> tuple[Array, float]:
    """Return autocorrelation times (n,), averaged over series, and the longest block length."""
    total, length = np.zeros(residual.shape[1]), 1.0
    for k in np.unique(series):
        part = residual[series == k]
        total += len(part) * autocorrelation_time(part)
        length = max(length, block_length(part))
    return total / len(residual), length


def _mean_time(times: Array, fit: Estimate) -> float:
    """Return one autocorrelation time: that of the actuators that carry the residual."""
    share = fit.weights * fit.rss
    total = share.sum()
    return float((share * times).sum() / total) if total > 0 else float(times.mean())


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
    known = sigma <= 0.01 * rules.sigma_percent * np.abs(values)
    share: Array = (known & (np.sign(values) == np.sign(fit.value))).mean(0)
    return share
