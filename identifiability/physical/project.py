"""The physically consistent parameters nearest to the data.

minimise ‖R phi − z‖² + w Σ_k [tr J_k(phi) − log det J_k(phi) − 4] over J_k(phi) ⪰ margin (every
body k), signs and bounds, H phi = h

What to use when: `project` for one estimate; `Projection` when many data sets share one robot;
`Projection.follow` for a prior of falling weight.

Two things keep the optimum right: R is factored, never squared, and the columns are scaled.
"""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dposv

from identifiability.foundation.engines import one_thread
from identifiability.foundation.linalg import NEARLY, TINY, find_chains, root_diagonal
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen

from .cad_prior import CadPrior, relative_to
from .fitted_model import Fixed, LeastSquares, PhysicalSet

#: Cost that nothing notices [σ²]: of the distance to an optimum, and of the pull to the reference
#: per squared column scale, which decides where the data say nothing.
RIDGE: Tolerance = 1e-8

#: Options of Clarabel after a failure: by default it adds a hundred times that to each pivot, and
#: ends in its first step where refinement does not make up for it.
EXACTER = {"static_regularization_constant": 1e-10}

ADVICE = (
    "state the true mass and inertia of every body in the robot file (<inertial>), the scale in "
    "which bodies are measured"
)


@frozen
class FeasibleEstimate:
    """The nearest physically consistent parameters.

    Attributes
    ----------
    phi : (p,)
    rss : float [torque²]
    excess : float
        What feasibility costs: rise of the residual sum of squares over least squares, in σ².
    margins : (nb,)
        Smallest dimensionless eigenvalue of every body.
    active : tuple of str
        What holds the estimate back: bodies at the edge of what can exist, signs and bounds.
    accurate : bool
        Whether the solver is sure of the optimum; the answer is feasible either way.
    """

    phi: Array
    rss: float
    excess: float
    margins: Array
    active: Strings
    accurate: bool


@frozen
class Program:
    """A data set in the directions z along which its cost is a sum of squares ``‖stiff z‖²`` [σ²].

    Attributes
    ----------
    scale, free : (p,)
        ``phi = scale * (free + along @ z)``: z is zero at the optimum without constraints.
    along : (p, q)
        Orthonormal.
    stiff : (q,)
    rows, slack : (m, q), (m,)
        ``rows @ z + slack ≥ 0`` are the signs and the bounds.
    chains : list of (directions, bodies, rows)
        Of each chain of the robot: the cost and all constraints have no two of them in common.
    held : Fixed
        Combinations that keep their values, be they none.
    """

    scale: Array
    free: Array
    along: Array
    stiff: Array
    rows: Array
    slack: Array
    chains: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
    held: Fixed


@frozen
class Optimum:
    """Where a program is least.

    Attributes
    ----------
    z : (q,)
    pressure : (nb + m,)
        Sizes of the multipliers of bodies, zero where a prior keeps them off the edge, and of rows.
    accurate : bool
    curves : tuple of (d, d)
        Second derivatives of the cost under a prior in the directions of each chain [σ²].
    """

    z: Array
    pressure: Array
    accurate: bool = True
    curves: tuple[Array, ...] = ()


