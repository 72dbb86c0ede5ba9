"""The set of parameter vectors that a real robot can have.

Every body has a positive semidefinite pseudo-inertia, friction and actuator inertia are not
negative, and the user may bound masses and say where the material of a body can be. All of it is
linear matrix inequalities and rows ``A phi ≥ c``: one convex set, shared by the projection and by
the posterior.
"""

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
from identifiability.physical.pseudo_inertia import BASIS, BodyCheck, check_body, scale_matrix

Floats = NDArray[np.float64]


@frozen
class Hull:
    """A region that holds all the material of one body, as quadrics ``[r; 1]ᵀ Q [r; 1] ≥ 0``.

    Integrated over the body it gives ``tr(J Q) ≥ 0``, which is linear [Wensing 2017].

    Attributes
    ----------
    body : int
    quadrics : (k, 4, 4)
    """

    body: int
    quadrics: Floats

    @classmethod
    def box(cls, body: int, low: ArrayLike, high: ArrayLike) -> Self:
        """Axis-aligned box in the body frame, ``(x − low)(high − x) ≥ 0`` on each axis.

        Parameters
        ----------
        body : int
        low, high : (3,) [m]
        """
        lo, hi = np.asarray(low, float), np.asarray(high, float)
        if not (lo < hi).all():
            raise ValueError(
                f"hull of body {body}: the box from {lo.tolist()} to {hi.tolist()} m is empty; "
                "expected low < high on every axis; swap or widen them."
            )
        Q = np.zeros((3, 4, 4))
        for axis in range(3):
            Q[axis, axis, axis] = -1.0
            Q[axis, axis, 3] = Q[axis, 3, axis] = (lo[axis] + hi[axis]) / 2
            Q[axis, 3, 3] = -lo[axis] * hi[axis]
        return cls(body, Q)

    @classmethod
    def ellipsoid(cls, body: int, centre: ArrayLike, semi_axes: ArrayLike) -> Self:
        """Axis-aligned ellipsoid in the body frame.

        Parameters
        ----------
        body : int
        centre, semi_axes : (3,) [m]
        """
        c, a = np.asarray(centre, float), np.asarray(semi_axes, float)
        if not (a > 0).all():
            raise ValueError(
                f"hull of body {body}: semi-axes {a.tolist()} m were given; expected three "
                "positive lengths; give the half-widths of the ellipsoid."
            )
        Q = np.diag([*(-1 / a**2), 1 - np.sum((c / a) ** 2)])
        Q[:3, 3] = Q[3, :3] = c / a**2
        return cls(body, Q[None])


