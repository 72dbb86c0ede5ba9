"""The set of parameter vectors that a real robot can have.

Every body has a positive semidefinite pseudo-inertia, and friction and actuator inertia are not
negative: linear matrix inequalities and signs, one convex set, shared by the projection and by the
posterior.
"""

from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
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
    """

    bodies: np.ndarray
    nonnegative: np.ndarray
    names: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    mass: Array = field(default_factory=lambda: np.ones(1))
    length: Array = field(default_factory=lambda: np.full(1, 0.1))

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
        """(m, p): ``rows @ phi ≥ 0`` are the signs; a scale drops out of them."""
        rows: Array = np.eye(self.size)[self.signed]
        return rows

    @property
    def labels(self) -> tuple[str, ...]:
        """The m signs in words."""
        return tuple(f"{self.columns[j]} ≥ 0" for j in self.signed)

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
            for label, slack in zip(self.labels, phi[self.signed], strict=True)
            if slack < 0
        )
        return (*bodies, *rows)
