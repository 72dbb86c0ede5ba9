"""`Estimate`: least squares on `Information`, ordinary or weighted per actuator, with σ.

What to use when: ``ols`` reproduces the literature (one variance for all actuators); ``wls``
weights each actuator by its own residual variance and is the better estimate whenever joints
differ in size.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.linalg import RANK_TOLERANCE, scan_columns
from identifiability.foundation.names import Array
from identifiability.foundation.options import checked
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

Method = Literal["ols", "wls"]

#: Factor of the paper's rule: σ% below 10 × the smallest σ% [Khalil 2002, Díaz 2010].
PAPER_FACTOR = 10.0

#: Share of a unit column in a dependent one from which on the two are not told apart.
MIXED = 1e-6

#: A residual below this share of the torque is rounding, which must weigh no actuator.
ROUNDING = 1e-12

#: A value that makes less than this share of the torque is zero up to rounding.
NOTHING = 1e-9


@frozen
class Estimate:
    """Parameter values with their covariance under white noise.

    Attributes
    ----------
    columns : tuple of str
    value : (k,)
        Least squares with the columns that depend on others held at zero.
    covariance : (k, k)
        Under independent residuals; infinite variance where not determined.
    determined : (k,) bool
        False for parameters that this motion determines in combination with others only, or
        not at all.
    kept : tuple of int
        Independent columns, the ones that were fitted.
    variance : (n,)
        Residual variance of each actuator [torque²].
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
        passed: np.ndarray = percent < PAPER_FACTOR * least
        return passed if np.isfinite(least) else np.zeros(len(percent), bool)


@checked
def estimate(information: Information, method: Method = "wls") -> Estimate:
    """Return the least-squares estimate.

    Parameters
    ----------
    information : Information
    method : {"wls", "ols"}
        Weight actuators by their own residual variance, or all alike.
    """
    n = information.actuators
    ones = np.ones(n)
    plain = _solve(information, ones)
    if method == "ols":
        return plain
    floor = 1e-12 * float(np.max(plain.variance, initial=0.0))
    floor = max(floor, ROUNDING**2 * _mean_square(information))
    if floor == 0.0:
        return plain
    variance = np.maximum(plain.variance, floor)
    return _solve(information, float(np.mean(variance)) / variance)


def _mean_square(information: Information) -> float:
    """Return the mean square of the torque over all rows."""
    root = information.factor()[:, -1]
    return float(root @ root) / max(information.rows, 1)


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
    reach = NOTHING * np.linalg.norm(root[:, -1])
    rounded = nonnegative & (fit.value < 0)
    rounded &= -fit.value * np.linalg.norm(root[:, :-1], axis=0) <= reach
    return np.where(rounded, 0.0, fit.value)


def leave_open(information: Information) -> Estimate:
    """Return the estimate from logs that have nothing to explain: it determines no parameter."""
    plain = _solve(information.select([]), np.ones(information.actuators))
    return _embed(plain, information, [], np.empty(0))


def _solve(information: Information, weights: Array) -> Estimate:
    k, n = information.size, information.actuators
    G = information.total(weights)
    S = information.basis
    kept, singular = _determined(information, weights)
    if len(kept) < k:
        return _embed(_solve(information.select(kept), weights), information, kept, singular)
    # Unknowns in the basis are y = S11 x - s12; the large part of τ that the basis already
    # explains never enters a difference of squares.
    g11, g12 = G[:k, :k], G[:k, k]
    s22 = S[k, k]
    if k:
        y = np.linalg.solve(g11, g12) * s22
        x = solve_triangular(S[:k, :k], S[:k, k] + y)
    else:
        y, x = np.empty(0), np.empty(0)
    z = np.append(-y, s22)  # τ - W x = Z z
    rss = np.maximum(np.einsum("i,aij,j->a", z, information.per_actuator, z), 0.0)
    dof = information.rows - k
    # Each actuator pays for its share of the parameters in proportion to its rows.
    variance = rss / max(information.samples - k / n, 1.0)
    sigma2 = float(weights @ rss) / max(dof, 1)
    inverse = solve_triangular(S[:k, :k], np.eye(k)) if k else np.empty((0, 0))
    covariance = sigma2 * inverse @ np.linalg.solve(g11, inverse.T) if k else np.empty((0, 0))
    low = float(singular[-1]) if len(singular) else 1.0
    return Estimate(
        information.columns, x, 0.5 * (covariance + covariance.T), np.ones(k, bool),
        tuple(range(k)), variance, rss,
        dof, 1.0 / low if low > 0 else np.inf, singular, weights,
    )  # fmt: skip


def _determined(information: Information, weights: Array) -> tuple[list[int], Array]:
    """Return the columns that this motion tells apart, and the scaled singular values."""
    k = information.size
    R = information.factor(weights)[:, :k]
    length = np.linalg.norm(R, axis=0)
    longest = length.max(initial=0.0)
    used = [c for c in range(k) if length[c] > RANK_TOLERANCE * longest and length[c] > 0]
    if not used:
        return [], np.empty(0)
    scaled = R / np.where(length > 0, length, 1.0)
    s = np.linalg.svd(scaled[:, used], compute_uv=False)
    return scan_columns(scaled, used), s / s[0]


def _embed(part: Estimate, whole: Information, kept: list[int], singular: Array) -> Estimate:
    """Return the estimate of the independent columns among all columns."""
    k = whole.size
    value, determined = np.zeros(k), np.zeros(k, bool)
    covariance = np.diag(np.full(k, np.inf))
    value[kept] = part.value
    # A column that a dropped one leans on has a value only as long as that one is zero.
    alone = np.abs(dependence(whole, kept, part.weights)).max(1, initial=0.0) < MIXED
    determined[np.array(kept, int)[alone]] = True
    covariance[np.ix_(kept, kept)] = part.covariance
    mixed = np.flatnonzero(~determined)
    covariance[mixed, :] = 0.0
    covariance[:, mixed] = 0.0
    covariance[mixed, mixed] = np.inf
    return Estimate(
        whole.columns, value, covariance, determined, tuple(kept), part.variance, part.rss,
        part.dof, part.condition, singular, part.weights,
    )  # fmt: skip


def dependence(information: Information, kept: Sequence[int], weights: Array) -> Array:
    """Return how the dropped columns depend on the kept ones, (kept, dropped).

    Columns are scaled to unit length; a column that never acts depends on nothing.
    """
    k = information.size
    dropped = [c for c in range(k) if c not in set(kept)]
    R = information.factor(weights)[:, :k]
    length = np.linalg.norm(R, axis=0)
    acts = length > RANK_TOLERANCE * length.max(initial=0.0)
    unit = np.where(acts, R / np.where(acts, length, 1.0), 0.0)
    if not kept or not dropped:
        return np.zeros((len(kept), len(dropped)))
    solved: Array = np.linalg.lstsq(unit[:, list(kept)], unit[:, dropped], rcond=None)[0]
    return solved
