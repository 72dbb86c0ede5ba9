"""How strongly data speak for a function without a name: its straightest directions first.

Splines of which any function can be made are many, and most of what is missing is nearly straight
in something: a drift of the torque would pay for six columns, one of the friction for fifteen. So
straight lines are asked alone, and with what bends, the least first [Fan 1996].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import log_tail
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.smooth import TINY, bends_of, lines_of

#: Length of unit columns beside the model below which a direction is the model's.
THIN = 1e-4


def straight_first(c: Candidate, G: Array, length: Array) -> tuple[Array, tuple[int, ...]]:
    """Return directions (k, d) by what they bend for what they say, and how many to ask.

    The straightest are first [Demmler & Reinsch 1975]; along each, columns have length one.
    Straight lines are asked alone, then twice as many directions, and so on to all of them.

    Parameters
    ----------
    c : Candidate
    G : (k, k)
        Products of what its columns add, each over its length.
    length : (k,)
    """
    values, vectors = np.linalg.eigh(G)
    seen = values > THIN**2
    half = vectors[:, seen] / np.sqrt(values[seen])
    bends, lines = bends_of(c) / np.where(length > 0, length, 1.0), lines_of(c) * length[:, None]
    turn = np.linalg.svd(bends @ half)[2][::-1]
    lines = lines / np.maximum(np.linalg.norm(lines, axis=0), TINY)
    straight = np.linalg.eigvalsh(lines.T @ G @ lines) > THIN**2
    counts = [min(max(int(straight.sum()), 1), len(turn))]
    while counts[-1] < len(turn):
        counts.append(min(2 * counts[-1], len(turn)))
    return half @ turn.T, tuple(counts)


def score_straight(levels: Array, counts: Sequence[int]) -> Array:
    """Return minus the logarithms of tails (T,) from levels in standard errors (d, T).

    The first so many levels that stand out most count, in simulated noise as in the data, less what
    the choice costs [Bonferroni].
    """
    squares = np.cumsum(levels**2, axis=0)
    tails = [log_tail(squares[n - 1], n) for n in counts]
    scores: Array = -np.min(tails, axis=0) - np.log(len(counts))
    return scores
