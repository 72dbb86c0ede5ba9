"""Finer shapes where the data tell neighbours on a family's grid apart.

Between two shapes of a grid a curve keeps up to a tenth of its length. A large effect, or a long
log, shows what is kept, and a second name would explain it, or a rival whose grid lies better.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise

import numpy as np

from identifiability.workflows.diagnose.evidence import score_candidates
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.rows import Candidate, Finer

#: Logarithm of the likelihood that a true shape may lose to the nearest one that is tried, and
#: shapes that are tried between neighbours at most.
LOSS, MOST = 0.5, 24


def find_finer(m: Material, chosen: Sequence[Candidate]) -> Finer:
    """Return shapes between neighbours for what was named, and for what resembles it.

    Each family is asked for alone in its place, beside what was named elsewhere and what hangs on
    something else: two of a kind may be the one that lies between them.
    """
    finer: dict[tuple[str, str], tuple[float, ...]] = {}
    for place, against in {(c.place, c.family.against) for c in chosen if c.family.continuous}:
        kind = [
            c
            for c in m.candidates
            if c.family.continuous and (c.place, c.family.against) == (place, against)
        ]
        rest = [c for c in chosen if (c.place, c.family.against) != (place, against)]
        fit = score_candidates(m.white, m.white.basis(rest), kind, null=False).fit
        for slot, group in groupby(zip(kind, fit, strict=True), key=lambda one: one[0].slot):
            tried = sorted((c.shape, value) for c, value in group if np.isfinite(value))
            shapes = _between(*np.array(tried).reshape(-1, 2).T)
            finer[slot[:2]] = (*finer.get(slot[:2], ()), *shapes)
    return {where: shapes for where, shapes in finer.items() if shapes}


def _between(shapes: np.ndarray, fit: np.ndarray) -> tuple[float, ...]:
    """Return shapes about the best of some rising ones, as close as the fall beside it asks for."""
    if len(shapes) < 3:
        return ()
    at = int(np.clip(np.argmax(fit), 1, len(shapes) - 2))
    bend = 2 * fit[at] - fit[at - 1] - fit[at + 1]
    # Half a step away from its maximum a parabola has fallen by an eighth of its bend.
    parts = min(int(np.ceil(np.sqrt(max(bend, 0.0) / 8 / LOSS))), MOST)
    edges = shapes[at - 1 : at + 2]
    out = [np.geomspace(a, b, parts + 1)[1:-1] for a, b in pairwise(edges)]
    return tuple(np.concatenate(out).tolist()) if parts > 1 else ()
