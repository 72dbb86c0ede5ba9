"""Standard deviations that allow for what residuals remember: by resampling and by scores."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.bootstrap import FEWEST_BLOCKS, Bootstrap, bootstrap
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.motions import Motions, compare_motions
from identifiability.estimation.noise.autocorrelation import block_length
from identifiability.estimation.scores import MEMORIES, ScoreScatter, longer, scatter_scores
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.linalg import sandwich
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Blocks may be so many autocorrelation times short where longer ones would be too few.
LEAST_MEMORIES = 2.0


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
    """

    white: Array
    bootstrap: Bootstrap | None
    scores: ScoreScatter | None
    times: Array
    block: float
    note: str = ""
    motions: Motions | None = None

    @property
    def robust(self) -> Array:
        """The larger of the estimates that allow for autocorrelation, and what logs add, (k,).

        Infinite where neither resampling nor scores could be asked: a formula is believed only as
        far as its model of the noise, and few samples do not show that. Beside both others it only
        made intervals a quarter too wide.
        """
        roads = [] if self.bootstrap is None else [self.bootstrap.sd]
        roads += [] if self.scores is None else [self.scores.widened]
        largest = np.max(roads, axis=0) if roads else np.inf
        largest = np.where(np.isfinite(self.white), largest, np.inf)
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
    length = max(block_length(residual[series == k]) for k in np.unique(series))
    return resample(information, fit, length, rng, replicates)


def resample(
    information: Information,
    fit: Estimate,
    length: float,
    rng: np.random.Generator,
    replicates: int,
) -> Uncertainty:
    """Return the standard deviations of a fit for which a block length is known.

    Parameters
    ----------
    information, fit, rng, replicates
        As in `assess_uncertainty`.
    length : float [samples]
        Block length of the bootstrap, unless that leaves few blocks and the residual forgets
        sooner.
    """
    # The automatic choice is itself uncertain where it leaves few blocks: then what the residual
    # remembers is enough.
    memory, short = float(fit.times.max()), information.samples / (2 * FEWEST_BLOCKS)
    length = min(length, max(MEMORIES * memory, short))
    # Blocks of two memories still tell by how much longer ones would scatter more.
    shortened = information.samples < FEWEST_BLOCKS * length
    length = max(LEAST_MEMORIES * memory, short) if shortened else length
    drawn, note = None, ""
    if not replicates:
        note = "No logs were resampled: ask for some replicates."
    elif fit.kept:
        try:
            drawn = bootstrap(information, fit, rng, replicates=replicates, length=length)
            if shortened:
                drawn = drawn.stretch(fit.value, np.sqrt(longer(drawn.sd**2, fit, length)))
        except IdentifiabilityError as error:
            note = str(error)
    scores = scatter_scores(information, fit, fit.memory)
    motions = compare_motions(information, fit, fit.memory)
    return Uncertainty(fit.sigma, drawn, scores, fit.times, length, note, motions)


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
    known = sigma <= 0.01 * rules.sigma_percent * np.abs(values)
    share: Array = (known & (np.sign(values) == np.sign(fit.value))).mean(0)
    return share