@frozen
class PhysicalSet:
    """Parameter vectors of a real robot.

    Attributes
    ----------
    bodies : (nb, 10) int
        Column of each inertial parameter of each body, in the order of `pseudo_inertia.INERTIAL`.
    nonnegative : (p,) bool
        Columns that may not be negative (friction, actuator inertia).
    names : (nb,) str
        Body names, for sentences.
    columns : (p,) str
        Parameter names, for sentences.
    mass, length : (nb,) [kg], [m]
        Scale in which margins are measured; take them from CAD or leave 1 kg and 0.1 m.
    mass_bounds : (nb, 2) [kg]
    hulls : tuple of Hull
    """

    bodies: NDArray[np.int64]
    nonnegative: NDArray[np.bool_]
    names: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    mass: Floats = field(default_factory=lambda: np.ones(1))
    length: Floats = field(default_factory=lambda: np.full(1, 0.1))
    mass_bounds: Floats = field(default_factory=lambda: np.array([[-np.inf, np.inf]]))
    hulls: tuple[Hull, ...] = ()

    def __post_init__(self) -> None:
        bodies = np.array(self.bodies, np.int64).reshape(-1, 10)
        nb, signs = len(bodies), np.array(self.nonnegative, bool)
        if bodies.size and (bodies.min() < 0 or bodies.max() >= signs.size):
            raise ValueError(
                f"physical set: body columns {bodies.min()} … {bodies.max()} were given for "
                f"{signs.size} parameters; expected indices into the parameter vector."
            )
        arrays: dict[str, NDArray[np.generic]] = {
            "bodies": bodies,
            "nonnegative": signs,
            "mass": np.broadcast_to(np.asarray(self.mass, float), nb).copy(),
            "length": np.broadcast_to(np.asarray(self.length, float), nb).copy(),
            "mass_bounds": np.broadcast_to(np.asarray(self.mass_bounds, float), (nb, 2)).copy(),
        }
        for name, array in arrays.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(
            self, "names", tuple(self.names) or tuple(f"body {k + 1}" for k in range(nb))
        )
        if not self.columns:
            object.__setattr__(self, "columns", tuple(f"parameter {j}" for j in range(signs.size)))
        self._check_bounds()

    def _check_bounds(self) -> None:
        for name, (low, high) in zip(self.names, self.mass_bounds, strict=True):
            if not (low <= high and high > 0):
                raise ValueError(
                    f"{name}: mass bounds [{low:g}, {high:g}] kg contradict each other; "
                    "expected low ≤ high and high > 0; widen them or leave them out."
                )

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.nonnegative.size

    @cached_property
    def root(self) -> Floats:
        """(nb, 4), the congruence by which each J becomes dimensionless."""
        return scale_matrix(self.mass, self.length)

    @cached_property
    def cone_map(self) -> Floats:
        """(nb, 16, p): ``cone_map @ phi`` are the dimensionless pseudo-inertias, flattened."""
        scaled = BASIS / (self.root[:, None, :, None] * self.root[:, None, None, :])
        rows = np.zeros((len(self.bodies), 16, self.size))
        for k, columns in enumerate(self.bodies):
            rows[k][:, columns] = scaled[k].reshape(10, 16).T
        return rows

    @cached_property
    def rows(self) -> tuple[Floats, Floats, tuple[str, ...]]:
        """``A (m, p)``, ``c (m,)``, labels with ``A phi ≥ c``: signs, mass bounds, hulls."""
        A: list[Floats] = []
        c: list[float] = []
        labels: list[str] = []
        unit = np.eye(self.size)
        others = self.nonnegative.copy()
        others[self.bodies] = False  # J ⪰ 0 implies m ≥ 0 and Ixx ≥ 0
        for j in np.flatnonzero(others):
            A.append(unit[j])
            c.append(0.0)
            labels.append(f"{self.columns[j]} ≥ 0")
        for name, columns, bounds in zip(self.names, self.bodies, self.mass_bounds, strict=True):
            for sign, bound, relation in ((1.0, bounds[0], "≥"), (-1.0, bounds[1], "≤")):
                if np.isfinite(bound):
                    A.append(sign * unit[columns[9]])
                    c.append(sign * bound)
                    labels.append(f"mass of {name} {relation} {bound:g} kg")
        for hull in self.hulls:
            for Q in hull.quadrics:
                row = np.zeros(self.size)
                row[self.bodies[hull.body]] = np.einsum("kij,ij->k", BASIS, Q)
                A.append(row)
                c.append(0.0)
                labels.append(f"{self.names[hull.body]} inside its hull")
        return np.array(A).reshape(-1, self.size), np.array(c), tuple(labels)

    def margins(self, phi: ArrayLike) -> Floats:
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

    def contains(self, phi: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether parameter vectors belong to a real robot, up to rounding.

        Parameters
        ----------
        phi : (..., p)
        tolerance : float
            Allowed violation, dimensionless for bodies and relative for rows.

        Returns
        -------
        (...) bool
        """
        values = np.asarray(phi, float)
        A, c, _ = self.rows
        slack = values @ A.T - c
        allowed = tolerance * (np.abs(values) @ np.abs(A).T + np.abs(c))
        inside: NDArray[np.bool_] = (slack >= -allowed).all(axis=-1)
        return inside & (self.margins(values) >= -tolerance).all(axis=-1)

    def check(self, phi: ArrayLike) -> tuple[BodyCheck, ...]:
        """Say of every body whether its parameters can be real.

        Parameters
        ----------
        phi : (p,)
        """
        values = np.asarray(phi, float)
        return tuple(
            check_body(values[columns], name)
            for name, columns in zip(self.names, self.bodies, strict=True)
        )

    def violations(self, phi: ArrayLike) -> tuple[str, ...]:
        """Everything that keeps a parameter vector out of the set, a sentence each.

        Parameters
        ----------
        phi : (p,)
        """
        values = np.asarray(phi, float)
        bodies = tuple(check.reason for check in self.check(values) if not check.feasible)
        A, c, labels = self.rows
        allowed = 1e-9 * (np.abs(A) @ np.abs(values) + np.abs(c))
        rows = tuple(
            f"{label} does not hold: it is missed by {-slack:.3g}."
            for label, slack, tol in zip(labels, A @ values - c, allowed, strict=True)
            if slack < -tol
        )
        return bodies + rows


def scale_from(
    phi: ArrayLike, bodies: Sequence[Sequence[int]] | NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Mass and length scales of the bodies of a nominal parameter vector, for `PhysicalSet`.

    Parameters
    ----------
    phi : (p,)
    bodies : (nb, 10) int

    Returns
    -------
    mass, length : (nb,) [kg], [m]
    """
    return pseudo_inertia.natural_scale(np.asarray(phi, float)[np.asarray(bodies)])
