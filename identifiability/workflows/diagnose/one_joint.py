"""A cause that acts in several joints has one size in all of them, or it is not the cause.

A tilted base, a payload, friction in a hinge reach several motors by the same parameters. What is
in one motor alone may resemble what they do there, and joints that hardly show them object little.
Sizes must agree, as those of several experiments on one quantity must [Cochran 1954]: a name goes
where the joint that shows it best has surely another size than the others, and theirs is nearer to
none, so that in that joint alone it explains more than in all of them.

Several such causes together can be whatever one motor does: forces that cancel in all others. That
independent causes cancel would be chance, so the data must decide that any other joint has them.
Where a family is surely in several joints one more of its places is not asked alone: what else the
model misses there, however little of all that the family explains, would speak against it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import tail_of_sum
from identifiability.workflows.diagnose.dictionary import Stacked
from identifiability.workflows.diagnose.evidence import Whitened
from identifiability.workflows.diagnose.gates import Chosen
from identifiability.workflows.diagnose.leftover import basis_beside, squares_along
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.rows import Candidate


def find_in_one_joint(
    white: Whitened, chosen: Sequence[Candidate], level: float
) -> list[Candidate]:
    """Return the names, of a family or all, of what one of their joints alone has.

    Parameters
    ----------
    white : Whitened
        With simulated noise: slow noise is more likely to differ from joint to joint.
    chosen : sequence of Candidate
    level : float
        Of the test that the joint has the size of the others.
    """
    whole = [c for c in chosen if len(split_by_joint(white.D, c.columns)) > 1]
    families = dict.fromkeys(c.family.name for c in whole)
    units = [[c for c in whole if c.family.name == name] for name in families]
    units += [whole] if len(units) > 1 else []
    units = [unit for unit in units if is_in_one_joint(white, chosen, unit, level)]
    return [c for c in chosen if any(c in unit for unit in units)]


def is_in_one_joint(
    white: Whitened, chosen: Sequence[Candidate], unit: Chosen, level: float
) -> bool:
    """Whether one name, or several together, is of what one of its joints alone has."""
    columns = [k for c in unit for k in c.columns]
    apart = split_by_joint(white.D, columns)
    Q = white.basis([c for c in chosen if c not in unit])
    whole = basis_beside(Q, white.D[:, columns])
    alone = [basis_beside(Q, part) for part in apart]
    explained = [squares_along(U, white.y) for U in alone]
    best = int(np.argmax(explained))
    beyond = float(squares_along(whole, white.y) - explained[best])
    if len({c.group for c in unit}) > 1:
        return beyond < 2 * DECISIVE
    own = basis_beside(whole, alone[best])
    if not own.shape[1] or beyond >= 0:
        return False
    between = float(squares_along(own, white.y))
    p = float(stats.chi2.sf(between, own.shape[1]))
    drawn = squares_along(own, np.column_stack([white.scale, white.noise]))
    return p < level and (drawn.size < 2 or tail_of_sum(between, drawn) < level)


def split_by_joint(D: Array | Stacked, at: Sequence[int]) -> list[Array]:
    """Return some columns in each joint where any of them is, zero elsewhere, [(R, k), …]."""
    if not isinstance(D, Stacked):
        return []
    columns = D[:, at]
    ends = np.cumsum([len(block.values) for block in D.blocks])
    out = []
    for block, stop in zip(D.blocks, ends.tolist(), strict=True):
        if np.isin(at, block.columns).any():
            here = np.zeros((len(columns), 1))
            here[stop - len(block.values) : stop] = 1.0
            out.append(columns * here)
    return out
