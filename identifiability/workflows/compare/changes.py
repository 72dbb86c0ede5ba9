"""What changed: causes that can be named, tested against each other at one family-wise level.

A cause is a way in which the values can change together: the friction of a joint, a load on a body,
a torque offset. Each is tested against the whole difference, which it must explain better than
chance [Wald 1943]; all of them together, and every single value of the bodies, are one family, each
at its share of the level. Of those that are sure the one that explains most is taken for true, and
the others are tested for what it leaves, until none is sure: friction that rose by itself is then
not also a load.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import f

from identifiability.foundation.names import Array
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen
from identifiability.workflows.compare.causes import SAME, Cause
from identifiability.workflows.compare.difference import Difference

#: Family-wise level of all tests.
LEVEL = 0.05

#: Torque is compared with what it was where that was so many times what chance makes, and nothing
#: of it had a sign that friction and rotors cannot have.
SEEN = 3.0

#: What each further number of a cause must explain [σ²].
PRICE = 4.0

#: Standard deviations above the limit at which nine of ten changes are found.
POWER = 1.28


@frozen(kw_only=True)
class Change:
    """A cause that surely changed something.

    Attributes
    ----------
    cause : Cause
    p : float
        Family-wise, when it was found.
    sizes, sd : (q,)
        Of its numbers, beside all others that were found; NaN where they are not told.
    share, share_sd : float
        Of its torque before; NaN where it had none.
    """

    cause: Cause
    p: float
    sizes: Array
    sd: Array
    share: float
    share_sd: float


def find_changes(causes: Sequence[Cause], difference: Difference) -> tuple[Change, ...]:
    """Return what surely changed, the surest first."""
    size = np.sqrt(np.diag(difference.covariance))
    whiten = np.linalg.inv(np.linalg.cholesky(difference.covariance / np.outer(size, size))) / size
    y, designs = whiten @ difference.change, [whiten @ c.design for c in causes]
    moves = difference.moves @ whiten.T
    taken: list[int] = []
    sure: list[float] = []
    wide: list[float] = []
    base = np.zeros((len(y), 0))
    while len(taken) < len(causes):
        pairs = zip(causes, designs, strict=True)
        tests = [_test(y, _basis(X[:, : c.tested], base), moves, difference.dof) for c, X in pairs]
        family = [p * len(causes) for p, *_ in tests]
        gains = [t[1] if p < LEVEL else 0.0 for t, p in zip(tests, family, strict=True)]
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break
        taken.append(best)
        sure.append(family[best])
        wide.append(tests[best][2])
        base = np.hstack([base, _basis(designs[best], base)])
    if not taken:
        return ()
    X = np.hstack([designs[k] for k in taken])
    inverse, told = _invert(X)
    sizes, spread = inverse @ y, inverse @ inverse.T
    changes, start = [], 0
    for k, p, wider in zip(taken, sure, wide, strict=True):
        at = slice(start, start + designs[k].shape[1])
        start = at.stop
        own = wider * spread[at, at]
        share, share_sd = _share(causes[k], difference, sizes[at], own, told[at])
        changes.append(
            Change(
                cause=causes[k],
                p=min(p, 1.0),
                sizes=np.where(told[at], sizes[at], np.nan),
                sd=np.where(told[at], np.sqrt(np.diag(own)), np.nan),
                share=share,
                share_sd=share_sd,
            )
        )
    return tuple(changes)


def find_from(cause: Cause, difference: Difference, count: int) -> float:
    """Return the share of its torque from which on a change of a cause is mostly found; or NaN.

    Parameters
    ----------
    cause : Cause
    difference : Difference
    count : int
        Of all causes in the family.
    """
    at = np.flatnonzero(np.abs(cause.design).max(1) > SAME)
    own = np.zeros(len(difference.before))
    own[at] = difference.before[at]
    if not own.any():
        return float("nan")
    information = float(own @ np.linalg.solve(difference.covariance, own))
    q = cause.design.shape[1]
    limit = np.sqrt(q * f.isf(LEVEL / count, q, difference.dof))
    return float((limit + POWER) / np.sqrt(information))


def _basis(X: Array, base: Array) -> Array:
    """Return orthonormal directions of X (k, q) beside those of a base (k, s)."""
    left = X / np.maximum(np.linalg.norm(X, axis=0), np.finfo(float).tiny)
    left = left - base @ (base.T @ left)
    turn, size, _ = np.linalg.svd(left, full_matrices=False)
    found: Array = turn[:, size > SAME]
    return found


def _test(y: Array, own: Array, moves: Array, dof: float) -> tuple[float, float, float]:
    """Return a cause's p-value, what it explains [σ²], and its variance over that by formula.

    What it explains pays for its numbers, so that of sure causes the one is taken that says most.

    Parameters
    ----------
    y : (k,)
        The difference, white.
    own : (k, q)
        Orthonormal directions of the cause beside those that were taken.
    moves : (B, k)
        By how much stretches of time move the difference.
    dof : float
    """
    q = own.shape[1]
    if not q:
        return 1.0, 0.0, 1.0
    wider = max(float(((moves @ own) ** 2).sum()) / q, 1.0)
    square = float(((own.T @ y) ** 2).sum()) / wider
    return float(f.sf(square / q, q, dof)), square - PRICE * (q - 1), wider


def _invert(X: Array) -> tuple[Array, np.ndarray]:
    """Return the pseudo-inverse of designs (k, q), and which numbers they tell, (q,) bool."""
    length = np.linalg.norm(X, axis=0)
    length = np.where(length > SAME * length.max(), length, np.inf)
    _, size, turn = np.linalg.svd(X / length)
    null = np.vstack([turn[: len(size)][size <= SAME], turn[len(size) :]])
    told: np.ndarray = (np.abs(null) < np.sqrt(SAME)).all(0)
    inverse: Array = np.linalg.pinv(X / length, rcond=SAME) / length[:, None]
    return inverse, told


def _share(
    cause: Cause, difference: Difference, sizes: Array, spread: Array, told: np.ndarray
) -> tuple[float, float]:
    """Return by which share the torque of a cause grew, and its standard deviation.

    Torque is measured as the logs before saw it: in the metric of what they know of its values.
    """
    if cause.kind not in ("friction", "effect") or not told.all():
        return float("nan"), float("nan")
    at = np.flatnonzero(np.abs(cause.design).max(1) > SAME)
    metric = np.linalg.inv(difference.known[np.ix_(at, at)])
    own, design = difference.before[at], cause.design[at]

    def size(change: Array) -> float:
        value = own + design @ change
        return float(np.sqrt(value @ metric @ value))

    usual = size(np.zeros_like(sizes))
    noise = np.sqrt(len(at))  # what values of nothing would have by chance
    if usual < SEEN * noise or (own < -REACH * np.sqrt(np.diag(difference.known)[at])).any():
        return float("nan"), float("nan")
    now = own + design @ sizes
    slope = design.T @ metric @ now / (size(sizes) * usual)
    return size(sizes) / usual - 1, float(np.sqrt(slope @ spread @ slope))