@frozen
class Projection:
    """A program: solve it for as many data sets as there are, one at a time.

    Attributes
    ----------
    region : PhysicalSet
        What is possible.
    margin : float
        Smallest dimensionless eigenvalue every body must keep: simulators refuse singular inertia.
    reference : (p,), optional
        Where the parameters go that the data do not determine; the CAD values, else zero.
    prior : CadPrior, optional
        Nominal robot that pulls.
    fixed : Fixed, optional
        Combinations of parameters outside the bodies that keep their values.
    """

    region: PhysicalSet
    margin: float = NEARLY
    reference: Array | float = 0.0
    prior: CadPrior | None = None
    fixed: Fixed | None = None

    @cached_property
    def nominal(self) -> Array:
        """Maps to pseudo-inertias that the prior's bodies make the identity, (nb, 16, p).

        Raises
        ------
        ValueError
            When the prior holds a body that cannot exist; it is named.
        """
        region = self.region
        maps = np.zeros((len(region.bodies), 16, region.size))
        if self.prior is None:
            return maps[:0]
        for own, name, columns in zip(maps, region.names, region.bodies, strict=True):
            own[:, columns] = relative_to(self.prior.phi[columns], name) * region.scale[columns]
        return maps

    @cached_property
    def nominal_bodies(self) -> Array:
        """Scaled parameters of the bodies that `nominal` makes the identity, (nb, 10)."""
        own = np.take_along_axis(self.nominal, self.region.bodies[:, None, :], axis=2)
        return np.linalg.pinv(own) @ np.eye(4).ravel()

    def solve(self, data: LeastSquares) -> FeasibleEstimate:
        """Project one data set.

        Raises
        ------
        ValueError
            When the solver finds no optimum.
        """
        with one_thread():
            program = self._state(data)
            found = self._solve_simply(program) or self._solve_generally(program)
            return self._read(data, program, found)

    def _solve_simply(self, program: Program) -> Optimum | None:
        """Return the optimum without active constraints, or with a prior alone.

        None if it is not.
        """
        none = np.zeros(len(self.region.constraints))
        found: Optimum | None = Optimum(0 * program.stiff, none)
        if self.prior is not None:
            try:
                found = next(self._follow(program, [self.prior.weight]), None)
            except np.linalg.LinAlgError:  # be it by rounding at an edge
                return None
        if found is None:
            return None
        x = program.free + program.along @ found.z
        values = np.linalg.eigvalsh((self.region.cones @ x).reshape(-1, 4, 4))
        inside = (values >= self.margin).all()
        holds = inside and (program.rows @ found.z + program.slack >= 0).all()
        return found if holds else None

    def _solve_generally(self, program: Program) -> Optimum:
        """Return the optimum as Clarabel finds it, under a prior as cvxpy states it.

        cvxpy is imported for a prior alone: half a second that most fits need not spend.
        """
        stiff = program.stiff[:, None] * program.along.T
        factor = np.asarray(np.linalg.qr(stiff, mode="r"))  # it is sparser
        held = program.held.rows * program.scale
        if self.prior is not None:
            return self._solve_with_prior(self.prior, program, factor, held)
        # The solver's accuracy is relative to the changes by feasibility, not to the data. Unknowns
        # are the image of a step, whose square is the cost, and the step of scaled parameters.
        q, p = factor.shape
        cones = self.region.cones
        found, dual, Z, accurate = solve_cones(
            "projection",
            np.append(np.full(q, 2.0), np.zeros(p)),
            np.zeros(q + p),
            np.vstack([np.hstack([np.eye(q), -factor]), np.pad(held, ((0, 0), (q, 0)))]),
            np.pad(self.region.scaled_rows, ((0, 0), (q, 0))),
            program.slack,
            np.pad(cones, ((0, 0), (0, 0), (q, 0))),
            cones @ program.free - self.margin * np.eye(4).ravel(),
        )
        pressure = np.append(np.linalg.norm(Z, axis=1), dual)
        return Optimum(program.along.T @ found[q:], pressure, accurate)

    def _solve_with_prior(
        self, prior: CadPrior, program: Program, factor: Array, held: Array
    ) -> Optimum:
        """Return the optimum under a prior.

        Parameters
        ----------
        prior : CadPrior
        program : Program
        factor : (q, p)
            The cost is the square of its product with the step.
        held : (k, p)
            Combinations that the step leaves alone.
        """
        import cvxpy as cp  # noqa: PLC0415

        step = cp.Variable(len(program.free))
        image = cp.Variable(len(program.stiff))

        def square(maps: Array) -> list[Any]:  # one reshape of one product compiles fastest
            return [cp.reshape(A @ step + A @ program.free, (4, 4), order="C") for A in maps]

        signs = self.region.scaled_rows @ step + program.slack >= 0
        bodies = [J >> self.margin * np.eye(4) for J in square(self.region.cones)]
        away = [cp.trace(J) - cp.log_det(J) - 4 for J in square(self.nominal)]
        cost = cp.sum_squares(image) + prior.weight * sum(away)
        linked = [image == factor @ step, held @ step == 0]
        problem = cp.Problem(cp.Minimize(cost), [*linked, signs, *bodies])
        accurate = _solve_stated(problem)
        pressure = np.append([np.linalg.norm(J.dual_value) for J in bodies], signs.dual_value)
        z = program.along.T @ step.value
        return Optimum(z, pressure, accurate)

    def follow(self, data: LeastSquares, weights: Sequence[float]) -> Iterator[tuple[Array, Array]]:
        """Yield the optimum (p,) under each weight, and a root (p, q) of its errors.

        The path ends where the solver fails; its optima are accurate enough for predictions. Errors
        are those of a posterior at its mode [Laplace], of noise with the data's variance, and
        bounds on centres of mass are not asked for.

        Parameters
        ----------
        data : LeastSquares
        weights : sequence of float
            Of the prior [σ²], the heaviest first.
        """
        program = self._state(data)
        # Only predictions of these are compared, in some nats.
        for at in self._follow(program, weights, np.sqrt(RIDGE)):
            root = np.zeros_like(program.along)
            for (own, *_), curve in zip(program.chains, at.curves, strict=True):
                size = 1 / root_diagonal(curve)
                try:
                    factor = np.linalg.cholesky(size[:, None] * curve * size)
                except np.linalg.LinAlgError:  # nothing but rounding is known of some of them
                    return
                along = program.along[:, own] * size
                root[:, own] = np.sqrt(2.0) * solve_triangular(factor, along.T, lower=True).T
            yield self._phi(program, at), program.scale[:, None] * root

    def _follow(
        self, program: Program, weights: Sequence[float], near: float = 0.0
    ) -> Iterator[Optimum]:
        """Yield the optimum of a program under each weight, from the nominal bodies on."""
        x = program.free.copy()
        x[self.region.bodies] = self.nominal_bodies
        start = program.along.T @ (x - program.free)
        return follow(program, start, self.nominal, weights, near)

    def _phi(self, program: Program, found: Optimum) -> Array:
        x = program.free + program.along @ found.z
        # The solver's last digits may lie beyond a sign, which a reader of robot files refuses.
        x[self.region.signed] = np.maximum(x[self.region.signed], 0.0)
        return program.held.impose(x * program.scale)

    def _state(self, data: LeastSquares) -> Program:
        """Return a data set in scaled parameters, with weak rows where the data say nothing.

        The values of a function have one scale, at which its best-determined value makes the whole
        torque: where few data are a value of more than that is their noise.
        """
        norms = np.linalg.norm(data.R, axis=0)
        whole = np.linalg.norm(data.z)
        seen = (norms > 0) & (whole > 0)
        scale = np.where(seen, whole / np.where(seen, norms, 1.0), 1.0)
        scale = np.where(self.region.inertial, self.region.scale, scale)
        pull = np.full(scale.size, np.sqrt(RIDGE))
        for own in self.region.functions:
            scale[own] = scale[own[seen[own]]].min(initial=whole or 1.0)
            pull[own] = 1.0
        stacked = np.vstack([data.R * scale / data.unit, np.diag(pull)])
        wanted = np.concatenate([data.z / data.unit, pull * self.reference / scale])
        held = self._hold(data)
        origin, along = held.span(scale)
        seen = stacked @ along
        rows = self.region.scaled_rows
        signs = np.abs(rows @ along)
        bodies = np.abs(along[self.region.bodies]).max(1, initial=0.0)
        acts = [x > TINY * x.max(0, initial=0.0) for x in (np.abs(seen), signs, bodies)]
        stiff = np.zeros(along.shape[1])
        free = origin.copy()
        aim = wanted - stacked @ origin
        chains = []
        for own in find_chains(np.vstack(acts)):
            signed, within = (np.flatnonzero(x[:, own].any(1)) for x in acts[1:])
            squares = np.flatnonzero(seen[:, own].any(1))  # weak rows too: each direction has one
            Q, factor = np.linalg.qr(seen[np.ix_(squares, own)])
            U, stiff[own], Vt = np.linalg.svd(factor)
            along[:, own] = along[:, own] @ Vt.T
            free += along[:, own] @ (U.T @ (Q.T @ aim[squares]) / stiff[own])
            chains.append((own, within, signed))
        least = self.region.least + self.margin * self.region.bounded
        return Program(scale, free, along, stiff, rows @ along, rows @ free - least, chains, held)

    def _hold(self, data: LeastSquares) -> Fixed:
        """Return the combinations that keep their values, and the parameters without data.

        No data tell the friction of a joint that stands.
        """
        held = self.fixed or Fixed.none(self.region.size)
        unseen = ~(self.region.inertial | data.R.any(axis=0) | held.rows.any(axis=0))
        least = np.where(self.region.nonnegative, 0.0, -np.inf)
        where = np.maximum(self.reference, least)
        rows = np.vstack([held.rows, np.eye(len(unseen))[unseen]])
        return Fixed(rows, np.append(held.value, where[unseen]))

    def _read(self, data: LeastSquares, program: Program, found: Optimum) -> FeasibleEstimate:
        region = self.region
        phi = self._phi(program, found)
        rss = float(data.rss(phi))
        margins = region.margins(phi)
        # Complementarity: of slack and multiplier one is zero, and the larger one says which.
        room = np.append(margins - self.margin, program.rows @ found.z + program.slack)
        pressed = found.pressure > room
        excess = (rss - data.rss_min) / data.unit**2
        active = tuple(np.array(region.constraints, object)[pressed])
        return FeasibleEstimate(
            phi=phi,
            rss=rss,
            excess=excess,
            margins=margins,
            active=active,
            accurate=found.accurate,
        )


