"""`Estimate`, and the `Estimator` that made it and is asked whatever follows from it.

Resampling, scores, folds and the physical set know no method of estimation: an estimate carries
its estimator, so that its spread is the spread of what made it. A new one is a class and
its place in `least_squares.BY_NAME`, or a call of `register_estimator` in a plugin.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np

from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information


@runtime_checkable
class Estimator(Protocol):
    """A way from information to values, and what it says of blocks of time."""

    @property
    def name(self) -> str:
        """Word by which `analyze`, `prune` and the command line know it."""

    @property
    def description(self) -> str:
        """What it is, in the words of a report: "fitted by ..."."""

    def fit(self, information: Information) -> Estimate:
        """Return the estimate, which carries this estimator."""

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the values when block b counts ``counts[r, b]`` times, (replicates, k).

        Columns that `fit` dropped stay zero; a replicate that determines no values is NaN.
        `counts` is (replicates, B), of resampling or of leaving out folds.
        """

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return by how much each block moves the values, (B, k) [unit of each parameter].

        The squares, summed over independent blocks, are the variance of the values: leverage is
        allowed for. Columns that `fit` dropped are zero.
        """

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return upper triangular F, (k + 1, k + 1) [torque]: ``|F (x, -1)|²`` is least at the fit.

        The distance in which the nearest real robot is nearest, and the likelihood of posteriors.
        """

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return what the fit finds of torque without noise, for each of b parameters, (k, b).

        Parameters
        ----------
        information : Information
            About all b parameters.
        fit : Estimate
            Of k combinations of them.
        M : (b, k)
            These combinations, of the columns that the fit kept.
        """


@frozen
class Correction:
    """What an estimate mends of least squares, which noise biases, and where it does not.

    Attributes
    ----------
    least_squares : (k,)
        Values of least squares.
    bias : (weak, k)
        What the root mean square of the bias moves that least squares may have in each direction
        that stays with it, because noise drowns the motion there.
    """

    least_squares: Array
    bias: Array


@frozen
class Estimate:
    """Parameter values with their covariance under white noise.

    Attributes
    ----------
    columns : tuple of str
    value : (k,)
        Columns that depend on others are held at zero.
    covariance : (k, k)
        Under independent residuals; infinite variance where not determined.
    determined : (k,) bool
        False for parameters that this motion determines in combination with others only, or
        not at all.
    kept : tuple of int
        Independent columns, the ones that were fitted.
    variance : (n,)
        Noise variance of each actuator, with what the columns swallow of it [torque²].
    rss : (n,)
        Residual sum of squares of each actuator.
    dof : int
        Rows less determined columns.
    condition : float
        Condition number of the column-scaled matrix of determined columns.
    singular_values : (k,)
        Of the column-scaled matrix, relative to the largest.
    weights : (n,)
        Weight of each actuator.
    times : (n,)
        Integrated autocorrelation time of each actuator's noise [samples].
    estimator : Estimator
        What made it.
    correction : Correction or None
        What instruments changed; None for least squares.
    """

    columns: tuple[str, ...]
    value: Array
    covariance: Array
    determined: np.ndarray
    kept: tuple[int, ...]
    variance: Array
    rss: Array
    dof: int
    condition: float
    singular_values: Array
    weights: Array
    times: Array
    estimator: Estimator
    correction: Correction | None = None

    @property
    def memory(self) -> float:
        """Autocorrelation time of the actuators that carry the residual [samples]."""
        share = self.weights * self.variance
        total = share.sum()
        return float((share * self.times).sum() / total if total > 0 else self.times.mean())

    @property
    def sigma(self) -> Array:
        """Standard deviations, (k,)."""
        spread: Array = np.sqrt(np.diag(self.covariance))
        return spread

    @property
    def sigma_percent(self) -> Array:
        """Relative standard deviations σ%, ``100 σ/|φ|``, (k,) [%]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            percent = 100 * self.sigma / np.abs(self.value)
        return np.where(self.determined & np.isfinite(percent), percent, np.inf)

    @property
    def paper_rule(self) -> np.ndarray:
        """The 10× rule: σ% below ten times the smallest of the model, (k,) bool."""
        percent = self.sigma_percent
        least = percent.min(initial=np.inf)
        passed: np.ndarray = percent < RULES.paper_factor * least
        return passed if np.isfinite(least) else np.zeros(len(percent), bool)


def correct(
    plain: Estimate,
    estimator: Estimator,
    value: Array,
    covariance: Array,
    rss: Array,
    bias: Array,
) -> Estimate:
    """Return an estimate by least squares with other values of its k kept columns.

    Parameters
    ----------
    plain : Estimate
    estimator : Estimator
        What made them.
    value : (k,)
    covariance : (k, k)
        Without the bias that stays.
    rss : (n,)
        What they leave.
    bias : (k, weak)
        What the root mean square of the bias that stays moves, a direction a column.
    """
    kept, values, spread = list(plain.kept), plain.value.copy(), plain.covariance.copy()
    values[kept], spread[np.ix_(kept, kept)] = value, covariance + bias @ bias.T
    both = np.logical_and.outer(plain.determined, plain.determined)
    samples = (plain.dof + len(kept)) / len(plain.rss)
    wide = np.zeros((bias.shape[1], len(plain.value)))
    wide[:, kept] = bias.T
    return replace(
        plain,
        value=values,
        covariance=np.where(both, spread, plain.covariance),
        rss=rss,
        variance=plain.variance + np.maximum(rss - plain.rss, 0.0) / samples,
        estimator=estimator,
        correction=Correction(plain.value, wide),
    )


def settle_signs(information: Information, fit: Estimate, nonnegative: np.ndarray) -> Array:
    """Return the values (k,) with those at zero that only rounding took below it.

    Parameters
    ----------
    information : Information
        About the columns that were fitted.
    fit : Estimate
    nonnegative : (k,) bool
        Parameters that physics does not allow below zero.
    """
    root = information.factor()
    reach = ROUNDOFF * np.linalg.norm(root[:, -1])
    rounded = nonnegative & (fit.value < 0)
    rounded &= -fit.value * np.linalg.norm(root[:, :-1], axis=0) <= reach
    return np.where(rounded, 0.0, fit.value)
