"""What the semidefinite programs share: multipliers, and what to do where there is no answer."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array

ADVICE = (
    "state the true mass and inertia of every body in the robot file (<inertial>), the scale in "
    "which bodies are measured"
)


def adjoint(maps: Array, Z: Array) -> Array:
    """Force (p,) of multipliers (nb, 16) on the parameters."""
    force: Array = np.einsum("kep,ke->p", maps, Z)
    return force


def adjoint_inverse(maps: Array, force: Array) -> Array:
    """Multipliers (nb, 16) that give a force (p,): ten numbers a body are one symmetric matrix."""
    inverse: Array = np.linalg.pinv(maps.transpose(0, 2, 1)) @ force
    return inverse


def semidefinite(Z: Array) -> Array:
    """Nearest positive semidefinite multipliers (nb, 16)."""
    values, vectors = np.linalg.eigh(Z.reshape(-1, 4, 4))
    positive: Array = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return positive.reshape(-1, 16)


def most_gain(e: Array, F: Array, reach: float) -> float:
    """Bound of eᵀd − ‖F d‖² over ‖d‖ ≤ reach, direction by direction."""
    _, s, Vt = np.linalg.svd(F)
    force = np.abs(Vt @ e)
    d = np.minimum(force / (2 * s**2), reach)
    return float(np.sum(force * d - (s * d) ** 2))