#: Ends of Clarabel with a solution, be it not accurate.
PRESENT = ("Solved", "AlmostSolved", "MaxIterations", "MaxTime")


def unsolved(program: str, status: Any) -> ValueError:
    """Return the error of a program for which the solver found no answer."""
    return ValueError(
        f"{program}: the solver found no answer ({status}); expected one, since every "
        f"body has room; {ADVICE}."
    )


def solve_cones(
    program: str,
    square: Array,
    goal: Array,
    equal: Array,
    rows: Array,
    slack: Array,
    maps: Array,
    at: Array,
) -> tuple[Array, Array, Array, bool]:
    """Return the optimum of a program in cones, as Clarabel finds it.

    minimise ``½ square @ u² + goal @ u`` over ``equal @ u = 0``, ``rows @ u + slack ≥ 0`` and
    ``maps @ u + at ⪰ 0``

    Parameters
    ----------
    program : str
        Its name, for the error.
    square, goal : (n,)
    equal : (e, n)
    rows, slack : (m, n) and (m,)
    maps, at : (k, 16, n) and (k, 16)
        Symmetric matrices of four by four, flattened.

    Returns
    -------
    u : (n,)
    multipliers : (m,) and (k, 16)
        Of rows and matrices.
    accurate : bool

    Raises
    ------
    ValueError
        When the solver finds no answer.
    """
    import clarabel  # noqa: PLC0415
    from scipy.sparse import csc_array, diags_array  # noqa: PLC0415

    squares = (TWICE[:, None] * maps[:, LOWER]).reshape(-1, len(goal))
    constraint = csc_array(-np.vstack([equal, rows, squares]))
    offset = np.concatenate([np.zeros(len(equal)), slack, (TWICE * at[:, LOWER]).ravel()])
    cones = [clarabel.ZeroConeT(len(equal)), clarabel.NonnegativeConeT(len(rows))]
    cones += [clarabel.PSDTriangleConeT(4)] * len(maps)
    curvature = csc_array(diags_array(square))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for options in ({}, EXACTER):
        for name, value in options.items():
            setattr(settings, name, value)
        solver = clarabel.DefaultSolver(curvature, goal, constraint, offset, cones, settings)
        found = solver.solve()
        if found.status == clarabel.SolverStatus.Solved:
            break
    if str(found.status) not in PRESENT:
        raise unsolved(program, found.status)
    _, multipliers, of_bodies = np.split(found.z, np.cumsum([len(equal), len(rows)]))
    Z = np.zeros((len(maps), 4, 4))
    Z[:, ROW, COLUMN] = Z[:, COLUMN, ROW] = of_bodies.reshape(-1, 10) / TWICE
    accurate = found.status == clarabel.SolverStatus.Solved
    return np.array(found.x), multipliers, Z.reshape(-1, 16), accurate


