"""What a model leaves out, holds or ties, as a projection knows it.

Base parameters are ``G phi``, and the model says that they are ``value + M x``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from identifiability.foundation.linalg import SPAN_TOLERANCE
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet


@frozen
class Held:
    """Independent combinations of parameters with their values; of no inertial parameter.

    Attributes
    ----------
    rows : (k, p)
    value : (k,)
    """

    rows: Array
    value: Array

    @staticmethod
    def none(size: int) -> Held:
        """Return the absence of held combinations of so many parameters."""
        return Held(np.zeros((0, size)), np.zeros(0))

    @cached_property
    def alone(self) -> np.ndarray:
        """Which combinations are of one parameter, (k,) bool."""
        mask: np.ndarray = np.count_nonzero(self.rows, axis=1) == 1
        return mask

    @property
    def fixed(self) -> np.ndarray:
        """The parameters that are held by themselves, (p,) bool."""
        mask: np.ndarray = (self.rows[self.alone] != 0).any(axis=0)
        return mask

    def settle(self, phi: Array) -> Array:
        """Return parameters (..., p), those that are held by themselves at exactly their values."""
        out, rows = np.array(phi), self.rows[self.alone]
        at = np.argmax(rows != 0, axis=1)
        out[..., at] = self.value[self.alone] / rows[np.arange(len(at)), at]
        return out

    def scaled(self, scale: Array) -> Plane:
        """Return what is left to scaled parameters ``phi = scale * x``."""
        rows = self.rows * scale
        Q, R = np.linalg.qr(rows.T, mode="complete")
        k = len(rows)
        return Plane(Q[:, :k], Q[:, k:], np.linalg.solve(R[:k].T, self.value))


@frozen
class Plane:
    """Scaled parameters x with ``normalᵀ x = value``.

    Attributes
    ----------
    normal : (p, k)
        Orthonormal.
    along : (p, p − k)
        Orthonormal directions in the plane.
    value : (k,)
    """

    normal: Array
    along: Array
    value: Array

    def project(self, x: Array) -> Array:
        """Return the nearest point of the plane, (p,)."""
        nearest: Array = x - self.normal @ (self.normal.T @ x - self.value)
        return nearest

    def turn(self, slope: Array) -> Array:
        """Return the part of a gradient (p,) that lies in the plane."""
        part: Array = slope - self.normal @ (self.normal.T @ slope)
        return part

    def solve(self, factor: Array, target: Array) -> Array:
        """Return the x of the plane with the least ``‖factor x − target‖``, (p,)."""
        if not len(self.value):
            return np.asarray(np.linalg.solve(factor, target), float)
        start = self.normal @ self.value
        step = np.linalg.lstsq(factor @ self.along, target - factor @ start, rcond=None)[0]
        return self.project(start + self.along @ step)


def find_held(region: PhysicalSet, G: Array, M: Array, value: Array) -> Held:
    """Return what a model leaves out, holds or ties outside the bodies.

    Parameters
    ----------
    region : PhysicalSet
        Of the p standard parameters.
    G : (b, p)
    M : (b, m)
    value : (b,)

    Raises
    ------
    ValueError
        If it holds what no real robot has: a sum of friction levels below zero, for one.
    """
    outside = ~np.any(G[:, np.unique(region.bodies)] != 0, axis=1)
    alone = outside & ~M.any(axis=1)
    tied = outside & ~alone
    _, s, Vt = np.linalg.svd(M[tied].T)
    apart = Vt[int((s > SPAN_TOLERANCE * s.max(initial=0.0)).sum()) :]
    found: dict[bytes, tuple[Array, float]] = {}
    for row, at in zip(
        [*G[alone], *apart @ G[tied]], [*value[alone], *apart @ value[tied]], strict=True
    ):
        members = np.flatnonzero(row)
        signed = bool((row[members] > 0).all() and region.nonnegative[members].all())
        if signed and at < 0:
            raise ValueError(
                f"the model holds {region.columns[members[0]]} at {at:g}, and no real robot has "
                "it below zero."
            )
        # A sum of what cannot be negative is zero only if every one is.
        parts = np.eye(len(row))[members] if signed and at == 0 else row[None]
        found |= {part.tobytes(): (part, float(at)) for part in parts}
    rows = np.array([row for row, _ in found.values()]).reshape(-1, region.size)
    return Held(rows, np.array([at for _, at in found.values()]))


def left_out(R: Array, G: Array, M: Array, value: Array) -> tuple[Array, Array]:
    """Return the torque of what a model leaves out, ``rows phi − aim``: (b, p) and (b,).

    Parameters
    ----------
    R : (b, b)
        Weighted torque of the base parameters, compressed.
    G : (b, p)
    M : (b, m)
    value : (b,)
    """
    rest = R @ (np.eye(len(G)) - M @ np.linalg.pinv(M)) if M.size else R
    return rest @ G, rest @ value
