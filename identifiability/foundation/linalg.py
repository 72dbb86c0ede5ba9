"""Small pieces of linear algebra that several stages share."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dgeqrf, dtbtrs

from .names import Array

#: Scaled singular values below this share of the largest are zero. Structural zeros are seen at
#: 1e-12 or less and the weakest true directions of the shipped robots at 5e-4.
RANK_TOLERANCE = 1e-8

#: Columns below this share of the others may come from five digits of a robot file.
ROUNDED = np.sqrt(RANK_TOLERANCE)

#: A unit column whose part outside the kept span is below this is dependent.
SPAN_TOLERANCE = 1e-7


#: Matrices beyond this size together are worked on in turn [bytes].
MOST_BYTES = 2**26

#: Relative size below which the remainder of one sum of products is rounding.
TINY = 1e-12

#: Relative size below which the remainder of a chain of products, differences and solves is
#: rounding.
ROUNDOFF = 1e-9

#: Data do not distinguish values that differ by less than this share: no measurement has six
#: digits.
NEARLY = 1e-6


def or_one(sizes: Array) -> Array:
    """Return sizes by which is divided: 1 for those that are zero."""
    return np.where(sizes > 0, sizes, 1.0)


def rms_of(x: Array, axis: int | None = None) -> Any:
    """Return the root mean square, of all values or along an axis."""
    return np.sqrt(np.mean(x**2, axis=axis))


def root_diagonal(A: Array) -> Array:
    """Return standard deviations of a covariance, or lengths of the columns behind AᵀA."""
    return np.sqrt(np.diag(A))


def solve_least(A: Array, target: Array, rcond: float | None = None) -> Array:
    """Return the shortest x of least squares, without directions below a relative size."""
    return np.linalg.lstsq(A, target, rcond)[0]


def few_at_once(count: int, nbytes: int) -> Iterator[slice]:
    """Yield slices of many matrices of `nbytes` bytes, to process within the limit of memory."""
    size = max(1, MOST_BYTES // max(nbytes, 1))
    yield from (slice(at, at + size) for at in range(0, count, size))


def triangular_factor(A: Array) -> Array:
    """Return R, upper triangular, with ``RᵀR = AᵀA``."""
    if not A.size:
        return A[: A.shape[1]]
    # For small matrices NumPy's function takes twice the time.
    return np.triu(dgeqrf(A)[0][: A.shape[1]])


def find_chains(acts: np.ndarray) -> list[np.ndarray]:
    """Return the columns of each chain: no row has columns of two chains.

    Parameters
    ----------
    acts : (m, k) bool
        Which columns act in each row.
    """
    count = acts.shape[1]
    chain = np.arange(count)
    joined = np.zeros(count, int)
    while (joined != chain).any():
        joined = chain
        first = np.where(acts, chain, count).min(1, initial=count)
        chain = np.minimum(chain, np.where(acts, first[:, None], count).min(0, initial=count))
    return [np.flatnonzero(chain == k) for k in np.unique(chain)]


def filter_from_rest(denominator: Array, x: Array) -> Array:
    """Return y with ``Σ a_k y_(t-k) = x_t``, zero before its first sample.

    The equations are a triangular system with few bands. `scipy.signal.lfilter` does the same,
    but its import takes .3 s.

    Parameters
    ----------
    denominator : (K + 1,)
        Coefficients a_0 … a_K with a_0 = 1.
    x : (N,) or (N, m)

    Returns
    -------
    As x.
    """
    bands = np.repeat(denominator[:, None], len(x), axis=1)
    y, _ = dtbtrs(bands, x.reshape(len(x), -1), uplo="L")
    return y.reshape(x.shape)


def scan_columns(unit: Array, order: Sequence[int]) -> list[int]:
    """Return the columns (of length one) that do not lie in the span of those kept before them.

    Gram-Schmidt that skips dependent columns; unpivoted QR would instead project every later
    column on the rounding noise that a dependent one leaves behind.
    """
    if len(order) <= len(unit):  # if no column is nearly dependent, one factor shows it
        ordered = unit[:, list(order)]
        # A factor of rows is triangular already, as long as every column acts.
        is_factor = not np.tril(ordered, -1).any()
        factor = ordered if is_factor else np.linalg.qr(ordered, mode="r")
        sizes = np.abs(np.diag(factor))
        # Above this multiple of it, rounding does not decide.
        if (sizes > 10.0 * SPAN_TOLERANCE).all():
            return list(order)
    kept: list[int] = []
    Q = np.empty((unit.shape[0], 0))
    for k in order:
        v = unit[:, k]
        for _ in range(2):  # twice is enough [Giraud 2005]
            v = v - Q @ (Q.T @ v)
        size = float(np.linalg.norm(v))
        if size > SPAN_TOLERANCE and len(kept) < unit.shape[0]:
            Q = np.hstack([Q, (v / size)[:, None]])
            kept.append(k)
    return kept


def solve_each(equations: Array) -> Array:
    """Return the solutions of equations (R, k, k + 1), (R, k); NaN without a solution."""
    try:
        matrices = equations[:, :, :-1]
        targets = equations[:, :, -1:]
        return np.linalg.solve(matrices, targets)[..., 0]
    except np.linalg.LinAlgError:
        out = np.full(equations.shape[:2], np.nan)
        for i, one in enumerate(equations):
            if np.linalg.matrix_rank(one[:, :-1]) == len(one):
                out[i] = np.linalg.solve(one[:, :-1], one[:, -1])
        return out


def sandwich(R: Array, F: Array) -> Array:
    """Return ``(RᵀR)⁻¹ FᵀF (RᵀR)⁻¹`` of a triangular R (k, k) and F (m, k), (k, k)."""
    half = solve_triangular(R, solve_triangular(R, F.T, trans="T")) if len(R) else R
    return half @ half.T


def unit_coordinates(R: Array) -> Array:
    """Return T, (k, k), with columns ``A T`` of length one and at right angles, ``AᵀA = RᵀR``."""
    return solve_triangular(R, np.eye(len(R))) if len(R) else R


def without_rounding(torque: Array, of: Array) -> Array:
    """Return torque (N, n) with zeros in columns of rounding errors, which scaling would amplify.

    Parameters
    ----------
    torque : (N, n) [N·m or N]
    of : (N, m) [N·m or N]
        Torque from which it is computed.
    """
    most = np.abs(torque).max(axis=0, initial=0.0)
    largest = np.abs(of).max(initial=0.0)
    return torque * (most > ROUNDOFF * largest)
