"""The set of parameter vectors that a real robot can have.

Bodies are pseudo-inertias that are positive definite; what is known of masses and centres of mass
are rows beside them.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
from identifiability.physical.pseudo_inertia import (
    BASIS,
    BodyCheck,
    check_body,
    entry_scale,
    scale_matrix,
)
from identifiability.regression.structure import Structure

# What is known of masses and centres of mass: rows beside the cones of real bodies.
#
# The mass ``m`` and the first moment ``h = m c`` are parameters, so that a bound of the mass and a
# box around the centre are linear.


_MASS, _FIRST = GROUPED_KINDS.index("m"), [GROUPED_KINDS.index(kind) for kind in ("mx", "my", "mz")]


@frozen
class Bounds:
    """Rows ``rows @ phi ≥ least`` of p parameters, in units of the width between two bounds.

    Attributes
    ----------
    rows : (k, p)
    least : (k,)
    labels : (k,) str
    """

    rows: Array
    least: Array
    labels: tuple[str, ...]

    @staticmethod
    def none(size: int) -> Bounds:
        """Return the absence of bounds of so many parameters."""
        return Bounds(np.zeros((0, size)), np.zeros(0), ())

    def widen(self, size: int) -> Bounds:
        """Return the bounds of these parameters where others follow them, `size` in all."""
        rows = np.zeros((len(self.rows), size))
        rows[:, : self.rows.shape[1]] = self.rows
        return Bounds(rows, self.least, self.labels)


def stated_bounds(structure: Structure, mass: Array) -> Bounds:
    """Return what the sidecar of a robot says of masses and centres, over a model's parameters.

    A payload is no part of its body here. Bodies that the model has not are passed over.

    Parameters
    ----------
    structure : Structure
    mass : (nb,) [kg]
        Scale of each body of the structure.
    """
    p = len(structure.columns)
    stems = [*structure.bodies]
    at = {body: stems.index(f"{body}.") for body in structure.robot.bodies if f"{body}." in stems}
    rows: list[tuple[Array, float, str]] = []
    for bound in structure.robot.bounds:
        members = [at[body] for body in bound.bodies if body in at]
        if not members:
            continue
        m = np.zeros(p)
        m[structure.inertial[members, _MASS]] = 1.0
        title = "total mass" if len(bound.bodies) > 1 else f"mass of {bound.bodies[0]}"
        if bound.mass is not None:
            rows += _between(m, 0.0 * m, bound.mass, 1.0, title, "kg")
        first = np.zeros((3, p))
        first[:, structure.inertial[members[0]][_FIRST]] = bound.rotation.T
        moment = first - np.outer(bound.rotation.T @ bound.origin, m)  # about the body's frame
        for k, span in enumerate(bound.box or ()):
            title = f"{'xyz'[k]} of the centre of {bound.bodies[0]}"
            rows += _between(moment[k], m, span, float(mass[members[0]]), title, "m")
    return Bounds(
        np.array([row for row, _, _ in rows]).reshape(-1, p),
        np.array([least for _, least, _ in rows]),
        tuple(label for _, _, label in rows),
    )


def _between(
    value: Array, weight: Array, span: tuple[float, float], size: float, title: str, unit: str
) -> Iterator[tuple[Array, float, str]]:
    """Yield the rows of ``low ≤ value ≤ high``, times a weight where there is one."""
    low, high = span
    width = (high - low) * size
    constant = not weight.any()
    for sign, end, relation in ((1.0, low, "≥"), (-1.0, high, "≤")):
        row = sign * (value - end * weight) / width
        yield row, sign * end / width if constant else 0.0, f"{title} {relation} {end:g} {unit}"


# The set of parameter vectors that a real robot can have.
#
# Every body has a positive semidefinite pseudo-inertia, friction and actuator inertia are not
# negative, and masses and centres of mass are where the user says: linear matrix inequalities and
# rows, one convex set, shared by the projection and by the posterior.


@frozen
class PhysicalSet:
    """Parameter vectors of a real robot.

    Scaled parameters are ``phi / scale``: programs are solved in them.

    Attributes
    ----------
    bodies : (nb, 10) int
        Column of each inertial parameter of each body, in the order of `names.GROUPED_KINDS`.
    nonnegative : (p,) bool
        Columns that may not be negative (friction, actuator inertia).
    names : (nb,) str
        Body names, for sentences.
    columns : (p,) str
        Parameter names, for sentences.
    mass, length : (nb,) [kg], [m]
        Scale in which margins are measured; take them from CAD or leave 1 kg and 0.1 m.
    bounds : Bounds, optional
        What is known of masses and centres of mass; of the first parameters where it is of fewer.
    functions : tuple of (k,) int
        Columns of each function that was learned: one unit of each is as much torque.
    """

    bodies: np.ndarray
    nonnegative: np.ndarray
    names: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    mass: Array = field(default_factory=lambda: np.ones(1))
    length: Array = field(default_factory=lambda: np.full(1, 0.1))
    bounds: Bounds | None = None
    functions: tuple[np.ndarray, ...] = ()

    def __post_init__(self) -> None:
        nb = len(self.bodies)
        if nb and (self.bodies.min() < 0 or self.bodies.max() >= self.size):
            raise ValueError(
                f"physical set: body columns {self.bodies.min()} … {self.bodies.max()} were given "
                f"for {self.size} parameters; expected indices into the parameter vector."
            )
        completed = {
            "mass": np.broadcast_to(self.mass, nb),
            "length": np.broadcast_to(self.length, nb),
            "names": self.names or tuple(f"body {k + 1}" for k in range(nb)),
            "columns": self.columns or tuple(f"parameter {j}" for j in range(self.size)),
            "bounds": (self.bounds or Bounds.none(self.size)).widen(self.size),
        }
        for name, value in completed.items():
            object.__setattr__(self, name, value)

    @property
    def size(self) -> int:
        """Number of parameters p."""
        return self.nonnegative.size

    @cached_property
    def inertial(self) -> np.ndarray:
        """Whether a column belongs to a body, (p,) bool."""
        inside = np.zeros(self.size, bool)
        inside[self.bodies] = True
        return inside

    @cached_property
    def root(self) -> Array:
        """(nb, 4), the congruence by which each J becomes dimensionless."""
        return scale_matrix(self.mass, self.length)

    @cached_property
    def cone_map(self) -> Array:
        """(nb, 16, p): ``cone_map @ phi`` are the dimensionless pseudo-inertias, flattened."""
        scaled = BASIS / (self.root[:, None, :, None] * self.root[:, None, None, :])
        rows = np.zeros((len(self.bodies), 16, self.size))
        for k, columns in enumerate(self.bodies):
            rows[k][:, columns] = scaled[k].reshape(10, 16).T
        return rows

    @cached_property
    def scale(self) -> Array:
        """Size (p,) of the parameters of bodies of the set's mass and length; 1 elsewhere."""
        scale = np.ones(self.size)
        scale[self.bodies] = entry_scale(self.mass, self.length)
        return scale

    @cached_property
    def cones(self) -> Array:
        """(nb, 16, p), maps from scaled parameters to dimensionless pseudo-inertias."""
        maps: Array = self.cone_map * self.scale
        return maps

    @cached_property
    def signed(self) -> np.ndarray:
        """Columns (m,) int that may not be negative, whatever the bodies; J ⪰ 0 says the rest."""
        others = self.nonnegative.copy()
        others[self.bodies] = False  # J ⪰ 0 implies m ≥ 0 and Ixx ≥ 0
        return np.flatnonzero(others)

    @cached_property
    def rows(self) -> Array:
        """(m, p): ``rows @ phi ≥ least`` are the signs and then the bounds."""
        assert self.bounds is not None
        rows: Array = np.vstack([np.eye(self.size)[self.signed], self.bounds.rows])
        return rows

    @cached_property
    def scaled_rows(self) -> Array:
        """(m, p), the same of scaled parameters; a scale drops out of signs."""
        rows = self.rows.copy()
        rows[len(self.signed) :] *= self.scale
        return rows

    @cached_property
    def least(self) -> Array:
        """What the m rows may not fall below."""
        assert self.bounds is not None
        return np.concatenate([np.zeros(len(self.signed)), self.bounds.least])

    def least_with(self, margin: float) -> Array:
        """Return the same with a share of their width to spare for bounds; signs have none."""
        bounded = np.arange(len(self.least)) >= len(self.signed)
        return np.asarray(self.least + margin * bounded)

    @property
    def labels(self) -> tuple[str, ...]:
        """The m signs and bounds in words."""
        assert self.bounds is not None
        return (*(f"{self.columns[j]} ≥ 0" for j in self.signed), *self.bounds.labels)

    def within(self, phi: ArrayLike, tolerance: float = 1e-9) -> np.ndarray:
        """Whether bounds hold for parameter vectors (..., p): (..., k) bool."""
        bounded = slice(len(self.signed), None)
        slack = np.asarray(phi, float) @ self.rows[bounded].T - self.least[bounded]
        return np.asarray(slack >= -tolerance)

    def margins(self, phi: ArrayLike) -> Array:
        """Smallest dimensionless eigenvalue of every body.

        Parameters
        ----------
        phi : (..., p)

        Returns
        -------
        (..., nb)
        """
        theta = np.asarray(phi, float)[..., self.bodies]
        return pseudo_inertia.margin(theta, self.mass, self.length)

    def contains(self, phi: ArrayLike, tolerance: float = 1e-9) -> np.ndarray:
        """Whether parameter vectors belong to a real robot, up to rounding.

        Parameters
        ----------
        phi : (..., p)
        tolerance : float
            Allowed violation of bodies, dimensionless.

        Returns
        -------
        (...) bool
        """
        values = np.asarray(phi, float)
        inside = (values[..., self.signed] >= 0).all(axis=-1)
        inside = inside & self.within(values, tolerance).all(axis=-1)
        return np.asarray(inside & (self.margins(values) >= -tolerance).all(axis=-1))

    def check(self, phi: Array) -> tuple[BodyCheck, ...]:
        """Say of every body whether its parameters ``phi (p,)`` can be real."""
        pairs = zip(self.names, self.bodies, strict=True)
        return tuple(check_body(phi[columns], name) for name, columns in pairs)

    def violations(self, phi: Array) -> tuple[str, ...]:
        """Everything that keeps parameters ``phi (p,)`` out of the set, a sentence each."""
        bodies = (check.reason for check in self.check(phi) if not check.feasible)
        rows = (
            f"{label} does not hold: it is missed by {-slack:.3g}."
            for label, slack in zip(self.labels, phi[self.signed], strict=False)
            if slack < 0
        )
        known = self.labels[len(self.signed) :]
        bounds = (
            f"{label} does not hold."
            for label, satisfied in zip(known, self.within(phi), strict=True)
            if not satisfied
        )
        return (*bodies, *rows, *bounds)


