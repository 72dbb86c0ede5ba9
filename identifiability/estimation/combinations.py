"""Combinations of few parameters that logs determine, where they determine no single one."""

from typing import NamedTuple

import numpy as np

from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array

from .rules import Thresholds


class Combination(NamedTuple):
    """A weighted sum of parameters, in the unit of the first one.

    Attributes
    ----------
    members : tuple of int
    weights : tuple of float
        The first one is 1.
    value, sigma : float
    """

    members: tuple[int, ...]
    weights: tuple[float, ...]
    value: float
    sigma: float


def find_combinations(
    values: Array, covariance: Array, unknown: Array, terms: int
) -> list[Combination]:
    """Return determined combinations of different parameters, the surest first.

    Each begins with one parameter. The parameter that lowers the variance most is added, until
    the sum is as sure as an identifiable parameter has to be.

    Parameters
    ----------
    values : (b,)
    covariance : (b, b)
    unknown : (b, d)
        Directions that the logs do not determine.
    terms : int
        Most parameters of a combination.
    """
    variances, axes = np.linalg.eigh(covariance)
    spread = axes * np.sqrt(np.maximum(variances, 0.0))
    # A step along an unknown direction is far longer than any standard error.
    largest_value = np.abs(values).max(initial=0.0)
    largest_spread = np.abs(spread).max(initial=0.0)
    far = (largest_value + largest_spread) / NEARLY
    rows = np.vstack([spread.T, far * unknown.T])
    found = [_combine(values, rows, k, terms) for k in range(len(values))]
    sure = sorted(filter(None, found), key=lambda one: one.sigma / abs(one.value))
    listed = list[Combination]()
    seen = set[int]()
    for one in sure:
        if not seen & {*one.members}:
            listed.append(one)
            seen |= {*one.members}
    return listed


def _combine(values: Array, rows: Array, first: int, terms: int) -> Combination | None:
    """Return the shortest determined combination that begins with a parameter, if there is one.

    The variance of a weighted sum is the squared length of the sum of the columns of `rows`.
    """
    limit = Thresholds().sigma_percent / 100
    others = list[int]()
    while len(others) + 1 < terms:
        basis, _ = np.linalg.qr(rows[:, others])
        rest = rows - basis @ (basis.T @ rows)
        length = np.linalg.norm(rest, axis=0)
        known = length > NEARLY * np.linalg.norm(rows, axis=0)
        known[first] = False
        if not known.any():
            return None
        lowered = np.abs(rest[:, first] @ rest) / np.where(known, length, np.inf)
        others.append(int(np.argmax(lowered)))
        weights = -np.linalg.lstsq(rows[:, others], rows[:, first], rcond=None)[0]
        members = [first, *others]
        each = np.append(1.0, weights)
        value = each @ values[members]
        sigma = np.linalg.norm(rows[:, members] @ each)
        size = abs(value)  # of dropped parameters alone it is zero, and tells nothing
        if size > 0 and sigma <= limit * size:
            return Combination(tuple(members), tuple(each.tolist()), float(value), float(sigma))
    return None
