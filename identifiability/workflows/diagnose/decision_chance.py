"""What tells two effects apart, and how likely: by the rule that calls names undecided."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.excite.criteria import Discrimination, Separation
from identifiability.workflows.excite.question import Question

#: Experiments that are drawn for a chance.
DRAWN = 20_000


def aim_at(
    question: Question, G: Array, widths: Sequence[Sequence[int]], at: int, values: Array
) -> Discrimination:
    """Return what tells the first effect, as it was found, from the second, and the reverse.

    Where the second is true it is as large as the logs take it for the first.

    Parameters
    ----------
    question : Question
        By `Separation`, whose effects are a number of shapes each.
    G : (k, k)
        What the logs say.
    widths : two sequences of int
        Columns of each shape of both effects.
    at : int
        The shape of the first that was found.
    values : (p,)
        Of the first, with that shape.
    """
    aim = question.criterion
    assert isinstance(aim, Separation)
    effects = np.concatenate([aim.first, aim.second])
    firsts, seconds = (
        tuple(np.split(own, np.cumsum(each)[:-1]))
        for own, each in zip((aim.first, aim.second), widths, strict=True)
    )
    model = np.setdiff1d(np.arange(len(G)), effects)
    length = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(length, length)
    base = np.linalg.pinv(unit[np.ix_(model, model)], rcond=1e-12, hermitian=True)
    left = unit - unit[:, model] @ base @ unit[model]
    true, best, likeliest = values * length[firsts[at]], -np.inf, (seconds[0], np.zeros(1))
    for own in seconds:
        cross = left[np.ix_(own, firsts[at])] @ true
        level = np.linalg.pinv(left[np.ix_(own, own)], rcond=1e-9, hermitian=True) @ cross
        if float(level @ cross) > best:
            best, likeliest = float(level @ cross), (own, level / length[own])
    own, level = likeliest
    back = Discrimination(own, aim.first, level, firsts, effects)
    return Discrimination(firsts[at], aim.second, values, seconds, effects, back)


def decision_chance(aim: Discrimination, G: Array, alike: float) -> float:
    """Return the chance that of two effects the true one is named alone.

    Either may be true, one as likely as the other as long as nothing tells them apart. Both are
    scored by the squares that they explain; a name is undecided where the other is alike and its
    score comes within `lookalikes.DECISIVE`.

    Parameters
    ----------
    aim : Discrimination
    G : (k, k)
        Information about its columns, in units of the noise.
    alike : float
        Similarity from which on two names may be undecided.
    """
    e = np.random.default_rng(0).standard_normal((2, DRAWN))
    chances = []
    for way in (aim,) if aim.reverse is None else (aim, aim.reverse):
        right = np.ones(DRAWN, bool)
        for one in way.each:
            similarity = float(one.angles(G[None])[0][0])
            whole, own = (float(part[0]) for part in one.squares(G[None]))
            first = np.sqrt(whole) + e[0]
            # The other explains what is not the first one's own, and of the noise what it shares.
            second = np.sqrt(max(whole - own, 0.0))
            second = second + similarity * e[0] + np.sqrt(max(1 - similarity**2, 0.0)) * e[1]
            ahead = 0.5 * (first**2 - second**2)
            right &= ahead > (DECISIVE if similarity > alike else 0.0)
        chances.append(float(np.mean(right)))
    return float(np.mean(chances))