def _solve_stated(problem: Any) -> bool:
    """Solve a cvxpy problem; return whether the solver is sure of the optimum.

    Raises
    ------
    ValueError
        When the solver finds none.
    """
    import cvxpy as cp  # noqa: PLC0415

    for options in ({}, EXACTER):
        with warnings.catch_warnings(), suppress(cp.SolverError):
            warnings.filterwarnings("ignore", "Solution may be inaccurate")
            problem.solve(solver=cp.CLARABEL, **options)
        if problem.status == cp.OPTIMAL:
            return True
    if problem.status not in cp.settings.SOLUTION_PRESENT:
        raise unsolved("projection", problem.status)
    return False


def project(data: LeastSquares, region: PhysicalSet, **options: Any) -> FeasibleEstimate:
    """Return the physically consistent parameters nearest to the data, once.

    Parameters
    ----------
    data : LeastSquares
        The loss of the data.
    region : PhysicalSet
        What is possible.
    **options
        As in `Projection`.
    """
    return Projection(region, **options).solve(data)


# The nearest physically consistent values under a CAD prior of falling weight, by Newton's method.
#
# The divergence keeps bodies inside their cones by itself, so that only rows (signs and bounds)
# need multipliers, as in an interior-point method. That takes milliseconds, a tenth of the time of
# a general solver. The way to a light weight leads along the optima of heavier ones, as that of an
# interior point does: a path of weights costs little more than its last one. Under a weight that is
# next to nothing, and without one, bodies lie at the edges of their cones: the general solver is
# asked.


