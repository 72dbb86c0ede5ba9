"""`Spread`: how far torque that a fitted model predicts may lie from the truth and from a sample.

Two intervals. That of the *mean* holds the torque of the model with its true values: what the
parameters do not know. That of a *new sample* adds what a measured torque scatters about it, which
no longer log makes smaller. Residuals remember: with an autocorrelation time κ, N samples count as
N/κ for both, so that the fit swallows κ times more of the noise than of white noise.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.least_squares import dependence
from identifiability.estimation.uncertainty import Uncertainty, remembering_covariance
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS, REACH
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: A direction that the fitted motion never showed acts if it makes this share of what its columns
#: made there; and the share of the largest column that a column which never acted counts for.
ACTS, NEVER = 1e-5, 1e-3


@frozen(kw_only=True)
class Spread:
    """What is not known of predicted torque.

    Attributes
    ----------
    covariance : (k, k)
        Of the values, with what the noise remembers; zero for columns that were not fitted.
    unknown : (k, d)
        Directions of which the fitted motion says nothing, as long as their columns were large.
    low, raw : (n,) [N·m or N]
        Standard deviation of low-passed and of measured torque about the prediction.
    dof : (n,)
        Independent samples that these were estimated from.
    """

    covariance: Array
    unknown: Array
    low: Array
    raw: Array
    dof: Array

    def reach(self, W: Array) -> tuple[Array, Array, Array]:
        """Return half widths of 95 % intervals of the mean, a low-passed and a raw sample, (N, n).

        Infinite where the motion acts on what the fitted motion never showed.

        Parameters
        ----------
        W : (N, n, k)
        """
        variance = np.maximum(np.einsum("anj,jk,ank->an", W, self.covariance, W), 0.0)
        variance[self.finds_new(W)] = np.inf
        few = stdtrit(self.dof, ENDS[1])
        low, raw = (few * np.sqrt(variance + sd**2) for sd in (self.low, self.raw))
        return REACH * np.sqrt(variance), low, raw

    def finds_new(self, W: Array) -> np.ndarray:
        """Return where the motion acts on what the fitted motion never showed, (N, n) bool."""
        found: np.ndarray = (np.abs(W @ self.unknown) > ACTS).any(2)
        return found


def measure_spread(
    information: Information,
    fit: Estimate,
    uncertainty: Uncertainty,
    rms: tuple[Array, Array],
    unseen: tuple[Array, Array],
) -> Spread:
    """Return what is not known of the torque that a fit predicts.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    uncertainty : Uncertainty
        Of its values.
    rms, unseen : ((n,), (n,)) [N·m or N]
        Root mean square of the error of low-passed and of raw torque on the fitted and on unseen
        motion; the latter NaN where there is none. The larger one counts: what the model misses is
        seen on unseen motion only.
    """
    n, kept = information.actuators, list(fit.kept)
    independent = information.rows_each / fit.times
    dof = np.maximum(independent - len(kept) / n, 1.0)
    swallowed = np.sqrt(independent / dof)
    low, raw = (np.fmax(own * swallowed, other) for own, other in zip(rms, unseen, strict=True))
    covariance, unknown = measure_errors(information, fit, widening(information, fit, uncertainty))
    return Spread(covariance=covariance, unknown=unknown, low=low, raw=raw, dof=dof)


def measure_errors(
    information: Information, fit: Estimate, wider: float = 1.0
) -> tuple[Array, Array]:
    """Return the covariance (k, k) of the values of a fit, and what it never saw, (k, d).

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    wider : float
        Factor of variance, such as that of `widening`.
    """
    kept = list(fit.kept)
    covariance = np.zeros((information.size, information.size))
    if kept:
        covariance[np.ix_(kept, kept)] = wider * remembering_covariance(information, fit)
    return covariance, _never_shown(information, fit)


def widening(information: Information, fit: Estimate, uncertainty: Uncertainty) -> float:
    """Return by how much variances are larger than by formula, as resampling and scores say.

    One factor for all of them keeps how they depend on each other: what few parameters do not know
    of each other, torque may know well.
    """
    kept = list(fit.kept)
    variance, wide = fit.sigma[kept] ** 2, uncertainty.robust[kept] ** 2
    if kept:
        variance = np.diag(remembering_covariance(information, fit))
    known = np.isfinite(wide) & (variance > 0)
    return max(float(np.mean(wide[known] / variance[known])) if known.any() else 1.0, 1.0)


def _never_shown(information: Information, fit: Estimate) -> Array:
    """Return the directions that change no torque along the fitted motion, (k, dropped)."""
    kept = list(fit.kept)
    dropped = [c for c in range(information.size) if c not in set(kept)]
    directions = np.zeros((information.size, len(dropped)))
    directions[dropped, range(len(dropped))] = 1.0
    if kept and dropped:
        length = np.linalg.norm(information.factor(fit.weights)[:, : information.size], axis=0)
        leans = dependence(information, kept, fit.weights)
        directions[kept] = -leans * length[dropped] / length[kept][:, None]
    size = np.linalg.norm(information.factor()[:, :-1], axis=0) / np.sqrt(information.samples)
    least = NEVER * size.max(initial=0.0)
    scaled: Array = directions / np.maximum(size @ np.abs(directions), least or 1.0)
    return scaled
