"""What the semidefinite programs share: how cvxpy states and solves them, and their multipliers.

cvxpy is imported where a program is stated: half a second that most fits need not spend.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import scipy.sparse

from identifiability.foundation.names import Array

ADVICE = (
    "state the true mass and inertia of every body in the robot file (<inertial>), the scale in "
    "which bodies are measured"
)


def above(map_: Array, x: Any, level: Any) -> Any:
    """Require that the 4×4 matrix ``map_ @ x``, of a map (16, p), has no eigenvalue below a level.

    One reshape of one product compiles five times faster than a sum of ten terms.
    """
    return square(map_, x) - level * np.eye(4) >> 0


def square(map_: Array, x: Any) -> Any:
    """Return the 4×4 matrix ``map_ @ x`` of a map (16, p) as cvxpy knows it."""
    import cvxpy as cp  # noqa: PLC0415

    return cp.reshape(map_ @ x, (4, 4), order="C")


class Program:
    """A convex program, compiled once for Clarabel and solved for as many data as there are.

    Data are changed in what was compiled. As parameters of cvxpy p columns would be kept as p²
    sparse matrices (11 GB for 24 joints).

    Parameters
    ----------
    minimise : cvxpy expression
    constraints : list of cvxpy constraints
    step : cvxpy.Variable, (p,), optional
        If data are to change: the first constraint is an equality whose coefficients of the step
        are all one, and what is minimised needs no constraints of its own.
    """

    def __init__(self, minimise: Any, constraints: list[Any], step: Any = None) -> None:
        import cvxpy as cp  # noqa: PLC0415

        self._problem, self._step = cp.Problem(cp.Minimize(minimise), constraints), step
        self._compiled = self._problem.get_problem_data(cp.CLARABEL, solver_opts={})

    def solve(self, rows: Array | None = None, start: Array | None = None) -> str:
        """Solve and return the status; cvxpy keeps values and multipliers where they were stated.

        Parameters
        ----------
        rows : (r, p), optional
            Coefficients of the step in the first constraint, instead of ones.
        start : (p,), optional
            Of the step, in all other constraints, instead of zero.

        Raises
        ------
        ValueError
            When the solver ends without an answer; with its word for that.
        """
        import cvxpy as cp  # noqa: PLC0415

        data, chain, inverse = self._compiled
        if rows is not None and start is not None:
            A, b = data["A"].toarray(), data["b"].copy()
            first = data["param_prob"].var_id_to_col[self._step.id]
            own = A[:, first : first + self._step.size]
            b[len(rows) :] -= own[len(rows) :] @ start
            own[: len(rows)] *= rows
            data = {**data, "A": scipy.sparse.csc_array(A), "b": b}
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Solution may be inaccurate")
            try:
                self._problem.unpack_results(
                    chain.solve_via_data(self._problem, data), chain, inverse
                )
            except cp.SolverError as error:
                raise ValueError(str(error)) from error
        status = str(self._problem.status)
        if status not in cp.settings.SOLUTION_PRESENT:
            raise ValueError(status)
        return status


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
