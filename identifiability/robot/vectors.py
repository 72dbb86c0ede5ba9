"""Vectors and turns of many samples at once, samples last."""

from __future__ import annotations

import numpy as np
import scipy

from identifiability.foundation.names import Array


def cross(a: Array, b: Array) -> Array:
    """Return ``a × b`` of vectors (3, N) (numpy.cross is several times slower on batches)."""
    out = np.empty((3, max(a.shape[1], b.shape[1])))
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


def basis_along(axis: Array) -> Array:
    """Return a right-handed orthonormal basis whose third column is `axis`; exact for x, y, z."""
    axis = axis / np.linalg.norm(axis)
    first = np.zeros(3)
    # The coordinate after the largest is never along the axis.
    first[(int(np.argmax(np.abs(axis))) + 1) % 3] = 1.0
    first -= (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], 1)


def shortest_turn(start: Array, end: Array) -> Array:
    """Return the rotation vector (3,) of the shortest turn from one direction (3,) to another.

    Of opposite directions, which have no shortest one, it is about a level axis.
    """
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis, cosine = np.cross(start, end), float(start @ end)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        return np.zeros(3) if cosine > 0 else np.pi * basis_along(start)[:, 0]
    found: Array = axis * (np.arctan2(sine, cosine) / sine)
    return found


def turn(vector: Array, step: Array) -> Array:
    """Return a vector (3,) turned by a rotation vector (3,)."""
    out: Array = scipy.spatial.transform.Rotation.from_rotvec(step).apply(vector)
    return out


def combine(R: Array, parts: Array) -> Array:
    """Return the vector with some components along the axes of a frame, (3, N)."""
    whole: Array = R[0] * parts[0] + R[1] * parts[1] + R[2] * parts[2]
    return whole


def turned(quat: Array, step: Array) -> Array:
    """Return unit quaternions (x y z w) turned by rotation vectors in their own frame."""
    rotation = scipy.spatial.transform.Rotation
    out: Array = (rotation.from_quat(quat) * rotation.from_rotvec(step)).as_quat()
    return out
