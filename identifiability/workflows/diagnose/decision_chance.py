"""How likely it is that logs tell two effects apart, by the rule that calls names undecided."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.excite.criteria import Discrimination

#: Experiments that are drawn for a chance.
DRAWN = 20_000


def decision_chance(aim: Discrimination, G: Array, alike: float) -> float:
    """Return the chance that of two effects the true one is named alone, whichever it is.

    Both are scored by the squares that they explain; a name is undecided where the other is alike
    and its score comes within `lookalikes.DECISIVE`.

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
    for way in (aim, aim.reverse):
        right = np.ones(DRAWN, bool)
        for one in way.each if way is not None else ():
            similarity = float(one.angles(G[None])[0][0])
            whole, own = (float(part[0]) for part in one.squares(G[None]))
            first = np.sqrt(whole) + e[0]
            # The other explains what is not the first one's own, and of the noise what it shares.
            second = np.sqrt(max(whole - own, 0.0))
            second = second + similarity * e[0] + np.sqrt(max(1 - similarity**2, 0.0)) * e[1]
            ahead = 0.5 * (first**2 - second**2)
            right &= ahead > (DECISIVE if similarity > alike else 0.0)
        chances.append(float(np.mean(right)))
    return min(chances)
