"""Torque columns that are exchanged or have the wrong sign: would the log fit far better otherwise?

Other orders and signs of the torque columns are fitted to some of the samples, all from the same
Gram matrices. A sign often changes no error, only the sign of a joint's own parameters; there
friction and rotor inertia decide, which cannot be negative.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.values import frozen
from identifiability.regression.regression import CHUNK, Regression
from identifiability.regression.rules import RULES

#: Samples that are looked at, spread over all logs.
ENOUGH = 2000

#: Joints beyond which signs are flipped one at a time only.
MOST_SIGNS = 8


@frozen
class _Fit:
    """Relative error of a fit to torque columns in another order or with other signs.

    `error` is the root of squared errors over squared deviations from the mean, joints alike;
    `negative` says at which joints friction and rotor inertia come out negative.
    """

    order: tuple[int, ...]
    signs: tuple[int, ...]
    error: float
    negative: tuple[bool, ...]


def find_mix_up(regression: Regression, nonnegative: np.ndarray) -> str:
    """Return one sentence on how the torque columns seem to be mixed up, or nothing.

    Parameters
    ----------
    regression : Regression
        The unpruned model on the logs.
    nonnegative : (p,) bool
        Which of its columns belong to parameters that cannot be negative.
    """
    joints = regression.robot.joints
    owners = np.array([p.name.rpartition(".")[0] for p in regression.parameters])
    own = np.stack([nonnegative & (owners == j) for j in joints])
    few = _thin(regression)
    tau = _torque(few)
    n, spread = len(joints), np.sum((tau - tau.mean(0)) ** 2, 0)
    if len(tau) * n <= 2 * len(owners) or not (spread > 0).all():
        return ""
    gram, cross = _grams(few, tau)
    square = np.sum(tau**2, 0)

    @lru_cache(maxsize=1)  # signs do not change it
    def invert(order: tuple[int, ...]) -> Array:
        G = np.zeros((len(owners), len(owners)))
        for (seen, own_gram), weight in zip(gram, 1.0 / spread[list(order)], strict=True):
            G[np.ix_(seen, seen)] += weight * own_gram
        return np.asarray(np.linalg.pinv(G, rcond=1e-10, hermitian=True))

    def fit(order: tuple[int, ...], signs: tuple[int, ...]) -> _Fit:
        weight = 1.0 / spread[list(order)]
        rows = zip(range(n), order, signs, weight, strict=True)
        g = sum(s * w * cross[a, b] for a, b, s, w in rows)
        inverse = invert(order)
        x = inverse @ g
        whole = float(weight @ square[list(order)])
        left = max(float(whole - g @ x), 1e-12 * whole)  # a perfect fit is one to rounding
        sigma = np.sqrt(np.diag(inverse) * left / (tau.size - len(x)))
        sure = own & (np.abs(x) > RULES.sign_certain * sigma) & (sigma > 0)
        wrong, right = (sure & (x < 0)).sum(1), (sure & (x > 0)).sum(1)
        negative = (wrong >= 2) & (right == 0)
        if wrong.sum() >= 2 and not right.any():
            negative[:] = True
        negative = tuple(negative.tolist())
        return _Fit(order, signs, (left / n) ** 0.5, negative)

    given = fit(tuple(range(n)), (1,) * n)
    least = _least_left(gram, cross, square) / spread
    most = RULES.mixed_error * given.error**2 * n
    possible = (c for c in _candidates(n) if least[range(n), c[0]].sum() < most)
    best = min((fit(*c) for c in possible), key=lambda f: f.error, default=given)
    if best.error**2 >= RULES.mixed_error * given.error**2:
        best = given
    return _describe(joints, given, best)


def _thin(regression: Regression) -> Regression:
    """Return the regression of some samples."""
    each = max(1, ENOUGH // len(regression.samples))
    few = tuple(s.thin(max(1, s.survey.kept // each)) for s in regression.samples)
    return replace(regression, samples=few, instruments=None)


def _torque(regression: Regression) -> Array:
    """Return the torque (N, n) of all samples, which needs no regressor."""
    pieces = (p for part in regression.parts(whole=True) for p in part.samples.pieces(CHUNK))
    return np.concatenate([p.torque for p in pieces])


def _grams(regression: Regression, tau: Array) -> tuple[list[tuple[np.ndarray, Array]], Array]:
    """Return each actuator's columns with their Gram matrix, and products with every torque.

    Columns have length one over all actuators; an actuator sees those of the bodies that it moves.

    Returns
    -------
    list of ((v,) int, (v, v)), and (n, n, p)
    """
    n, p = tau.shape[1], len(regression.parameters)
    whole, cross = [np.zeros((0, 0))] * n, np.zeros((n, n, p))
    known, at = [np.zeros(0, int)] * n, 0
    for _, _, W, own_tau in regression.chunks():
        for a in range(n):
            seen = np.union1d(known[a], np.flatnonzero(W[:, a].any(0)))
            gram, (old, rows) = np.zeros((len(seen),) * 2), (known[a], W[:, a][:, seen])
            gram[np.ix_(*(np.searchsorted(seen, old),) * 2)] = whole[a]
            known[a], whole[a] = seen, gram + rows.T @ rows
            cross[a][:, seen] += (rows.T @ own_tau).T
        at += len(own_tau)
    length = np.zeros(p)
    for seen, gram in zip(known, whole, strict=True):
        length[seen] += np.diag(gram)
    length = np.where(length > 0, np.sqrt(length), 1.0)
    scaled = [
        (seen, gram / np.outer(length[seen], length[seen]))
        for seen, gram in zip(known, whole, strict=True)
    ]
    return scaled, cross / length


def _least_left(grams: Sequence[tuple[np.ndarray, Array]], cross: Array, square: Array) -> Array:
    """Return what each actuator's columns alone leave of each torque's squares at least, (n, n)."""
    out = np.empty((len(grams), len(square)))
    for a, (seen, gram) in enumerate(grams):
        right = cross[a][:, seen]
        inverse = np.linalg.pinv(gram, rcond=1e-14, hermitian=True)
        out[a] = square - np.einsum("bp,pq,bq->b", right, inverse, right, optimize=True)
    return out


def _candidates(n: int) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Yield orders and signs: signs up to that of all, two exchanged, all turned or moved on."""
    plain, same = tuple(range(n)), (1,) * n
    most = n // 2 if n <= MOST_SIGNS else 1
    for count in range(1, most + 1):
        for flipped in combinations(plain, count):
            yield plain, tuple(-1 if k in flipped else 1 for k in plain)
    for i, j in combinations(plain, 2):
        order = list(plain)
        order[i], order[j] = j, i
        yield tuple(order), same
    if n > 2:
        yield plain[::-1], same
        for shift in range(1, n):
            yield plain[shift:] + plain[:shift], same


def _describe(joints: tuple[str, ...], given: _Fit, best: _Fit) -> str:
    turned = [(s < 0) != n for s, n in zip(best.signs, best.negative, strict=True)]
    flipped = [j for j, turn in zip(joints, turned, strict=True) if turn]
    which = "all joints" if all(turned) else listing(flipped, 6)
    pairs = ((joints[a], joints[b]) for a, b in enumerate(best.order) if a != b)
    moved = [f"'{to}.tau' from '{of}.tau'" for to, of in pairs]
    sizes = f"would err by {percent(best.error, 2)} instead of {percent(given.error, 2)}"
    if moved:
        also = f", and the sign of {which}" if flipped else ""
        return (
            f"The torque columns seem to be exchanged: with {listing(moved, 6)} the unpruned model "
            f"{sizes}. Check which column is which joint's{also}."
        )
    if not flipped:
        return ""
    why = (
        "friction and rotor inertia come out negative, which no joint can have"
        if best is given
        else f"with the other one the unpruned model {sizes}"
    )
    return (
        f"The torque of {which} seems to have the wrong sign: {why}. Check the sign convention: "
        "torque is positive where it drives the joint towards larger positions."
    )
