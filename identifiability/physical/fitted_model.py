"""The set of possible bodies, and the problem of a fitted model in their standard parameters.

The data enter as a compressed least-squares problem; parameters that a model omits, fixes or ties
enter as constraints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.foundation.linalg import ROUNDOFF, SPAN_TOLERANCE, or_one, root_diagonal
from identifiability.foundation.names import GROUPED_KINDS, Array, Strings
from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel, list_functions
from identifiability.regression.structure import Structure

from .pseudo_inertia import BASIS, entry_scale, natural_scale, scale_matrix

# The set of parameter vectors that a real robot can have: every body has a positive semidefinite
# pseudo-inertia, friction and actuator inertia are not negative, and masses and centres of mass
# are where the user says. Linear matrix inequalities and rows, one convex set, shared by
# certificate, projection and posterior.

_MASS, _FIRST = GROUPED_KINDS.index("m"), [GROUPED_KINDS.index(kind) for kind in ("mx", "my", "mz")]

#: A row (p,) of parameters and the lower limit of its product, in units of the width between two
#: bounds.
Bound = tuple[Array, float]


@frozen
class PhysicalSet:
    """The set of physically consistent parameter vectors.

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
        Scale of the margins; take them from CAD or leave 1 kg and 0.1 m.
    bounds : tuple of Bound
        What is known of masses and centres of mass.
    functions : tuple of (k,) int
        Columns of each function that was learned: one unit of each is as much torque.
    """

    bodies: np.ndarray
    nonnegative: np.ndarray
    names: Strings = ()
    columns: Strings = ()
    mass: Array = np.ones(1)
    length: Array = np.full(1, 0.1)
    bounds: tuple[Bound, ...] = ()
    functions: tuple[np.ndarray, ...] = ()

    def __post_init__(self) -> None:
        nb = len(self.bodies)
        mass = np.broadcast_to(self.mass, nb)
        length = np.broadcast_to(self.length, nb)
        names = self.names or tuple(f"body {k + 1}" for k in range(nb))
        columns = self.columns or tuple(map(str, range(self.size)))
        vars(self).update(mass=mass, length=length, names=names, columns=columns)

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
        scale_rows = self.root[:, None, :, None]
        scale_columns = self.root[:, None, None, :]
        scaled = BASIS / (scale_rows * scale_columns)
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
        return self.cone_map * self.scale

    @cached_property
    def signed(self) -> np.ndarray:
        """Columns (m,) int that may not be negative, without those that J ⪰ 0 implies."""
        others = self.nonnegative.copy()
        others[self.bodies] = False  # J ⪰ 0 implies m ≥ 0 and Ixx ≥ 0
        return np.flatnonzero(others)

    @cached_property
    def rows(self) -> Array:
        """(m, p): ``rows @ phi ≥ least`` are the signs and then the bounds."""
        unit = np.eye(self.size)
        stated = [row for row, _ in self.bounds]
        return np.vstack([unit[self.signed], *stated])

    @cached_property
    def scaled_rows(self) -> Array:
        """(m, p), the same of scaled parameters.

        Parameters that have only a sign are of scale 1.
        """
        return self.rows * self.scale

    @cached_property
    def least(self) -> Array:
        """Lower limits of the m rows."""
        return np.array([0.0] * len(self.signed) + [least for _, least in self.bounds])

    @cached_property
    def constraints(self) -> Strings:
        """Names of the constraints of each body and of each of the m rows, (nb + m,) str."""
        own = [*zip(self.names, self.bodies, strict=True)]
        within = []
        for row, _ in self.bounds:
            members = [name for name, at in own if row[at].any()]
            within.append(" + ".join(members))
        signs = [f"{self.columns[k]} ≥ 0" for k in self.signed]
        return (*self.names, *signs, *(f"[bounds] of {names}" for names in within))

    @cached_property
    def bounded(self) -> np.ndarray:
        """Which of the m rows are bounds, (m,) bool."""
        return np.arange(len(self.rows)) >= len(self.signed)

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
        """Whether parameter vectors are physically consistent, up to rounding.

        Parameters
        ----------
        phi : (..., p)
        tolerance : float
            Allowed violation of bodies and bounds, dimensionless.

        Returns
        -------
        (...) bool
        """
        slack = np.asarray(phi, float) @ self.rows.T - self.least
        inside: np.ndarray = np.all(slack >= -tolerance * self.bounded, axis=-1)
        real = self.margins(phi) >= -tolerance
        return inside & real.all(axis=-1)


@lru_cache(maxsize=4)
def physical_set(structure: Structure) -> PhysicalSet:
    """Return the set of physically consistent parameter vectors of this structure."""
    theta = structure.nominal[structure.inertial]
    heavy = theta[:, 9] > 0
    trace = theta[:, [0, 3, 5]].sum(1)
    stated = heavy & (trace > 0)  # a file may state no mass at all
    mass, length = natural_scale(theta)
    mass = np.where(stated, mass, 1.0)
    names = tuple(structure.bodies.values())
    lengths = np.where(stated, length, 0.1)
    bounds = tuple(_stated_bounds(structure, mass))
    return PhysicalSet(
        bodies=structure.inertial,
        nonnegative=structure.nonnegative,
        names=names,
        columns=structure.columns,
        mass=mass,
        length=lengths,
        bounds=bounds,
        functions=tuple(list_functions(structure)),
    )


def _stated_bounds(structure: Structure, mass: Array) -> Iterator[Bound]:
    """Yield the bounds of a sidecar on masses and centres, over a model's parameters.

    The mass ``m`` and the first moment ``h = m c`` are parameters, so that a bound of the mass and
    a box around the centre are linear. A payload is no part of its body here. Bodies that the
    model has not are passed over.

    Parameters
    ----------
    structure : Structure
    mass : (nb,) [kg]
        Scale of each body of the structure.
    """
    p = len(structure.columns)
    stems = [*structure.bodies]
    at = {body: stems.index(f"{body}.") for body in structure.robot.bodies if f"{body}." in stems}
    for bound in structure.robot.bounds:
        members = [at[body] for body in bound.bodies if body in at]
        if not members:
            continue
        m = np.zeros(p)
        m[structure.inertial[members, _MASS]] = 1.0
        if bound.mass is not None:
            yield from _between(m, 0.0 * m, bound.mass, 1.0)
        first = np.zeros((3, p))
        first[:, structure.inertial[members[0]][_FIRST]] = bound.rotation.T
        moment = first - np.outer(bound.rotation.T @ bound.origin, m)  # about the body's frame
        for k, span in enumerate(bound.box or ()):
            yield from _between(moment[k], m, span, float(mass[members[0]]))


def _between(
    value: Array, weight: Array, span: tuple[float, float], size: float
) -> Iterator[Bound]:
    """Yield the rows of ``low ≤ value ≤ high``, times a weight where there is one."""
    low, high = span
    width = (high - low) * size
    constant = not weight.any()
    for sign, end in ((1.0, low), (-1.0, high)):
        row = sign * (value - end * weight) / width
        yield row, sign * end / width if constant else 0.0


# The loss of the data in the parameters: a compressed least-squares problem.


@frozen
class LeastSquares:
    """Residual sum of squares of a linear model, ``‖R phi − z‖² + rss_min``.

    The three hundred thousand rows of a log enter the physical and the Bayesian stages only through
    these numbers. `R` may have a null space, and it is never squared: ``RᵀR`` loses half the
    digits.

    Attributes
    ----------
    R : (r, p) [torque / parameter], weighted rows
    z : (r,) [torque], weighted
    rss_min : float [torque²]
        Residual sum of squares that no parameter vector can remove.
    dof : float
        Samples minus rank: ``rss_min / dof`` estimates the noise variance.
    """

    R: Array
    z: Array
    rss_min: float
    dof: float

    @staticmethod
    def of_fit(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the loss that an estimate minimises, in its k parameters.

        Parameters
        ----------
        information : Information
            That was fitted.
        estimate : Estimate
        """
        F = estimate.estimator.loss(information, estimate)
        variance = float(estimate.weights @ estimate.rss) / max(estimate.dof, 1)
        rss = max(float(F[-1, -1] ** 2), variance * 1e-12)
        triangle = F[:-1, :-1]
        target = F[:-1, -1]
        dof = max(float(estimate.dof), 1.0)
        return LeastSquares(triangle, target, rss, dof)

    @staticmethod
    def likelihood(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the same for a posterior: it counts as many rows as are independent.

        To it data without noise have a little of it.
        """
        tau = float(np.linalg.norm(estimate.estimator.loss(information, estimate)[:, -1]))
        rss = max(float(estimate.weights @ estimate.rss), (ROUNDOFF * tau) ** 2)
        dof = max(information.rows / estimate.memory - len(estimate.kept), 1.0)
        return replace(LeastSquares.of_fit(information, estimate), rss_min=rss, dof=dof)

    @staticmethod
    def of_normal(mean: Array, covariance: Array, unknown: Array) -> LeastSquares:
        """Return the least squares of a normal distribution, in units of its standard deviations.

        Parameters
        ----------
        mean : (p,)
        covariance : (p, p)
        unknown : (p, d)
            Directions that it does not determine.
        """
        C = np.where(np.isfinite(covariance), covariance, 0.0)
        scale = or_one(root_diagonal(C))
        away = unknown / scale[:, None]
        # Directions have any length, and a basis leaves out those far shorter than others.
        hidden = scipy.linalg.orth(away / or_one(np.linalg.norm(away, axis=0)))
        shown = scipy.linalg.null_space(hidden.T) if hidden.size else np.eye(len(C))
        scales = np.outer(scale, scale)
        variance, axes = np.linalg.eigh(shown.T @ (C / scales) @ shown)
        # A direction with less than this share of the largest variance is known.
        largest = variance.max(initial=0.0)
        sd = np.sqrt(np.maximum(variance, 1e-14 * max(largest, 1.0)))
        rows = ((shown @ axes) / sd).T / scale
        return LeastSquares(rows, rows @ mean, rss_min=1.0, dof=1.0)

    def through(self, to_x: Array) -> LeastSquares:
        """Return the problem in phi, where the present parameters are ``to_x (p, q) phi``."""
        return replace(self, R=self.R @ to_x)

    def beside(self, rows: Array, aim: Array) -> LeastSquares:
        """Return the problem with further squares ``rows (m, p) phi − aim (m,)`` [torque]."""
        R = np.vstack([self.R, rows])
        z = np.concatenate([self.z, aim])
        return replace(
            self,
            R=R,
            z=z,
        )

    @property
    def variance(self) -> float:
        """Estimate of the noise variance [torque²]."""
        return self.rss_min / self.dof

    @property
    def unit(self) -> float:
        """Residual that counts as one.

        The noise sd [torque], or the rounding error if that is larger.
        """
        rounding = ROUNDOFF * np.linalg.norm(self.z)
        return float(max(np.sqrt(self.variance), rounding, np.finfo(float).tiny))

    def rss(self, phi: Array) -> Array:
        """Residual sum of squares (...) [torque²] of parameter vectors ``phi (..., p)``."""
        residual = np.asarray(phi) @ self.R.T - self.z
        return np.einsum("...r,...r->...", residual, residual) + self.rss_min


# Parameters that a model omits, fixes or ties, as constraints of a projection.
#
# Base parameters are ``G phi``, and the model says that they are ``value + M x``.


@frozen
class Fixed:
    """Independent combinations of parameters with their values; of no inertial parameter.

    Attributes
    ----------
    rows : (k, p)
    value : (k,)
    """

    rows: Array
    value: Array

    @staticmethod
    def none(size: int) -> Fixed:
        """Return the absence of fixed combinations, for a number of parameters."""
        return Fixed(np.zeros((0, size)), np.zeros(0))

    @cached_property
    def alone(self) -> np.ndarray:
        """Which combinations are of one parameter, (k,) bool."""
        return np.count_nonzero(self.rows, axis=1) == 1

    @property
    def parameters(self) -> np.ndarray:
        """The parameters that are held by themselves, (p,) bool."""
        return (self.rows[self.alone] != 0).any(axis=0)

    def impose(self, phi: Array) -> Array:
        """Return parameters (..., p), those that are held by themselves at exactly their values."""
        out = np.array(phi)
        rows = self.rows[self.alone]
        at = np.argmax(rows != 0, axis=1)
        coefficients = rows[np.arange(len(at)), at]
        out[..., at] = self.value[self.alone] / coefficients
        return out

    def span(self, scale: Array) -> tuple[Array, Array]:
        """Return the remaining freedom of scaled parameters ``phi = scale * x``.

        Returns
        -------
        origin : (p,)
        along : (p, p − k)
            Orthonormal directions.
        """
        k = len(self.rows)
        Q, R = np.linalg.qr((self.rows * scale).T, mode="complete")
        along = np.linalg.solve(R[:k].T, self.value)
        return Q[:, :k] @ along, Q[:, k:]


def find_fixed(region: PhysicalSet, G: Array, M: Array, value: Array) -> Fixed:
    """Return the combinations that a model omits, fixes or ties outside the bodies.

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
        # A sum of nonnegative values is zero only if every one is.
        parts = np.eye(len(row))[members] if signed and at == 0 else row[None]
        found |= {part.tobytes(): (part, float(at)) for part in parts}
    rows = np.array([row for row, _ in found.values()]).reshape(-1, region.size)
    return Fixed(rows, np.array([at for _, at in found.values()]))


# A fitted model, and the problem that it poses in the standard parameters of bodies.
#
# The information about base parameters becomes a problem in the full standard parameters,
# ``W_base G phi``, for the nearest physically consistent values and for the posterior.
#
# Omitted parameters are never free. Friction, rotors and other parameters of no body are exactly
# zero, or at their fixed value, or equal to the parameter that they are tied to. For bodies that
# may be impossible: a body whose mass were zero has no first moment. There its torque counts as
# error in full, and as no help in explaining the log.


@frozen
class FittedModel:
    """A model that was fitted to a robot, and its loss in the standard parameters.

    The model says that base parameters are ``fixed + M x``; the part of ``G phi`` outside the span
    of M is omitted, and does not enter its prediction.

    Attributes
    ----------
    structure : Structure
        With its b base and p standard parameters.
    submodel : Submodel
        The model, of m parameters x.
    whole, information : Information
        About all base parameters, and about the model's columns.
    estimate : Estimate
    """

    structure: Structure
    submodel: Submodel
    whole: Information
    information: Information
    estimate: Estimate

    @staticmethod
    def of(
        structure: Structure, submodel: Submodel, whole: Information, estimator: Estimator
    ) -> FittedModel:
        """Fit a model."""
        part = submodel.reduce(whole)
        return FittedModel(structure, submodel, whole, part, estimator.fit(part))

    @staticmethod
    def recall(
        structure: Structure, submodel: Submodel, whole: Information, estimate: Estimate
    ) -> FittedModel:
        """Return a model that was fitted before."""
        return FittedModel(structure, submodel, whole, submodel.reduce(whole), estimate)

    @cached_property
    def to_x(self) -> Array:
        """The model's parameters of standard ones, (m, p); tied columns take the mean."""
        return self.submodel.inverse @ self.structure.G

    @property
    def determined(self) -> bool:
        """Whether there are parameters and the motion determines each."""
        return 0 < len(self.submodel) == len(self.estimate.kept)

    @cached_property
    def data(self) -> LeastSquares:
        """The estimate's loss in the standard parameters, without the omitted parts."""
        return LeastSquares.of_fit(self.information, self.estimate).through(self.to_x)

    @cached_property
    def fixed(self) -> Fixed:
        """Combinations that the model omits, fixes or ties outside the bodies.

        Raises
        ------
        ValueError
            If it holds what no real robot has.
        """
        region = physical_set(self.structure)
        return find_fixed(region, self.structure.G, self.submodel.M, self.submodel.fixed)

    @cached_property
    def region(self) -> PhysicalSet:
        """The set of physically consistent values.

        Parameters that are fixed on their own need no sign.
        """
        region = physical_set(self.structure)
        nonnegative = region.nonnegative & ~self.fixed.parameters
        return replace(region, nonnegative=nonnegative)

    @cached_property
    def left_out(self) -> tuple[Array, Array]:
        """Torque of the omitted parts of the model, ``rows phi − aim``: (b, p) and (b,)."""
        R = self.whole.factor(self.estimate.weights)[:-1, :-1]
        M = self.submodel.M
        rest = R @ (np.eye(len(M)) - M @ self.submodel.inverse)
        return rest @ self.structure.G, rest @ self.submodel.fixed