#: Steps within which an optimum is reached; about twenty are needed. The general solver is asked
#: after that.
STEPS = 40

#: Share of the way to the edge that one step goes.
EDGE: Tolerance = 0.95

#: Each step reduces the products of slack and multiplier to this share, and the weight as well. The
#: weight begins at the size of the cost and ends at the prior's.
LESS: Tolerance = 0.1

#: Rows and columns of the lower triangle of a body, and the factors that make its squares those of
#: the whole.
ROW, COLUMN = np.tril_indices(4)
TWICE = np.where(ROW == COLUMN, 1.0, np.sqrt(2.0))
LOWER = 4 * ROW + COLUMN


def follow(
    program: Program, start: Array, maps: Array, weights: Sequence[float], near: float
) -> Iterator[Optimum]:
    """Yield the optimum under each weight of the prior, as long as the solver reaches it.

    Parameters
    ----------
    program : Program
    start : (q,)
        At which the bodies are nominal.
    maps : (nb, 16, p)
        To pseudo-inertias that the nominal bodies make the identity (`Projection.nominal`).
    weights : sequence of float
        Of the prior [σ²], the heaviest first.
    near : float
        Tolerance of the cost [σ²]; the solver's tolerance if that is smaller.
    """
    paths = [_follow_chain(program, maps, start, own, weights, near) for own in program.chains]
    for optima in zip(*paths, strict=False):
        z = np.empty_like(program.stiff)
        pressure = np.zeros(len(maps) + len(program.slack))
        for (own, _, rows), (values, multipliers, _) in zip(program.chains, optima, strict=True):
            z[own] = values
            pressure[len(maps) + rows] = multipliers
        yield Optimum(z, pressure, curves=tuple(curve for *_, curve in optima))


