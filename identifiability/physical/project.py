"""The parameters of a real robot nearest to the data: a semidefinite program, and its evidence.

What to use when: `project` for one estimate; `Projection` when many data sets share one robot;
`pull` for a CAD prior of falling weight, by Newton's method.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.lapack import dposv

from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import CadPrior, divergence, nominal_cones, prior_gap
from identifiability.physical.feasible_set import (
    ADVICE,
    PhysicalSet,
    Program,
    above,
    adjoint,
    adjoint_inverse,
    most_gain,
    semidefinite,
)
from identifiability.physical.fitted_model import Fixed, LeastSquares, Plane

# The nearest real robots under a CAD prior of falling weight, by Newton's method.
#
# minimise ‖F (x − free)‖² + w Σ_k [tr J_k(x) − log det J_k(x) − 4] over rows, plane
#
# The divergence keeps bodies inside their cones by itself, so that only rows (signs and bounds)
# need multipliers, as in an interior-point method. That takes milliseconds, a tenth of what a
# general solver does. The way to a light weight leads along the optima of heavier ones, as that of
# an interior point does: a path of weights costs little more than its last one. Under a weight that
# is next to nothing, and without one, bodies lie at the edges of their cones: the general solver is
# asked.


#: Steps within which an optimum is reached; about twenty are needed. The general solver is asked
#: after that.
STEPS = 40

#: Newton decrement and complementarity [σ²] at which the optimum is reached, of a weight up to one;
#: of heavier ones [weights].
ENOUGH: Tolerance = 1e-8

#: Share of the way to the edge that one step goes, of cones and of signs.
IN_SIGNS: Tolerance = 0.995

#: Each step asks for this share of what the products of slack and multiplier are.
LESS: Tolerance = 0.03

#: The same of the weight, which begins at the size of the cost and ends at the prior's.
LIGHTER: Tolerance = 0.2

#: Rows and columns of the lower triangle of a body, and what makes its squares those of the whole.
ROW, COLUMN = np.tril_indices(4)
TWICE = np.where(ROW == COLUMN, 1.0, np.sqrt(2.0))


@frozen
class Pulled:
    """An optimum under a prior of one weight.

    Attributes
    ----------
    x : (p,)
    multipliers : (m,)
        Of the rows.
    directions, curve : (p, q) and (q, q)
        Of the plane, and the second derivatives of the cost [σ²] along them.
    """

    x: Array
    multipliers: Array
    directions: Array
    curve: Array

    @property
    def root(self) -> Array:
        """L of the errors ``L Lᵀ`` of x, (p, q), if half the cost is a negative log posterior."""
        size = 1 / np.sqrt(np.diag(self.curve))
        factor = np.linalg.cholesky(size[:, None] * self.curve * size)
        found: Array = np.sqrt(2.0) * (self.directions * size) @ np.linalg.inv(factor).T
        return found


def pull(region: PhysicalSet, maps: Array, weight: float, *way: Any) -> Pulled | None:
    """Return the optimum under one weight of the prior, None if it is not reached.

    Parameters as in `follow`.
    """
    try:
        return next(follow(region, maps, [weight], *way), None)
    except np.linalg.LinAlgError:  # be it by rounding at an edge
        return None


def follow(
    region: PhysicalSet,
    maps: Array,
    weights: Sequence[float],
    lines: tuple[Array, Array],
    factor: Array,
    free: Array,
    plane: Plane,
    *,
    enough: float = ENOUGH,
) -> Iterator[Pulled]:
    """Yield the optimum under each weight of the prior, as far as they are reached.

    Parameters
    ----------
    region : PhysicalSet
    maps : (nb, 16, p)
        To pseudo-inertias that the nominal bodies make the identity (`nominal_cones`).
    weights : sequence of float
        Of the prior [σ²], the heaviest first.
    lines : (m, p) and (m,)
        ``rows @ x ≥ least`` are the signs and the bounds.
    factor : (p, p)
        Square root of the quadratic cost.
    free : (p,)
        Where that cost is least, in the plane.
    plane : Plane
        What is held.
    enough : float
        Newton decrement and complementarity at which an optimum is reached, as `ENOUGH`.
    """
    rows, least = lines
    x = _with_nominal(region, maps, free)
    _, s, Vt = np.linalg.svd(factor @ plane.along)
    T = plane.along @ Vt.T  # along these directions the quadratic cost is a sum of squares
    cone, sign = maps @ T, rows @ T
    z = T.T @ (x - free)
    weight = max(weights[0], float(s * z @ (s * z)) / (4 * max(len(maps), 1)))
    slack = np.abs(rows @ x - least) + 0.01
    y = weight / slack
    at, left = 0, STEPS
    while left and at < len(weights):
        left, light = left - 1, weights[at]
        reached = max(enough, ENOUGH * light)
        lack, product = rows @ x - least - slack, slack * y
        root = weight**0.25 * np.linalg.inv(np.linalg.cholesky((maps @ x).reshape(-1, 4, 4)))
        size = np.full(root.shape[:2], np.sqrt(weight))
        each = float(product.sum() / max(y.size, 1))
        aim = max(LESS * each, reached / max(100, 2 * y.size))  # all of them together are enough
        rates = _congruent(root, cone)
        away = weight * root.transpose(0, 2, 1) @ (root / size[:, :, None])
        away -= weight * np.eye(4)
        force = sign.T @ ((aim - y * lack) / slack) + away.ravel() @ cone.reshape(-1, z.size)
        force -= 2 * s**2 * z
        stiff = np.sqrt(y / slack)[:, None] * sign
        curve = rates.T @ rates + stiff.T @ stiff  # each half the work: A.T @ A
        curve.ravel()[:: z.size + 1] += 2 * s**2
        step = _solve(curve, force)
        if step is None:
            return
        change = sign @ step + lack
        rise = (aim - y * change) / slack - y
        turn = _whole((rates @ step).reshape(-1, 10))
        reach = min(
            _room_in_cones(size, turn),
            _room(slack, change, IN_SIGNS),
            _room(y, rise, IN_SIGNS),
        )
        z, slack, y = z + reach * step, slack + reach * change, y + reach * rise
        x = free + T @ z
        if weight == light and reach == 1.0 and max(force @ step, product.sum()) < reached:
            yield Pulled(x, y, T, curve)
            at, left = at + 1, STEPS
        weight = max(weights[min(at, len(weights) - 1)], LIGHTER * weight)


def _with_nominal(region: PhysicalSet, maps: Array, x: Array) -> Array:
    """Return parameters (p,) with the bodies that maps (nb, 16, p) make the identity."""
    out = x.copy()
    own = np.take_along_axis(maps, region.bodies[:, None, :], axis=2)
    out[region.bodies] = np.linalg.pinv(own) @ np.eye(4).ravel()
    return out


def _congruent(root: Array, cone: Array) -> Array:
    """Return how congruent matrices change, (10 nb, p), as those of a map (nb, 16, p) do.

    They are lower triangles, and their squares are those of whole matrices.
    """
    whole = np.einsum("kab,kcd->kacbd", root, root).reshape(-1, 16, 16)
    rates: Array = TWICE[:, None] * whole[:, 4 * ROW + COLUMN] @ cone
    return rates.reshape(-1, cone.shape[2])


def _whole(triangles: Array) -> Array:
    """Return the symmetric matrices (nb, 4, 4) of their lower triangles (nb, 10), weighted."""
    out = np.empty((len(triangles), 4, 4))
    out[:, ROW, COLUMN] = out[:, COLUMN, ROW] = triangles / TWICE
    return out


def _solve(curve: Array, force: Array) -> Array | None:
    """Return the Newton step, each direction in its own size; None where rounding forbids it."""
    size = 1 / np.sqrt(np.diag(curve))
    _, step, failed = dposv(size[:, None] * curve * size, size * force)
    return None if failed else size * step


def _room(value: Array, change: Array, share: float) -> float:
    """Return the part of a change, at most one, that leaves values positive."""
    falls = change < 0
    return min(1.0, share * float((value[falls] / -change[falls]).min(initial=np.inf)))


def _room_in_cones(size: Array, change: Array) -> float:
    """Return the same for diagonal matrices (nb, 4) that become others, for their eigenvalues."""
    share = 1 / np.sqrt(size)
    values = np.linalg.eigvalsh(share[:, :, None] * change * share[:, None]).ravel()
    # Share of the way to the edge that one step goes, of cones and of signs.
    return _room(np.ones(values.size), values, 0.9)


# The parameters of a real robot nearest to the data: a semidefinite program, and its evidence.
#
# minimise ‖R phi − z‖² over J_k(phi) ⪰ margin (every body k), signs, H phi = h
#
# What to use when: `project` for one estimate; `Projection` when many data sets share one robot,
# since its program is compiled once. A `CadPrior` pulls what the data do not determine towards a
# nominal robot.
#
# Two things keep the optimum right: R is factored, never squared, and the columns are scaled.


#: Smallest dimensionless eigenvalue of a body in the answer: simulators refuse singular inertia.
MARGIN: Tolerance = 1e-6

#: Pull [σ²] to the reference per squared column scale: it decides where the data say nothing.
RIDGE: Tolerance = 1e-8


#: Distance to the optimum [σ²] that predictions do not notice.
ENOUGH_TO_PREDICT: Tolerance = 1e-2

#: The same relative to ``‖z‖²``, for data with next to no noise.
ROUNDING: Tolerance = 1e-12


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

    phi: Array
    rss: float
    excess: float
    margins: Array
    active_bodies: tuple[str, ...]
    active_rows: tuple[str, ...]
    status: str
    gap: float
    accurate: bool


@frozen
class _Scaled:
    """A data set in scaled parameters: ``phi = scale * x``, cost ``‖factor x − target‖²`` in σ²."""

    scale: Array
    factor: Array
    target: Array
    plane: Plane


class Projection:
    """A program: solve it for as many data sets as there are, one at a time.

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
    fixed : Fixed, optional
        Combinations of parameters outside the bodies that keep their values.

    Raises
    ------
    ValueError
        When the prior holds a body that cannot exist; it is named.
    """

    def __init__(
        self,
        region: PhysicalSet,
        *,
        margin: float = MARGIN,
        reference: Array | None = None,
        prior: CadPrior | None = None,
        fixed: Fixed | None = None,
    ) -> None:
        p = region.size
        self.region, self.margin, self.prior = region, margin, prior
        self.reference = np.zeros(p) if reference is None else reference
        self.fixed = Fixed.none(p) if fixed is None else fixed
        self._rows, self._least = region.scaled_rows, region.least_with(margin)
        self.nominal = np.zeros((0, 16, p)) if prior is None else nominal_cones(region, prior)

    def solve(self, data: LeastSquares) -> FeasibleEstimate:
        """Project one data set.

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
        with one_thread():
            scaled = self._scale(data)
            free = scaled.plane.solve(scaled.factor, scaled.target)
            if self.prior is None and self._holds(free):
                return self._read(data, scaled, free, np.zeros(len(self._least)), "optimal")
            if self.prior is not None:
                found = pull(self.region, self.nominal, self.prior.weight, *self._way(scaled, free))
                if found is not None and self._holds(found.x):
                    return self._read(data, scaled, found.x, found.multipliers, "optimal")
            return self._read(data, scaled, *self._program.solve(scaled, free))

    def _way(self, scaled: _Scaled, free: Array) -> tuple[Any, ...]:
        return (self._rows, self._least), scaled.factor, free, scaled.plane

    def follow(self, data: LeastSquares, weights: Sequence[float]) -> Iterator[tuple[Array, Array]]:
        """Yield the optimum (p,) under each weight, and a root (p, q) of its errors.

        As far as they are reached, and accurate enough for predictions. Errors are those of a
        posterior at its mode [Laplace], of noise with the data's variance, and bounds on centres
        of mass are not asked for.

        Parameters
        ----------
        data : LeastSquares
        weights : sequence of float
            Of the prior [σ²], the heaviest first.
        """
        scaled = self._scale(data)
        free = scaled.plane.solve(scaled.factor, scaled.target)
        way = self._way(scaled, free)
        for at in follow(self.region, self.nominal, weights, *way, enough=ENOUGH_TO_PREDICT):
            try:
                root = at.root
            except np.linalg.LinAlgError:  # nothing but rounding is known of some of them
                return
            yield self.fixed.settle(at.x * scaled.scale), scaled.scale[:, None] * root

    @cached_property
    def _program(self) -> _Program:
        return _Program(self)

    def _scale(self, data: LeastSquares) -> _Scaled:
        """Return a data set in scaled parameters, with what pulls where it says nothing.

        A function's values are of one size, that at which its best-seen one makes the whole torque:
        where few data are a value of more than that is their noise.
        """
        norms = np.linalg.norm(data.R, axis=0)
        whole = np.linalg.norm(data.z)
        seen = (norms > 0) & (whole > 0)
        scale = np.where(seen, whole / np.where(seen, norms, 1.0), 1.0)
        scale = np.where(self.region.inertial, self.region.scale, scale)
        pull = np.full(scale.size, np.sqrt(RIDGE))
        for own in self.region.functions:
            scale[own], pull[own] = scale[own[seen[own]]].min(initial=whole or 1.0), 1.0
        stacked = np.vstack([data.R * scale / data.unit, np.diag(pull)])
        Q, factor = np.linalg.qr(stacked)
        wanted = np.concatenate([data.z / data.unit, pull * self.reference / scale])
        return _Scaled(scale, factor, Q.T @ wanted, self.fixed.scaled(scale))

    def _holds(self, x: Array) -> bool:
        J = (self.region.cones @ x).reshape(-1, 4, 4)
        inside = (np.linalg.eigvalsh(J)[:, 0] >= self.margin).all()
        return bool(inside and (self._rows @ x >= self._least).all())

    def _read(
        self, data: LeastSquares, scaled: _Scaled, x: Array, y: Array, status: str
    ) -> FeasibleEstimate:
        region, phi = self.region, self.fixed.settle(x * scaled.scale)
        Z, gap = self._judge(scaled, x, y)
        excess = (float(data.rss(phi)) - data.rss_min) / data.unit**2
        # Largest accepted distance to the optimum [σ²], relative to ``1 + excess``.
        allowed = 1e-3 * (1 + excess) + ROUNDING * float(scaled.target @ scaled.target)
        margins = region.margins(phi)
        # Complementarity: of slack and multiplier one is zero, and the larger one says which.
        pressed = np.linalg.norm(Z, axis=1) > margins - self.margin
        active = np.array(region.labels, object)[y > self._rows @ x - self._least]
        return FeasibleEstimate(
            phi=phi,
            rss=float(data.rss(phi)),
            excess=excess,
            margins=margins,
            active_bodies=tuple(np.array(region.names, object)[pressed]),
            active_rows=tuple(active),
            status=status,
            gap=gap,
            accurate=bool(gap <= allowed),
        )

    def _judge(self, scaled: _Scaled, x: Array, y: Array) -> tuple[Array, float]:
        """Multipliers (nb, 16) of the bodies, and the distance to the optimum by convexity.

        f(x) − f(x*) ≤ ⟨Z, J(x) − m⟩ + yᵀ(Ax − c) + eᵀd − ‖F d‖² for any Z ⪰ 0 and y ≥ 0, where
        A x ≥ c are the rows, e is what Z and y leave of the gradient and d = x − x*, taken to be no
        longer than 2‖x‖. The solver's claim is not used: Z is the semidefinite part of the gradient
        itself.
        """
        A, cones = self._rows, self.region.cones
        slope = 2 * scaled.factor.T @ (scaled.factor @ x - scaled.target) - y @ A
        slope = scaled.plane.turn(slope)  # what is held has a multiplier of its own
        reach, bound = 2 * float(np.linalg.norm(x)), float(y @ (A @ x - self._least))
        if self.prior is not None:
            rest = np.where(self.region.inertial, 0.0, slope)
            gap = prior_gap(self.nominal, self.prior.weight, x, slope)
            gap += abs(bound) + most_gain(rest, scaled.factor, reach)
            return np.zeros(cones.shape[:2]), gap  # the divergence keeps bodies off the edge
        Z = semidefinite(adjoint_inverse(cones, slope))
        room = cones @ x - self.margin * np.eye(4).ravel()
        error = slope - adjoint(cones, Z)
        gap = abs(bound + float(np.sum(Z * room))) + most_gain(error, scaled.factor, reach)
        return Z, gap


