"""What looks like what: effects that this motion can never name, and rivals of what it names.

Before any test every candidate is projected on the base model. What leaves almost nothing looks,
along this motion, exactly like parameters that the model has already. Of what is named, others
may be told by neither motion nor data.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import log_tail
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import (
    NEGLIGIBLE,
    Whitened,
    compress,
    score_candidates,
)
from identifiability.workflows.diagnose.rows import Candidate, Rows
from identifiability.workflows.diagnose.smooth import Bends, bends_of, is_smooth, lines_of
from identifiability.workflows.diagnose.spans import (
    directions,
    project_out,
    singular_values,
    unit_columns,
)
from identifiability.workflows.diagnose.values import solve_values

#: Logarithm of the likelihood ratio that decides between two similar names: about 50 to 1.
DECISIVE = 4.0
#: Canonical correlation from which on a direction of one is one of the other.
SAME = 1.0 - 1e-6
#: Decimals that count where shares and sizes are compared: those beyond are another processor's
#: rounding, and of what ties the first comes first, in the order of candidates and parameters.
DECIMALS = 9


@frozen
class Alias:
    """How much of a candidate the base model does not contain.

    Attributes
    ----------
    family, place : str
    remaining : float
        Root mean square of what is left, as a share of the candidate's own; of several columns
        the largest share of all that they can be.
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

    Of several columns together it is the most visible of all torques that they can make: how much
    of a spring is gravity must not hang on where its position is counted from.

    Parameters
    ----------
    rows : Rows
    candidates : sequence of Candidate
    names : sequence of str
        Of the base columns.
    share : float
        Remaining share below which a candidate is structurally aliased.
    """
    b = rows.X.shape[2] if rows.root is None else 0
    scale = np.sqrt(np.mean(rows.tau**2, axis=0))
    weight = 1.0 / np.where(scale > 0, scale, 1.0)
    none = np.empty((len(rows), 0))
    parts = [
        # Values with known errors hide nothing for ever: a larger effect shows.
        compress(rows.joint_columns(j) * w, none)[0]
        for j, w in enumerate(weight)
    ]
    _, X, D = rows.stack(parts)
    X = unit_columns(X[:, :b])
    inverse = np.linalg.pinv(X, rcond=1e-8)
    out: dict[tuple[str, str], Alias] = {}
    for c in candidates:
        own = directions(unit_columns(D[:, list(c.columns)]), NEGLIGIBLE)
        value = inverse @ own
        left = float(singular_values(own - X @ value).max(initial=0.0))
        if c.group in out and round(out[c.group].remaining, DECIMALS) >= round(left, DECIMALS):
            continue
        size = np.linalg.norm(value, axis=1)
        size = np.round(size / (size.max(initial=0.0) or 1.0), DECIMALS)
        order = [k for k in np.argsort(-size, kind="stable")[:3] if size[k] > 0.1]
        behind = tuple(names[k] for k in order)
        out[c.group] = Alias(*c.group, left, behind, left < share)
    return list(out.values())


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
    contains : bool
        Whether it can be all in this motion that what was named can be.
    """

    family: str
    place: str
    similarity: float
    undecided: bool
    contains: bool = False


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
    model, Q = white.columns(rest), white.basis(rest)
    own = _directions(Q, white, named)
    taken = {c.group for c in rest} | {named.group}
    # What refines the named effect is no rival: it comes on top of it. Nor is a function that was
    # refuted in its stead: whatever law there is is one.
    others = [
        c
        for c in candidates
        if not (c.family.unnamed or c.group in taken) and (c.family.needs, c.place) != named.group
    ]
    if not others:
        return []
    score, *scores = _score_smooth(white, Q, [named, *others])
    out: dict[tuple[str, str], Rival] = {}
    for c, s in zip(others, scores, strict=True):
        other = _directions(Q, white, c)
        if not other.shape[1] or not own.shape[1]:
            continue
        if _opposite(own, other, white, (named, c)):
            continue
        shared = singular_values(own.T @ other)
        similarity = float(shared[0])
        contains = own.shape[1] < other.shape[1] and float(shared[-1]) > SAME
        undecided = similarity > similar and s > score - DECISIVE
        if undecided and contains:
            undecided = not _shows_no_more(white, model, (named, c), own, Q)
        before = out.get(c.group, Rival(*c.group, 0.0, False))
        similarity = min(max(similarity, before.similarity), 1.0)
        out[c.group] = Rival(
            *c.group,
            similarity,
            undecided=bool(undecided or before.undecided),
            contains=contains or before.contains,
        )
    return sorted(out.values(), key=lambda r: -r.similarity)


