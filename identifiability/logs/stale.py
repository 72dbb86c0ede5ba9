"""Rows that hold the command of the row before, where rows and commands share a clock.

A command that arrives at the time of a row appears in this row or in the next one, by chance. Then
some rows repeat a command, and no row holds the command after it. Commands that move smoothly show
which rows these are.
"""

from collections.abc import Sequence
from itertools import pairwise
from operator import itemgetter

import numpy as np
import scipy

from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array


def restore_values(values: Array) -> tuple[Array, int]:
    """Return values (N, n) in the rows at whose times they arrive, and the number of stale rows.

    Values that no row holds are interpolated. No row is stale unless values are then a tenth
    smoother than over the rows, or over a clock that is slower than rows.
    """
    sizes = or_one(values.std(axis=0))
    x = values / sizes
    row = np.arange(1, len(x) + 1)
    repeats = np.append(False, ~np.any(np.diff(x, axis=0), axis=1))
    # Commands that stand are no stale rows.
    repeats &= ~(np.roll(repeats, 1) | np.roll(repeats, -1))
    apart = np.diff(np.flatnonzero(~repeats))
    if not np.isin((1, 2), apart).all():
        return values, 0
    weights = np.geomspace(10, 0.01, 10)
    before = np.append(row[:-1] - 1, len(x))
    starts = ([row], [before], [row, before])
    # Fast motion needs a search that begins less smooth.
    ends = [_find_stale(x, repeats, start, weights[k:]) for start in starts for k in (0, 3)]
    roughness, is_stale, smooth = min(ends, key=itemgetter(0))
    # Values at random are smoother by some percent, as rows are chosen so.
    if roughness > 0.9 * _usual_roughness(x, repeats, apart.mean(), weights[-1]):
        return values, 0
    restored = smooth * sizes
    restored[row - is_stale] = values
    return restored[1:], int(is_stale.sum())


def _usual_roughness(x: Array, repeats: np.ndarray, period: float, weight: float) -> float:
    """Return the roughness of values over the rows, or over a clock of slower period [rows]."""
    rows = np.arange(1, len(x) + 1)
    slower = _smooth(x, np.cumsum(~repeats), weight / period**5)[1] / period**2
    return min(slower, _smooth(x, rows, weight)[1])


def _find_stale(
    x: Array, repeats: np.ndarray, start: Sequence[np.ndarray], weights: Array
) -> tuple[float, np.ndarray, Array]:
    """Return the roughness of values, the stale rows (N,) bool, and smooth values (N + 1, n).

    Parameters
    ----------
    x : (N, n)
    repeats : (N,) bool
    start : sequence of (N,) int
        Numbers at which each value counts at first.
    weights : (k,)
        Of third differences, in turn.
    """
    row = np.arange(1, len(x) + 1)
    smooth, _ = _smooth(np.tile(x, (len(start), 1)), np.concatenate(start), weights[0])
    for weight in weights:
        evidence = (x - smooth[1:]) ** 2 - (x - smooth[:-1]) ** 2
        is_stale = _divide(evidence.sum(1), repeats)
        smooth, roughness = _smooth(x, row - is_stale, weight)
    return roughness, is_stale, smooth


def _divide(evidence: Array, repeats: np.ndarray) -> np.ndarray:
    """Return the likeliest stale rows, (N,) bool, by evidence (N,).

    A repeat, (N,) bool, is stale. The row before it and the last row are not. Between repeats the
    first rows are.
    """
    is_before = np.append(repeats[1:], True)
    is_last = np.arange(len(repeats)) == len(repeats) - 1
    certain = np.abs(evidence).sum()
    sure = certain * (1.0 * repeats - is_before - is_last)
    is_stale = np.zeros(len(evidence), bool)
    edges = np.unique([0, *np.flatnonzero(repeats), len(evidence)]).tolist()
    for start, stop in pairwise(edges):
        sums = np.cumsum((sure + evidence)[start:stop])
        first = np.argmax(np.append(0.0, sums))
        is_stale[start : start + first] = True
    return is_stale


def _smooth(x: Array, number: np.ndarray, weight: float) -> tuple[Array, float]:
    """Return smooth values (m, n) by number, and the sum of their third differences.

    Parameters
    ----------
    x : (N, n)
    number : (N,) int
        Of each value.
    weight : float
        Of third differences.
    """
    count = number.max() + 1
    shape = (count - 3, count)
    third = scipy.sparse.diags_array([-1.0, 3.0, -3.0, 1.0], offsets=range(4), shape=shape)
    ones = np.ones(len(x))
    places = (np.arange(len(x)), number)
    of_values = scipy.sparse.csr_array((ones, places), shape=(len(x), count))
    precision = of_values.T @ of_values + weight * third.T @ third
    found = scipy.sparse.linalg.spsolve(precision.tocsc(), of_values.T @ x)
    smooth = found.reshape(count, -1)
    differences = np.linalg.norm(third @ smooth, axis=1)
    return smooth, float(differences.sum())