class _Program:
    """The program of a projection as cvxpy states it.

    The unknown is the step from the unconstrained optimum, so that the solver's accuracy is
    relative to what feasibility changes, not to the data. The cost is that of ``factor @ step``.
    """

    def __init__(self, projection: Projection) -> None:
        import cvxpy as cp  # noqa: PLC0415

        region, margin, prior = projection.region, projection.margin, projection.prior
        p, fixed = region.size, len(projection.fixed.rows)
        step, image = cp.Variable(p), cp.Variable(p)
        data = np.ones((p + fixed, p)) @ step == np.eye(p + fixed, p) @ image
        self._signs = region.scaled_rows @ step >= region.least_with(margin)
        bodies = [above(map_, step, margin) for map_ in region.cones]
        cost, constraints = cp.sum_squares(image), [data, self._signs, *bodies]
        if prior is not None:
            away = cp.Variable(len(projection.nominal))
            cost += prior.weight * cp.sum(away)
            constraints += [
                divergence(m, step) <= a for m, a in zip(projection.nominal, away, strict=True)
            ]
        self._region, self._step = region, step
        self._compiled = Program(cost, constraints, step)

    def solve(self, scaled: _Scaled, free: Array) -> tuple[Array, Array, str]:
        """Return the optimum (p,), multipliers of rows (m,), and the status."""
        try:
            status = self._compiled.solve(np.vstack([scaled.factor, scaled.plane.normal.T]), free)
        except ValueError as error:
            raise ValueError(
                f"projection: the solver found no answer ({error}); expected one, since every "
                f"body has room; {ADVICE}."
            ) from error
        y = np.maximum(self._signs.dual_value, 0.0)
        x = scaled.plane.project(free + self._step.value)
        # The solver's last digits may lie beyond a sign, which a reader of robot files refuses.
        x[self._region.signed] = np.maximum(x[self._region.signed], 0.0)
        return x, y, status


def project(data: LeastSquares, region: PhysicalSet, **options: Any) -> FeasibleEstimate:
    """Parameters of a real robot nearest to the data, once.

    Parameters
    ----------
    data : LeastSquares
        What the data say.
    region : PhysicalSet
        What is possible.
    **options
        As in `Projection`.
    """
    return Projection(region, **options).solve(data)
