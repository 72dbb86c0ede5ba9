"""Solve the loop equations of each sample for the dependent joints.

There may be more equations than dependent joints: a planar loop in space has one that follows from
the others, and an overconstrained linkage several. No fixed choice among them holds everywhere, so
every sample has its own: the orthonormal directions that its dependent joints span (a QR
factorisation). Its triangular factor has the singular values of all the equations together, so a
pose is as near to singular as the mechanism is there, whatever axes the equations are written in.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array

#: Two samples whose equations span directions that overlap less than this (a determinant of
#: cosines) are too far apart to say whether a singular pose lies between them.
OVERLAP = 0.5


def solve(A: Array, b: Array) -> Array:
    """Solve batched systems (N, m, r), m ≥ r, by least squares; a singular one gives NaN.

    Parameters
    ----------
    A, b : (N, m, r), (N, m)
    """
    if A.shape[1] > A.shape[2]:
        Q, A = np.linalg.qr(A)
        b = np.einsum("nmr,nm->nr", Q, b)
    try:
        return np.linalg.solve(A, b[..., None])[..., 0]
    except np.linalg.LinAlgError:
        out = np.full(b.shape, np.nan)
        for k in range(len(A)):
            try:
                out[k] = np.linalg.solve(A[k], b[k])
            except np.linalg.LinAlgError:
                continue
        return out


def invert(A: Array) -> tuple[Array, Array]:
    """Return inverses and condition numbers of batched matrices, infinite for singular ones.

    Parameters
    ----------
    A : (N, m, r), m ≥ r
        With more rows than columns the inverses are least-squares ones (Moore-Penrose).

    Returns
    -------
    inverse : (N, r, m)
    condition : (N,)
    """
    if A.shape[1] > A.shape[2]:
        Q, R = np.linalg.qr(A)
        inverse, condition = invert(R)
        return inverse @ Q.swapaxes(1, 2), condition
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:
        singular = np.array([np.linalg.matrix_rank(a) < len(a) for a in A])
        inverse = np.linalg.inv(np.where(singular[:, None, None], np.eye(A.shape[1]), A))
    else:
        singular = np.zeros(len(A), bool)
    condition = np.abs(A).sum(1).max(1) * np.abs(inverse).sum(1).max(1)
    return inverse, np.where(singular, np.inf, condition)


def passes_singular(A: Array) -> np.ndarray:
    """Return whether a singular matrix lies between each one and the next, (N - 1,) bool.

    The determinant changes its sign there. Of matrices with more rows than columns it is taken in
    the directions that their columns span, which must hardly turn from one to the next.

    Parameters
    ----------
    A : (N, m, r), m ≥ r
        Along a motion.
    """
    passed: np.ndarray
    if A.shape[1] == A.shape[2]:
        sign = np.linalg.slogdet(A)[0]
        passed = sign[1:] != sign[:-1]
        return passed
    Q, R = np.linalg.qr(A)
    overlap = np.linalg.det(Q[:-1].swapaxes(1, 2) @ Q[1:])
    sign = np.sign(np.diagonal(R, axis1=1, axis2=2)).prod(1)
    passed = np.sign(overlap) * sign[1:] != sign[:-1]
    passed &= np.abs(overlap) > OVERLAP
    return passed
