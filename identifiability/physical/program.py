"""What the semidefinite programs share: scaled columns, cones and rows, one call of the solver."""

from __future__ import annotations

import warnings
from typing import Any, cast

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.pseudo_inertia import BOUNDARY

Floats = NDArray[np.float64]

ADVICE = "give masses and lengths of the bodies (PhysicalSet.mass, .length) as scale"


def body_columns(region: PhysicalSet) -> NDArray[np.bool_]:
    """Columns (p,) that belong to bodies."""
    inertial = np.zeros(region.size, bool)
    inertial[region.bodies] = True
    return inertial


def body_scale(region: PhysicalSet) -> Floats:
    """Size (p,) of the inertial parameters of bodies of the set's mass and length; 1 elsewhere."""
    scale = np.ones(region.size)
    kind = np.array([2] * 6 + [1] * 3 + [0])
    scale[region.bodies] = region.mass[:, None] * region.length[:, None] ** kind
    return scale


def scaled_cones(region: PhysicalSet) -> Floats:
    """Maps (nb, 16, p) from scaled parameters to dimensionless pseudo-inertias."""
    maps: Floats = region.cone_map * body_scale(region)
    return maps


def scaled_rows(region: PhysicalSet) -> tuple[Floats, Floats]:
    """Rows ``A (m, p)``, ``c (m,)`` on scaled parameters, each of unit length.

    The scale of a column outside the bodies drops out: only its sign is bounded.
    """
    A, c, _ = region.rows
    scaled = A * body_scale(region)
    length = np.linalg.norm(scaled, axis=1)
    return scaled / length[:, None], c / length


def above(J: Any, level: Any) -> cp.Constraint:
    """Require ``J ⪰ level``: no eigenvalue below."""
    return cast("cp.Constraint", J - level * np.eye(4) >> 0)


def at_least(values: Any, level: Any) -> cp.Constraint:
    """Require ``values ≥ level``, entry by entry."""
    return cast("cp.Constraint", values >= level)


def matrix(map_: Floats, x: Any) -> Any:
    """4×4 expression of a map (16, p).

    One reshape of one product compiles five times faster than a sum of ten terms.
    """
    atoms: Any = cp
    return atoms.reshape(map_ @ x, (4, 4), order="C")


def adjoint(maps: Floats, Z: Floats) -> Floats:
    """Force (p,) of multipliers (nb, 16) on the parameters."""
    force: Floats = np.einsum("kep,ke->p", maps, Z)
    return force


def adjoint_inverse(maps: Floats, force: Floats) -> Floats:
    """Multipliers (nb, 16) that give a force (p,): ten numbers a body are one symmetric matrix."""
    inverse: Floats = np.linalg.pinv(maps.transpose(0, 2, 1)) @ force
    return inverse


def semidefinite(Z: Floats) -> Floats:
    """Nearest positive semidefinite multipliers (nb, 16)."""
    values, vectors = np.linalg.eigh(Z.reshape(-1, 4, 4))
    positive: Floats = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return positive.reshape(-1, 16)


def most_gain(e: Floats, F: Floats, reach: float) -> float:
    """Bound of eᵀd − ‖F d‖² over ‖d‖ ≤ reach, direction by direction."""
    _, s, Vt = np.linalg.svd(F)
    force = np.abs(Vt @ e)
    d = np.minimum(force / (2 * s**2), reach)
    return float(np.sum(force * d - (s * d) ** 2))


def solve_program(problem: cp.Problem) -> str:
    """Solve with Clarabel and return its status; whether that is good enough is the caller's.

    Raises
    ------
    ValueError
        When the solver fails.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Solution may be inaccurate")
        try:
            cast("Any", problem).solve(solver=cp.CLARABEL)
        except cp.SolverError as error:
            raise ValueError(
                f"physical set: the solver failed ({error}); expected a solution; {ADVICE}."
            ) from error
    return str(problem.status)


def check_room(region: PhysicalSet, margin: float) -> None:
    """Refuse bounds that leave no room for a body; no constraint touches two bodies.

    Raises
    ------
    ValueError
        The body is named.
    """
    A, c = scaled_rows(region)
    for k, (name, columns) in enumerate(zip(region.names, region.bodies, strict=True)):
        own = np.flatnonzero((A[:, columns] != 0).any(axis=1))
        if not own.size:
            continue
        x, t = cp.Variable(region.size), cp.Variable()
        body = above(matrix(scaled_cones(region)[k], x), t)
        status = solve_program(
            cp.Problem(
                cp.Maximize(t), [body, at_least(A[own] @ x, c[own]), t <= max(1.0, 2 * margin)]
            )
        )
        if t.value is None or t.value < max(margin, BOUNDARY):
            given = "; ".join(dict.fromkeys(region.rows[2][i] for i in own))
            raise ValueError(
                f"{name}: no body satisfies its bounds together ({given}; {status}); expected "
                "bounds that leave room for a real body; widen or remove one of them."
            )