# What the semidefinite programs share: how cvxpy states and solves them, and their multipliers.
#
# cvxpy is imported where a program is stated: half a second that most fits need not spend.


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


#: What Clarabel is asked with where it fails: by default it adds a hundred times that to each
#: pivot, and ends in its first step where refinement does not make up for it.
EXACTER = {"static_regularization_constant": 1e-10}


class Program:
    """A convex program, compiled once for Clarabel and solved for as many data as there are.

    Data are changed in what was compiled. As parameters of cvxpy p columns would be kept as p²
    sparse matrices (11 GB for 24 joints).

    Parameters
    ----------
    minimise : cvxpy expression
    constraints : list of cvxpy constraints
    step : cvxpy.Variable, (p,)
        The first constraint is an equality whose coefficients of the step are all one, and what is
        minimised needs no constraints of its own.
    """

    def __init__(self, minimise: Any, constraints: list[Any], step: Any) -> None:
        import cvxpy as cp  # noqa: PLC0415

        self._problem, self._step = cp.Problem(cp.Minimize(minimise), constraints), step
        self._compiled = self._problem.get_problem_data(cp.CLARABEL, solver_opts={})

    def solve(self, rows: Array, start: Array) -> str:
        """Solve and return the status; cvxpy keeps values and multipliers where they were stated.

        Parameters
        ----------
        rows : (r, p)
            Coefficients of the step in the first constraint, instead of ones.
        start : (p,)
            Of the step, in all other constraints, instead of zero.

        Raises
        ------
        ValueError
            When the solver ends without an answer; with its word for that.
        """
        import cvxpy as cp  # noqa: PLC0415

        data, chain, inverse = self._compiled
        A, b = data["A"].toarray(), data["b"].copy()
        first = data["param_prob"].var_id_to_col[self._step.id]
        own = A[:, first : first + self._step.size]
        b[len(rows) :] -= own[len(rows) :] @ start
        own[: len(rows)] *= rows
        data = {**data, "A": scipy.sparse.csc_array(A), "b": b}
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Solution may be inaccurate")
            for options in ({}, EXACTER):
                found = chain.solve_via_data(self._problem, data, solver_opts=options)
                try:
                    self._problem.unpack_results(found, chain, inverse)
                    break
                except cp.SolverError as error:
                    if options:
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
