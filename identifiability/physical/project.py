"""The parameters of a real robot nearest to the data: a semidefinite program, and its evidence.

    minimise  ‖R phi − z‖²   over   J_k(phi) ⪰ margin (every body k),  A phi ≥ c,  H phi = h

What to use when: `project` for one estimate; `build_projection` when many data sets share one
robot, since the program is compiled once and each further `Projection.solve` takes milliseconds. A
`CadPrior` pulls what the data do not determine towards a nominal robot.

Two things keep the optimum right: R is factored, never squared, and the columns are scaled.
"""

from __future__ import annotations

from typing import Any

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import CadPrior, divergence, prior_gap
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import Held, Plane
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.program import (
    ADVICE,
    above,
    adjoint,
    adjoint_inverse,
    at_least,
    body_columns,
    body_scale,
    check_room,
    matrix,
    most_gain,
    scaled_cones,
    scaled_rows,
    semidefinite,
    solve_program,
)

Floats = NDArray[np.float64]

#: Smallest dimensionless eigenvalue of a body in the answer: simulators refuse singular inertia.
MARGIN = 1e-6

#: Pull [σ²] to the reference per squared column scale: it decides where the data say nothing.
RIDGE = 1e-8

#: Largest accepted distance to the optimum [σ²], relative to ``1 + excess``.
GAP = 1e-3

#: The same relative to ``‖z‖²``, for data with next to no noise.
ROUNDING = 1e-12


@frozen
class FeasibleEstimate:
    """The nearest parameters of a real robot.

    Attributes
    ----------
    phi : (p,)
    rss : float [torque²]
    excess : float
        What feasibility costs: rise of the residual sum of squares over least squares, in σ².
    margins : (nb,)
        Smallest dimensionless eigenvalue of every body.
    active_bodies, active_rows : tuple of str
        Constraints that hold the estimate back.
    status : str
        What the solver says; `gap` is what holds.
    gap : float
        Upper bound of the distance to the optimum [σ²], from gradient and multipliers.
    accurate : bool
        Whether the gap is negligible beside the excess; the answer is feasible either way.
    """

    phi: Floats
    rss: float
    excess: float
    margins: Floats
    active_bodies: tuple[str, ...]
    active_rows: tuple[str, ...]
    status: str
    gap: float
    accurate: bool


@frozen
class _Scaled:
    """A data set in scaled parameters: ``phi = scale * x``, cost ``‖factor x − target‖²`` in σ²."""

    scale: Floats
    factor: Floats
    target: Floats
    plane: Plane


@frozen
class Projection:
    """A compiled program: solve it for as many data sets as there are, one at a time.

    Attributes
    ----------
    region : PhysicalSet
    margin : float
    reference : (p,)
    prior : CadPrior or None
    held : Held
    """

    region: PhysicalSet
    margin: float
    reference: Floats
    prior: CadPrior | None
    held: Held
    _problem: cp.Problem
    _step: cp.Variable
    _factor: cp.Parameter
    _free: cp.Parameter
    _normal: cp.Parameter | None
    _rows: cp.Constraint

    def solve(self, data: LeastSquares) -> FeasibleEstimate:
        """Project one data set.

        Parameters
        ----------
        data : LeastSquares

        Raises
        ------
        ValueError
            When the data are of another model, or the solver finds no optimum.
        """
        if data.R.shape[1] != self.region.size:
            raise ValueError(
                f"projection: data on {data.R.shape[1]} parameters were given; expected the "
                f"{self.region.size} of the physical set; build both from the same model."
            )
        with threadpool_limits(1):
            scaled = self._scale(data)
            free = scaled.plane.solve(scaled.factor, scaled.target)
            if self.prior is None and self._holds(free):
                return self._read(data, scaled, free, np.zeros(self._rows.shape), "optimal")
            self._factor.value, self._free.value = scaled.factor[np.triu_indices(free.size)], free
            if self._normal is not None:
                self._normal.value = scaled.plane.normal.T
            status = solve_program(self._problem)
            if self._step.value is None or self._rows.dual_value is None:
                raise ValueError(
                    f"projection: the solver found no answer ({status}); expected one, since every "
                    f"body has room; {ADVICE}."
                )
            y = np.maximum(self._rows.dual_value, 0.0)
            x = scaled.plane.project(free + self._step.value)
            return self._read(data, scaled, x, y, status)

    def _scale(self, data: LeastSquares) -> _Scaled:
        norms = np.linalg.norm(data.R, axis=0)
        whole = np.linalg.norm(data.z)
        seen = (norms > 0) & (whole > 0)
        scale = np.where(seen, whole / np.where(seen, norms, 1.0), 1.0)
        scale = np.where(body_columns(self.region), body_scale(self.region), scale)
        pull = np.sqrt(RIDGE)
        stacked = np.vstack([data.R * scale / data.unit, pull * np.eye(scale.size)])
        Q, factor = np.linalg.qr(stacked)
        wanted = np.concatenate([data.z / data.unit, pull * self.reference / scale])
        return _Scaled(scale, factor, Q.T @ wanted, self.held.scaled(scale))

    def _holds(self, x: Floats) -> bool:
        A, c = scaled_rows(self.region)
        J = (scaled_cones(self.region) @ x).reshape(-1, 4, 4)
        return bool((A @ x >= c).all() and (np.linalg.eigvalsh(J)[:, 0] >= self.margin).all())

    def _read(
        self, data: LeastSquares, scaled: _Scaled, x: Floats, y: Floats, status: str
    ) -> FeasibleEstimate:
        region, phi = self.region, self.held.settle(x * scaled.scale)
        Z, gap = self._judge(scaled, x, y)
        excess = (float(data.rss(phi)) - data.rss_min) / data.unit**2
        allowed = GAP * (1 + excess) + ROUNDING * float(scaled.target @ scaled.target)
        A, c = scaled_rows(region)
        margins = region.margins(phi)
        # Complementarity: of slack and multiplier one is zero, and the larger one says which.
        pressed = np.linalg.norm(Z, axis=1) > margins - self.margin
        held = y > A @ x - c
        return FeasibleEstimate(
            phi, float(data.rss(phi)), excess, margins,
            tuple(str(n) for n, on in zip(region.names, pressed, strict=True) if on),
            tuple(str(n) for n, on in zip(region.rows[2], held, strict=True) if on),
            status, gap, bool(gap <= allowed),
        )  # fmt: skip

    def _judge(self, scaled: _Scaled, x: Floats, y: Floats) -> tuple[Floats, float]:
        """Multipliers (nb, 16) of the bodies, and the distance to the optimum by convexity.

        f(x) − f(x*) ≤ ⟨Z, J(x) − m⟩ + yᵀ(Ax − c) + eᵀd − ‖F d‖² for any Z ⪰ 0 and y ≥ 0, where e is
        what they leave of the gradient and d = x − x*, taken to be no longer than 2‖x‖. The
        solver's claim is not used: Z is the semidefinite part of the gradient itself.
        """
        (A, c), cones = scaled_rows(self.region), scaled_cones(self.region)
        slope = 2 * scaled.factor.T @ (scaled.factor @ x - scaled.target) - y @ A
        slope = scaled.plane.turn(slope)  # what is held has a multiplier of its own
        reach, held = 2 * float(np.linalg.norm(x)), float(y @ (A @ x - c))
        if self.prior is not None:
            rest = np.where(body_columns(self.region), 0.0, slope)
            gap = prior_gap(self.region, self.prior, x, slope)
            gap += abs(held) + most_gain(rest, scaled.factor, reach)
            return np.zeros(cones.shape[:2]), gap  # the divergence keeps bodies off the edge
        Z = semidefinite(adjoint_inverse(cones, slope))
        room = cones @ x - self.margin * np.eye(4).ravel()
        error = slope - adjoint(cones, Z)
        gap = abs(held + float(np.sum(Z * room))) + most_gain(error, scaled.factor, reach)
        return Z, gap