def _score_smooth(white: Whitened, Q: Array, candidates: Sequence[Candidate]) -> list[float]:
    """Return the fit of each candidate, of a curve by as many columns as it has freedom.

    Parameters
    ----------
    Q : (R, m)
        Orthonormal basis of the columns beside which they stand.
    """
    fit: list[float] = score_candidates(white, Q, candidates, null=False).fit.tolist()
    for k, c in enumerate(candidates):
        if is_smooth(c):
            Z = project_out(Q, white.D[:, list(c.columns)])
            found = Bends.of(Z, project_out(Q, white.y), bends_of(c))
            if found is not None:
                squares = found.squares
                fit[k] = float(-log_tail(squares.sum(), len(squares)))
    return fit


def _shows_no_more(
    white: Whitened, model: Array, both: Sequence[Candidate], own: Array, Q: Array
) -> bool:
    """Whether a rival of which the named effect is a part would have to explain more than it does.

    It is taken to be as large as what was named, each of its columns with an equal share: then the
    directions that only it has would explain so much more. Where they do not, the part is it. A
    curve may bend as little as it likes: of that only what is straight would have to be there.

    Parameters
    ----------
    model : (R, m)
    both : (Candidate, Candidate)
        Named, and the rival.
    own : (R, k)
        Orthonormal basis of what the named one adds.
    Q : (R, ·)
        That of the model.
    """
    named, rival = (white.D[:, list(c.columns)] for c in both)
    if is_smooth(both[1]):
        rival = rival @ lines_of(both[1])
    other = _basis(Q, rival)
    vectors, s, _ = np.linalg.svd(project_out(own, other), full_matrices=False)
    only = vectors[:, s > 0.5]  # of two bases of which one holds the other these are one or zero
    level = solve_values(white, np.column_stack([model, named]))[0][model.shape[1] :]
    size = float(np.linalg.norm(named @ level))
    expected = size**2 * float(np.mean(((only.T @ unit_columns(rival)) ** 2).sum(0)))
    return 0.5 * (expected - float(((only.T @ white.y) ** 2).sum())) > DECISIVE


def _opposite(own: Array, other: Array, white: Whitened, both: Sequence[Candidate]) -> bool:
    """Whether two levels that may not be negative act against each other: neither says the other.

    Parameters
    ----------
    own, other : (R, k)
        Orthonormal bases of what each of `both` adds.
    """
    if not all(c.positive and len(c.columns) == 1 for c in both):
        return False
    first, second = (
        float(basis[:, 0] @ white.D[:, c.columns[0]])
        for basis, c in zip((own, other), both, strict=True)
    )
    return first * second * float(own[:, 0] @ other[:, 0]) < 0


def leave_to_model(
    white: Whitened, rest: Sequence[Candidate], c: Candidate, value: Array, share: float
) -> tuple[Array, Array]:
    """Return values and errors (k,) of a candidate without what the model says as well.

    A curve over position contains what a spring, an offset or the gravity of its joint is. In
    directions of its columns of which less than `share` lies outside of the rest of the model the
    data do not tell them apart: they are left to the model, or the curve were any curve.
    """
    D = white.D[:, list(c.columns)]
    length = np.linalg.norm(D, axis=0)
    length = np.where(length > 0, length, 1.0)
    _, s, Vt = np.linalg.svd(project_out(white.basis(rest), D / length), full_matrices=False)
    V, s = Vt[s > share], s[s > share]
    own: Array = V.T @ (V @ (value * length)) / length
    error: Array = np.sqrt(((V.T / s) ** 2).sum(1)) / length
    return own, error


def _directions(Q: Array, white: Whitened, c: Candidate) -> Array:
    """Return an orthonormal basis of what a candidate adds to the span of Q."""
    return _basis(Q, white.D[:, list(c.columns)])


def _basis(Q: Array, D: Array) -> Array:
    return directions(project_out(Q, unit_columns(D)), NEGLIGIBLE)
