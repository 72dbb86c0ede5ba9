"""What the semidefinite programs share: cones, multipliers, one call of the solver."""

from __future__ import annotations

import warnings
from typing import Any

import cvxpy
import numpy as np

from identifiability.foundation.names import Array

#: CVXPY without its types, which know only some of its operators.
cp: Any = cvxpy

ADVICE = (
    "state the true mass and inertia of every body in the robot file (<inertial>), the scale in "
    "which bodies are measured"
)


def above(map_: Array, x: Any, level: Any) -> Any:
    """Require that the 4×4 matrix ``map_ @ x``, of a map (16, p), has no eigenvalue below a level.

    One reshape of one product compiles five times faster than a sum of ten terms.
    """
    return cp.reshape(map_ @ x, (4, 4), order="C") - level * np.eye(4) >> 0


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


def solve_program(problem: Any) -> str:
    """Solve with Clarabel and return its status; whether that is good enough is the caller's.

    Raises
    ------
    ValueError
        When the solver fails.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Solution may be inaccurate")
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.SolverError as error:
            raise ValueError(
                f"physical set: the solver failed ({error}); expected a solution; {ADVICE}."
            ) from error
    return str(problem.status)
