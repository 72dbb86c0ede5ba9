"""The exit of a circular trajectory from the cone of pseudo-inertias.

Along ``J(t) = M + A sin t + B cos t`` the first t with det J = 0 is a quadratic eigenvalue problem
in ``u = tan(t/2)``: ``u² (M − B) + 2u A + (M + B)``. A path that was just reflected starts with a
singular J, and a problem solved around u = 0 would lose half its digits; around a point before the
start, u = −U, it is an ordinary 8×8 eigenvalue problem with roots good to 1e-12.

Most bodies do not leave in a short stretch, and that is cheap to prove: the Bernstein coefficients
of the quadratic on [0, U] are positive definite. Only the others cost an eigenvalue problem.
"""

from typing import NamedTuple

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Roots up to here are the reflection that the path comes from.
START = 1e-10

#: A stretch is cut to its first third, at most so often, while a body is outside at its end: then
#: few bodies need eigenvalues.
CUTS = 5

#: A symmetric matrix from its ten entries ``y[..., TRIANGLE]``.
TRIANGLE = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])

#: The ten entries among the flattened sixteen.
UPPER = np.array([0, 1, 2, 3, 5, 6, 7, 10, 11, 15])


class Circles(NamedTuple):
    """Trajectories ``y(t) = centre + sine sin t + cosine cos t`` of K chains, (K, M) each."""

    centre: Array
    sine: Array
    cosine: Array


@frozen
class Cone:
    """Coordinates eta (p,) in a convex region, by linear coordinates ``y = offset + map @ eta``.

    They are m rows ``y ≥ 0`` followed by ten entries of each matrix that must be positive definite.

    Attributes
    ----------
    map : (m + 10 nb, p)
    offset : (m + 10 nb,)
    rows : int
        ``m``
    """

    map: Array
    offset: Array
    rows: int

    def contains(self, y: Array) -> np.ndarray:
        """Whether points (K, M) are inside, (K,) bool."""
        inside = (y[:, : self.rows] >= 0).all(axis=1)
        return np.asarray(inside & positive(self._matrices(y)).all(axis=1))

    def first_exit(self, path: Circles, limit: Array) -> tuple[Array, np.ndarray, Array]:
        """Find the first exit before ``limit (K,)``.

        Returns
        -------
        time : (K,)
            Exit time, or a time not after `limit` up to which the path is inside.
        hit : (K,) bool
        inward : (K, M)
            Gradient of the boundary function that was hit, in y.
        """
        m = self.rows
        time, row = exit_through_rows(Circles(*(y[:, :m] for y in path)))
        inward = np.zeros_like(path.centre)
        hit = time < limit
        inward[hit, row[hit]] = 1.0
        time = np.minimum(time, limit)
        M, A, B = (self._matrices(y) for y in path)
        limit = _bracket(M, A, B, time)
        hit, time = hit & (time <= limit), np.minimum(time, limit)
        chain, body, when = _crossings(M, A, B, time)
        if chain.size:
            first = np.unique(chain, return_index=True)[1]  # sorted by chain, then time
            chain, body, when = chain[first], body[first], when[first]
            null, leaves = _boundary(M[chain, body], A[chain, body], B[chain, body], when)
            time[chain], hit[chain], inward[chain] = when, leaves, 0.0
            columns = m + 10 * body[:, None] + np.arange(10)
            inward[chain[:, None], columns] = _gradient(null)
        return time, hit, inward

    def _matrices(self, y: Array) -> Array:
        matrices: Array = y[:, self.rows :].reshape(len(y), -1, 10)[..., TRIANGLE]
        return matrices


def exit_through_rows(path: Circles) -> tuple[Array, np.ndarray]:
    """First time at which a coordinate turns negative.

    ``c + r cos(t − φ)`` falls through zero once a turn, at ``φ + arccos(−c/r)``; the rise is not an
    exit, so a path that starts on the boundary, just reflected, needs no special case.

    Parameters
    ----------
    path : Circles

    Returns
    -------
    time : (K,)
        Infinite when no coordinate ever does.
    row : (K,) int
    """
    radius = np.hypot(path.sine, path.cosine)
    reaches = radius > np.abs(path.centre)
    ratio = np.divide(-path.centre, radius, out=np.zeros_like(radius), where=reaches)
    turn = (np.arctan2(path.sine, path.cosine) + np.arccos(ratio)) % (2 * np.pi)
    times = np.where(reaches, turn, np.inf)
    if times.shape[1] == 0:
        return np.full(len(times), np.inf), np.zeros(len(times), np.intp)
    row = times.argmin(axis=1)
    return times[np.arange(len(row)), row], row


