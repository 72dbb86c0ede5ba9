"""White noise, gaps and steps of measured signals, told from differences between their samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import binom

from identifiability.foundation.names import Array
from identifiability.logs import signals

#: Order of the differences that leave noise alone.
ORDER = 8

#: Changes are whole multiples of a step up to this share of it.
WHOLE = 1e-3


def noise_level(x: Array, t: Array | None = None) -> Array:
    """Return the standard deviation of white noise on smooth signals (N, n), (n,).

    No difference reaches across a gap in the times t (N,) [s], if they are given.
    """
    if len(x) <= ORDER:
        return np.zeros(x.shape[1])
    differences = np.diff(x, ORDER, axis=0)
    if t is not None:
        gaps = np.concatenate([[0], np.cumsum(signals.has_gap(t))])
        whole = gaps[ORDER:] == gaps[:-ORDER]
        differences = differences[whole] if whole.any() and not whole.all() else differences
    level: Array = np.sqrt(np.mean(differences**2, axis=0) / binom(2 * ORDER, ORDER))
    return level


def resolution(x: Array) -> Array:
    """Return the step of which signals (N, n) are whole multiples, (n,); 0 where none is seen."""
    steps = np.abs(np.diff(x, axis=0))
    found = np.zeros(x.shape[1])
    for k, own in enumerate(steps.T):
        own = own[own > 1e-9 * np.ptp(x[:, k])]  # noqa: PLW2901 - what moved
        least = own.min(initial=np.inf)
        if len(own) and np.all(np.abs(own / least - np.rint(own / least)) < WHOLE):
            found[k] = least
    return found


def lowest_cutoff(
    is_noise: Callable[[float], bool], low: float, high: float, within: float
) -> float:
    """Return the lowest cut-off between two [Hz], within a factor, that leaves out noise alone.

    Parameters
    ----------
    is_noise : callable(float)
        Whether what a cut-off leaves out is no more than noise; the highest need not be asked.
    low, high : float [Hz]
    within : float
    """
    while high > within * low:
        middle = float(np.sqrt(low * high))
        if is_noise(middle):
            high = middle
        else:
            low = middle
    return high