def _follow_chain(
    program: Program,
    maps: Array,
    start: Array,
    chain: tuple[np.ndarray, np.ndarray, np.ndarray],
    weights: Sequence[float],
    near: float,
) -> Iterator[tuple[Array, Array, Array]]:
    """Yield values, multipliers of the rows, and second derivatives in the directions of a chain.

    Parameters
    ----------
    program, maps, start, weights, near
        As in `follow`.
    chain
        One of the program's.
    """
    own, bodies, rows = chain
    cone = maps[bodies] @ program.along[:, own]
    nominal = maps[bodies] @ program.free
    sign = program.rows[np.ix_(rows, own)]
    room = program.slack[rows]
    z = start[own]
    bend = 2 * program.stiff[own] ** 2
    bent = float(bend @ z**2)
    weight = max(weights[0], bent / (8 * max(len(bodies), 1)))
    slack = np.abs(sign @ z + room) + 0.01
    y = 1.0 / slack
    at = 0
    left = STEPS
    reach = 1.0
    while left and at < len(weights):
        left -= 1
        light = weights[at]
        reached = max(near, RIDGE * max(1.0, light))  # Newton decrement and complementarity
        lack = sign @ z + room - slack
        product = slack * y
        each = float(product.sum() / max(y.size, 1))
        each *= LESS if reach > LESS else 1 / LESS  # rows that bound no longer hinder small ones
        aim = max(each, reached / max(100, 2 * y.size))  # all of them together are enough
        try:
            rates, pull = _divergence(cone, (cone @ z + nominal).reshape(-1, 4, 4), weight)
        except np.linalg.LinAlgError:  # by rounding a body is at the edge
            return
        force = sign.T @ ((aim - y * lack) / slack) + pull
        force -= bend * z
        stiff = np.sqrt(y / slack)[:, None] * sign
        curve = rates.T @ rates + stiff.T @ stiff  # each half the work: A.T @ A
        curve.ravel()[:: z.size + 1] += bend
        size = 1 / root_diagonal(curve)  # each direction in its own
        _, step, failed = dposv(size[:, None] * curve * size, size * force)
        if failed:
            return
        step = size * step
        change = sign @ step + lack
        rise = (aim - y * change) / slack - y
        in_cones = _room_in_cones(rates @ step, weight)
        reach = min(in_cones, _room(slack, change), _room(y, rise))
        z = z + reach * step
        slack = slack + reach * change
        y = y + reach * rise
        if weight == light and reach == 1.0 and max(force @ step, product.sum()) < reached:
            yield z, y, curve
            at += 1
            left = STEPS
        weight = max(weights[min(at, len(weights) - 1)], LESS * weight)


def _divergence(cone: Array, J: Array, weight: float) -> tuple[Array, Array]:
    """Return the divergence's root of curvature (10 nb, q) and its force (q,) [σ²].

    How congruent matrices change: lower triangles whose squares are those of whole matrices.

    Parameters
    ----------
    cone : (nb, 16, q)
        Derivative of the bodies by z.
    J : (nb, 4, 4)
        Bodies.
    weight : float [σ²]

    Raises
    ------
    numpy.linalg.LinAlgError
        When a body is at the edge of what can exist.
    """
    root = weight**0.25 * np.linalg.inv(np.linalg.cholesky(J))
    whole = np.einsum("kab,kcd->kacbd", root, root).reshape(-1, 16, 16)
    rates = TWICE[:, None] * whole[:, LOWER] @ cone
    away = np.sqrt(weight) * root.transpose(0, 2, 1) @ root - weight * np.eye(4)
    size = cone.shape[2]
    return rates.reshape(-1, size), away.ravel() @ cone.reshape(-1, size)


def _room_in_cones(rates: Array, weight: float) -> float:
    """Return the part of changes of bodies, at most one, that leaves all of them inside."""
    # No eigenvalue is larger than the norm, which takes less time.
    if rates @ rates <= EDGE**2 * weight:
        return 1.0
    turn = np.zeros((len(rates) // 10, 4, 4))
    turn[:, ROW, COLUMN] = turn[:, COLUMN, ROW] = rates.reshape(-1, 10) / TWICE
    values = np.linalg.eigvalsh(turn / np.sqrt(weight)).ravel()
    return _room(np.ones(values.size), values)


def _room(value: Array, change: Array) -> float:
    """Return the part of a change, at most one, that leaves values positive."""
    falls = change < 0
    with np.errstate(over="ignore"):  # of a change near zero, which leaves all room
        ratios = value[falls] / -change[falls]
    return min(1.0, EDGE * float(ratios.min(initial=np.inf)))
