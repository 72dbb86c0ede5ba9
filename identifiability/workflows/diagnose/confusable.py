"""What else could be meant: similarity of candidates after the model is projected out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import (
    NEGLIGIBLE,
    Whitened,
    orthonormal,
    project_out,
    score_candidates,
)
from identifiability.workflows.diagnose.rows import Candidate

#: Logarithm of the likelihood ratio that decides between two similar names: about 50 to 1.
DECISIVE = 4.0


@frozen
class Rival:
    """Another name for the same rows.

    Attributes
    ----------
    family, place : str
    similarity : float
        Largest canonical correlation with what was named, beside the rest of the model.
    undecided : bool
        Whether neither motion nor data tell the two apart.
    """

    family: str
    place: str
    similarity: float
    undecided: bool


def find_rivals(
    white: Whitened,
    named: Candidate,
    rest: Sequence[Candidate],
    candidates: Sequence[Candidate],
    similar: float,
) -> list[Rival]:
    """Return the rivals of a named candidate, one for each family and place, most similar first.

    Parameters
    ----------
    white : Whitened
    named : Candidate
    rest : sequence of Candidate
        The other named ones.
    candidates : sequence of Candidate
        All that are not structurally aliased.
    similar : float
        Similarity above which two names may be undecided.
    """
    model = white.columns(rest)
    Q = orthonormal(model)
    own = _directions(Q, white, named)
    taken = {c.group for c in rest} | {named.group}
    # What refines the named effect is no rival: it comes on top of it.
    others = [
        c for c in candidates if c.group not in taken and (c.family.needs, c.place) != named.group
    ]
    if not others:
        return []
    score = float(score_candidates(white, model, [named], null=False).fit[0])
    scores = score_candidates(white, model, others, null=False).fit
    out: dict[tuple[str, str], Rival] = {}
    for c, s in zip(others, scores, strict=True):
        directions = _directions(Q, white, c)
        if not directions.shape[1] or not own.shape[1]:
            continue
        similarity = float(np.linalg.norm(own.T @ directions, 2))
        undecided = similarity > similar and s > score - DECISIVE
        before = out.get(c.group)
        if before is not None:
            similarity = max(similarity, before.similarity)
            undecided = undecided or before.undecided
        out[c.group] = Rival(*c.group, min(similarity, 1.0), bool(undecided))
    return sorted(out.values(), key=lambda r: -r.similarity)


def _directions(Q: Array, white: Whitened, c: Candidate) -> Array:
    """Return an orthonormal basis of what a candidate adds to the span of Q."""
    D = white.D[:, list(c.columns)]
    length = np.linalg.norm(D, axis=0)
    U = project_out(Q, D / np.where(length > 0, length, 1.0))
    vectors, s, _ = np.linalg.svd(U, full_matrices=False)
    basis: Array = vectors[:, s > NEGLIGIBLE]
    return basis
