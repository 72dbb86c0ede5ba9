"""Structural aliases: what this motion could never name, and what it hides behind.

Before any test every candidate is projected on the base model. What leaves almost nothing looks,
along this motion, exactly like parameters that the model has already.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.rows import Candidate, Rows


@frozen
class Alias:
    """How much of a candidate the base model does not contain.

    Attributes
    ----------
    family, place : str
    remaining : float
        Root mean square of what is left, as a share of the candidate's own.
    behind : tuple of str
        Parameters that make up what is not left, the largest first.
    structural : bool
        Whether it can never be named from this motion.
    """

    family: str
    place: str
    remaining: float
    behind: tuple[str, ...]
    structural: bool


def find_aliases(
    rows: Rows, candidates: Sequence[Candidate], names: Sequence[str], share: float
) -> list[Alias]:
    """Return one entry for every family and place, that of its most visible shape.

    Parameters
    ----------
    rows : Rows
    candidates : sequence of Candidate
    names : sequence of str
        Of the base columns.
    share : float
        Remaining share below which a candidate is structurally aliased.
    """
    n, b = rows.joints, rows.X.shape[2]
    scale = np.sqrt(np.mean(rows.tau**2, axis=0))
    weight = 1.0 / np.where(scale > 0, scale, 1.0)
    X = (rows.X * weight[:, None]).reshape(len(rows) * n, b)
    D = (rows.D * weight[:, None]).reshape(len(rows) * n, -1)
    X, D = _unit(X), _unit(D)
    value = np.linalg.lstsq(X, D, rcond=1e-8)[0] if b else np.zeros((0, D.shape[1]))
    left = np.linalg.norm(D - X @ value, axis=0)
    out: dict[tuple[str, str], Alias] = {}
    for c in candidates:
        at = c.columns[int(np.argmax(left[list(c.columns)]))]
        remaining = float(left[at])
        if c.group in out and out[c.group].remaining >= remaining:
            continue
        size = np.abs(value[:, at])
        order = [k for k in np.argsort(-size)[:3] if size[k] > 0.1 * size.max(initial=0.0)]
        behind = tuple(names[k] for k in order)
        out[c.group] = Alias(*c.group, remaining, behind, remaining < share)
    return list(out.values())


def _unit(A: Array) -> Array:
    length = np.linalg.norm(A, axis=0)
    scaled: Array = A / np.where(length > 0, length, 1.0)
    return scaled