def _bracket(M: Array, A: Array, B: Array, limit: Array) -> Array:
    """Shorter stretches (K,) that still hold the first exit of every chain, if it has one."""
    upper, k = limit.copy(), np.arange(len(limit))
    for _ in range(CUTS):
        third = (upper[k] / 3)[:, None, None, None]
        inside = positive(M[k] + A[k] * np.sin(third) + B[k] * np.cos(third)).all(axis=1)
        k = k[~inside]
        if not k.size:
            break
        upper[k] /= 3
    return upper


def _crossings(M: Array, A: Array, B: Array, limit: Array) -> tuple[np.ndarray, np.ndarray, Array]:
    """Chains, bodies and times of all crossings before the limit, sorted by chain and time."""
    U = np.tan(limit / 2)[:, None, None, None]
    start = M + B
    middle = start + U * A
    end = middle + U * (A + U * (M - B))
    chain, body = np.nonzero(~(positive(middle) & positive(end)))
    u = _first_root(start[chain, body], A[chain, body], (M - B)[chain, body], U[chain, 0])
    found = u < np.tan(limit / 2)[chain]
    chain, body, u = chain[found], body[found], u[found]
    order = np.lexsort((u, chain))
    return chain[order], body[order], 2 * np.arctan(u[order])


def _first_root(C0: Array, C1: Array, C2: Array, U: Array) -> Array:
    """Smallest positive u at which ``C0 + 2u C1 + u² C2`` is singular, infinite if none.

    With ``u = 1/v − U`` the matrix of v² is the pencil at −U.
    """
    if not len(C0):
        return np.zeros(0)
    middle = C1 - U * C2
    before = C0 - U * (C1 + middle)
    companion = np.zeros((len(C0), 8, 8))
    companion[:, :4] = -np.linalg.solve(before, np.concatenate([2 * middle, C2], axis=2))
    companion[:, 4:, :4] = np.eye(4)
    v = np.linalg.eigvals(companion)
    real = (v.imag == 0) & (v.real > 0)  # LAPACK returns real eigenvalues exactly real
    u = np.divide(1.0, v.real, out=np.full(v.shape, np.inf), where=real) - U[:, 0]
    return np.asarray(np.where(u > START, u, np.inf).min(axis=1))


def _boundary(M: Array, A: Array, B: Array, t: Array) -> tuple[Array, np.ndarray]:
    """Null vector at the boundary, and whether the path leaves there."""
    sin, cos = np.sin(t)[:, None, None], np.cos(t)[:, None, None]
    null = np.linalg.eigh(M + A * sin + B * cos)[1][:, :, 0]
    rate = np.einsum("ki,kij,kj->k", null, A * cos - B * sin, null)
    return null, rate < 0


def _gradient(null: Array) -> Array:
    outer = null[:, :, None] * null[:, None, :]
    gradient: Array = outer.reshape(-1, 16)[:, UPPER] * np.where(UPPER % 5 == 0, 1.0, 2.0)
    return gradient


def positive(J: Array) -> np.ndarray:
    """Whether symmetric matrices are positive definite, by their pivots.

    Parameters
    ----------
    J : (..., n, n)

    Returns
    -------
    (...) bool
    """
    rest = J
    pivot = rest[..., 0, 0]
    good: np.ndarray = pivot > 0
    for _ in range(J.shape[-1] - 1):
        column = rest[..., 1:, 0]
        safe = np.where(good, pivot, 1.0)[..., None]
        rest = rest[..., 1:, 1:] - (column / safe)[..., :, None] * column[..., None, :]
        pivot = rest[..., 0, 0]
        good = good & (pivot > 0)
    return good