def build_projection(
    region: PhysicalSet,
    *,
    margin: float = MARGIN,
    reference: Floats | None = None,
    prior: CadPrior | None = None,
    held: Held | None = None,
) -> Projection:
    """Compile the program of a robot.

    Parameters
    ----------
    region : PhysicalSet
        What is possible.
    margin : float
        Smallest dimensionless eigenvalue every body must keep.
    reference : (p,), optional
        Where the parameters go that the data do not determine; the CAD values, else zero.
    prior : CadPrior, optional
        Nominal robot that pulls.
    held : Held, optional
        Combinations of parameters outside the bodies that keep their values.

    Returns
    -------
    Projection

    Raises
    ------
    ValueError
        When bounds leave no room for a body, or the prior holds one that cannot exist; it is named.
    """
    check_room(region, margin)
    held = Held.none(region.size) if held is None else held
    # The unknown is the step from the unconstrained optimum, so that the solver's accuracy is
    # relative to what feasibility changes, not to the data.
    step, free = cp.Variable(region.size), cp.Parameter(region.size)
    factor = cp.Parameter(region.size * (region.size + 1) // 2)  # no zeros below the diagonal
    x = step + free
    A, c = scaled_rows(region)
    rows = at_least(A @ x, c)
    bodies = [above(matrix(map_, x), margin) for map_ in scaled_cones(region)]
    atoms: Any = cp
    cost = atoms.sum_squares(atoms.vec_to_upper_tri(factor) @ step)
    normal = cp.Parameter(held.rows.shape) if len(held.rows) else None
    fixed = [] if normal is None else [normal @ step == 0]
    if prior is not None:
        cost = cost + prior.weight * divergence(region, prior, x)
    problem = cp.Problem(cp.Minimize(cost), [rows, *bodies, *fixed])
    centre = np.zeros(region.size) if reference is None else np.array(reference, float)
    return Projection(
        region, margin, centre, prior, held, problem, step, factor, free, normal, rows
    )


def project(
    data: LeastSquares,
    region: PhysicalSet,
    *,
    margin: float = MARGIN,
    reference: Floats | None = None,
    prior: CadPrior | None = None,
) -> FeasibleEstimate:
    """Parameters of a real robot nearest to the data: `build_projection` and `Projection.solve`.

    Parameters
    ----------
    data : LeastSquares
        What the data say.
    region : PhysicalSet
        What is possible.
    margin, reference, prior
        As in `build_projection`.

    Returns
    -------
    FeasibleEstimate
    """
    return build_projection(region, margin=margin, reference=reference, prior=prior).solve(data)
