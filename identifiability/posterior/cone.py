"""The exit of a straight path from the cone of pseudo-inertias, and the barrier of the cone.

A body that is inside at both ends of a stretch is inside in between. Only the others cost an
eigenvalue problem, a symmetric one of 4×4.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: A stretch is cut to its first third at most so often until a body is inside at its end.
CUTS = 60

#: A symmetric matrix from its ten entries ``y[..., TRIANGLE]``.
TRIANGLE = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])

#: The ten entries among the flattened sixteen.
UPPER = np.array([0, 1, 2, 3, 5, 6, 7, 10, 11, 15])


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

    def first_exit(self, y: Array, dy: Array, limit: Array) -> tuple[Array, np.ndarray, Array]:
        """Find the first exit of the paths ``y + t dy`` before ``limit (K,)``.

        Parameters
        ----------
        y, dy : (K, M)
            From points inside, or on the boundary.
        limit : (K,)

        Returns
        -------
        time : (K,)
            The exit, or `limit`.
        hit : (K,) bool
        inward : (K, M)
            Gradient of the boundary function that was hit, in y.
        """
        m, inward = self.rows, np.zeros_like(y)
        time, row = exit_through_rows(y[:, :m], dy[:, :m])
        hit = time < limit
        inward[hit, row[hit]] = 1.0
        time = np.minimum(time, limit)
        J, D = self._matrices(y), self._matrices(dy)
        chain, body, when, null = _crossings(J, D, time)
        if chain.size:
            first = np.lexsort((when, chain))
            first = first[np.unique(chain[first], return_index=True)[1]]
            k, columns = chain[first], m + 10 * body[first, None] + np.arange(10)
            time[k], hit[k], inward[k] = when[first], True, 0.0
            inward[k[:, None], columns] = _gradient(null[first])
        return time, hit, inward

    def barrier(self, eta: Array) -> tuple[float, Array, Array]:
        """Logarithmic barrier of the region, infinite outside.

        Parameters
        ----------
        eta : (p,)

        Returns
        -------
        value : float
        gradient : (p,)
        root : (r, p)
            ``rootᵀ root`` is the second derivative.
        """
        y, p, m = self.offset + self.map @ eta, len(eta), self.rows
        if not (self.contains(y[None])[0] and (y[:m] > 0).all()):
            return np.inf, np.zeros(p), np.zeros((0, p))
        rows, J = y[:m], self._matrices(y[None])[0]
        slopes = self.map[m:].reshape(-1, 10, p)[:, TRIANGLE]
        lower = np.linalg.inv(np.linalg.cholesky(J))
        turned = np.einsum("bij,bjkp,blk->bilp", lower, slopes, lower, optimize=True)
        value = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum() - np.log(rows).sum()
        scaled = self.map[:m] / rows[:, None]
        gradient = -scaled.sum(0) - np.einsum("biip->p", turned)
        return float(value), gradient, np.vstack([scaled, turned.reshape(-1, p)])

    def _matrices(self, y: Array) -> Array:
        matrices: Array = y[:, self.rows :].reshape(len(y), -1, 10)[..., TRIANGLE]
        return matrices


def exit_through_rows(y: Array, dy: Array) -> tuple[Array, np.ndarray]:
    """First time at which a coordinate of ``y + t dy`` turns negative.

    One that rises is on its way in, so a path that starts on the boundary, just reflected, needs no
    special case.

    Parameters
    ----------
    y, dy : (K, m)

    Returns
    -------
    time : (K,)
        Infinite when no coordinate ever does.
    row : (K,) int
    """
    if y.shape[1] == 0:
        return np.full(len(y), np.inf), np.zeros(len(y), np.intp)
    times = np.divide(np.maximum(y, 0.0), -dy, out=np.full_like(y, np.inf), where=dy < 0)
    row = times.argmin(axis=1)
    return times[np.arange(len(row)), row], row


def _crossings(J: Array, D: Array, time: Array) -> tuple[np.ndarray, np.ndarray, Array, Array]:
    """Chains, bodies, times and null vectors of all exits before `time`.

    From a point R inside, ``R + s D = L (1 + s M) Lᵀ`` first turns singular at −1 over the smallest
    eigenvalue of M. A point at least a third of the way there makes that good to all digits, also
    where the path starts on the boundary.
    """
    chain, body = np.nonzero(~positive(J + time[:, None, None, None] * D))
    J, D, inner = J[chain, body], D[chain, body], time[chain]
    outside = np.arange(len(chain))
    for _ in range(CUTS):
        inner[outside] /= 3
        point = J[outside] + inner[outside, None, None] * D[outside]
        outside = outside[~positive(point)]
        if not outside.size:
            break
    # Only rounding makes a body leave at once; where it does, the end of the path is refused.
    found = np.delete(np.arange(len(chain)), outside)
    chain, body, D, inner = chain[found], body[found], D[found], inner[found]
    lower = np.linalg.inv(np.linalg.cholesky(J[found] + inner[:, None, None] * D))
    value, vectors = np.linalg.eigh(lower @ D @ lower.transpose(0, 2, 1))
    return chain, body, inner - 1 / value[:, 0], np.einsum("kji,kj->ki", lower, vectors[:, :, 0])


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
