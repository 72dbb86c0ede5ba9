"""The set of parameter vectors that a real robot can have.

Every body has a positive semidefinite pseudo-inertia, friction and actuator inertia are not
negative, and masses and centres of mass are where the user says: linear matrix inequalities and
rows, one convex set, shared by the projection and by the posterior.
"""

from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
from identifiability.physical.bounds import Bounds
from identifiability.physical.pseudo_inertia import (
    BASIS,
    BodyCheck,
    check_body,
    entry_scale,
    scale_matrix,
)


@frozen
class PhysicalSet:
    """Parameter vectors of a real robot.

    Scaled parameters are ``phi / scale``: programs are solved in them.

    Attributes
    ----------
    bodies : (nb, 10) int
        Column of each inertial parameter of each body, in the order of `names.INERTIAL`.
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
    def ellipsoid_map(self) -> Array:
        """(e, 16, p): matrices ``ellipsoid_map @ phi`` that are positive as those of bodies are."""
        assert self.bounds is not None
        return self.bounds.ellipsoids

    @cached_property
    def ellipsoids(self) -> Array:
        """(e, 16, p), the same of scaled parameters."""
        maps: Array = self.ellipsoid_map * self.scale
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

    @property
    def ellipsoid_labels(self) -> tuple[str, ...]:
        """The e ellipsoids in words."""
        assert self.bounds is not None
        return self.bounds.ellipsoid_labels

    def within(self, phi: ArrayLike, tolerance: float = 1e-9) -> np.ndarray:
        """Whether bounds hold for parameter vectors (..., p): (..., k + e) bool."""
        values = np.asarray(phi, float)
        bounded = slice(len(self.signed), None)
        slack = values @ self.rows[bounded].T - self.least[bounded]
        matrices = np.einsum("eij,...j->...ei", self.ellipsoid_map, values)
        square = matrices.reshape(*matrices.shape[:-1], 4, 4)
        room = np.concatenate([slack, np.linalg.eigvalsh(square)[..., 0]], axis=-1)
        return np.asarray(room >= -tolerance)

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
        known = (*self.labels[len(self.signed) :], *self.ellipsoid_labels)
        bounds = (
            f"{label} does not hold."
            for label, held in zip(known, self.within(phi), strict=True)
            if not held
        )
        return (*bodies, *rows, *bounds)
