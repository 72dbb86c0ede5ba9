"""Spans of columns: bases, what columns add to them, what they leave."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array


def unit_columns(A: Array) -> Array:
    """Return columns of length one; those of length zero as they are."""
    length = np.linalg.norm(A, axis=0)
    unit: Array = A / np.where(length > 0, length, 1.0)
    return unit


def orthonormal(X: Array) -> Array:
    """Return an orthonormal basis of the columns of X (R, b)."""
    length = np.linalg.norm(X, axis=0)
    unit = X[:, length > 0] / length[length > 0]
    U, s, _ = np.linalg.svd(unit, full_matrices=False)
    basis: Array = U[:, s > 1e-8 * s.max(initial=0.0)]
    return basis


def directions(A: Array, least: float) -> Array:
    """Return an orthonormal basis (R, ·) of where columns A (R, k) are longer than `least`."""
    if A.shape[1] == 1:  # as of most candidates, of which there are hundreds
        length = float(np.linalg.norm(A))
        return A / length if length > least else A[:, :0]
    vectors, s, _ = np.linalg.svd(A, full_matrices=False)
    basis: Array = vectors[:, s > least]
    return basis


def singular_values(A: Array) -> Array:
    """Return the singular values of A, the largest first."""
    if 1 in A.shape:
        return np.atleast_1d(np.linalg.norm(A))
    values: Array = np.linalg.svd(A, compute_uv=False)
    return values


def project_out(Q: Array, A: Array) -> Array:
    """Return A less its part in the span of Q."""
    left: Array = A - Q @ (Q.T @ A)
    return left
