"""Is a model surely worse at a joint than another? Paired tests over stretches of time.

Family-wise: over all joints, and over the two ways to look. Student's t of the mean sees a rise
wherever it is large. Ranks with signs [Wilcoxon 1945] see a rise of nearly every stretch, which one
odd stretch hides from any mean: on a UR10 fifteen of sixteen stretches lost by the friction that
was left out at a wrist, and one stretch that no model follows gained more than all of them.
"""

from __future__ import annotations

import numpy as np
from scipy.special import stdtr

from identifiability.foundation.names import Array

#: Level of all tests together.
LEVEL = 0.05

#: Rises below this share of the sum are rounding.
ROUNDING = 1e-9


def surely_above(rise: Array, size: Array) -> np.ndarray:
    """Return where sums over stretches are surely larger than another model's, (n,) bool.

    Parameters
    ----------
    rise : (S, n)
        By how much each stretch is larger.
    size : (n,)
        The other model's sums over all stretches.
    """
    stretches = len(rise)
    total, acts = rise.sum(0), np.abs(rise).sum(0) > ROUNDING * size
    if stretches < 2 or not acts.any():
        return np.zeros(rise.shape[1], bool)
    level = 1.0 - (1.0 - LEVEL) ** (1.0 / (2 * acts.sum()))
    error = rise.std(0, ddof=1) * np.sqrt(stretches)
    t = np.divide(total, error, out=np.where(total > 0, np.inf, 0.0), where=error > 0)
    by_mean = stdtr(stretches - 1, -t) < level
    by_ranks = rank_level(rise) < level
    above: np.ndarray = acts & (by_mean | by_ranks)
    return above


def rank_level(rise: Array) -> Array:
    """Return how often chance would put so much of the ranks above zero, exactly, (n,).

    Parameters
    ----------
    rise : (S, n)
    """
    stretches = len(rise)
    ranks = np.abs(rise).argsort(0).argsort(0) + 1
    above = np.where(rise > 0, ranks, 0).sum(0)
    chance = np.zeros(stretches * (stretches + 1) // 2 + 1)
    chance[0] = 1.0
    for rank in range(1, stretches + 1):  # each rank has either sign
        chance[rank:] = 0.5 * chance[rank:] + 0.5 * chance[: len(chance) - rank]
        chance[:rank] *= 0.5
    tail = np.cumsum(chance[::-1])[::-1]
    level: Array = tail[above]
    return level
