"""The set of parameter vectors that a real robot can have.

Every body has a positive semidefinite pseudo-inertia, friction and actuator inertia are not
negative, and masses and centres of mass are where the user says: linear matrix inequalities and
rows, one convex set, shared by certificate, projection and posterior.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike

from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.values import frozen
from identifiability.physical import pseudo_inertia
from identifiability.physical.pseudo_inertia import (
    BASIS,
    check_body,
    entry_scale,
    natural_scale,
    scale_matrix,
)
from identifiability.regression.reduction import list_functions
from identifiability.regression.structure import Structure

_MASS, _FIRST = GROUPED_KINDS.index("m"), [GROUPED_KINDS.index(kind) for kind in ("mx", "my", "mz")]

#: A row (p,) of parameters, what its product may not fall below, and both in words: in units of
#: the width between two bounds.
Bound = tuple[Array, float, str]


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
    bounds : tuple of Bound
        What is known of masses and centres of mass.
    functions : tuple of (k,) int
        Columns of each function that was learned: one unit of each is as much torque.
    """

    bodies: np.ndarray
    nonnegative: np.ndarray
    names: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    mass: Array = field(default_factory=lambda: np.ones(1))
    length: Array = field(default_factory=lambda: np.full(1, 0.1))
    bounds: tuple[Bound, ...] = ()
    functions: tuple[np.ndarray, ...] = ()

    def __post_init__(self) -> None:
        nb = len(self.bodies)
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
        """(m, p): ``rows @ phi ≥ least`` are the signs and then the bounds."""
        rows: Array = np.vstack([np.eye(self.size)[self.signed], *[row for row, *_ in self.bounds]])
        return rows

    @cached_property
    def scaled_rows(self) -> Array:
        """(m, p), the same of scaled parameters; a scale drops out of signs."""
        rows = self.rows.copy()
        rows[self.bounded] *= self.scale
        return rows

    @cached_property
    def least(self) -> Array:
        """What the m rows may not fall below."""
        return np.array([0.0] * len(self.signed) + [least for _, least, _ in self.bounds])

    @cached_property
    def bounded(self) -> np.ndarray:
        """Which of the m rows are bounds, (m,) bool."""
        mask: np.ndarray = np.arange(len(self.rows)) >= len(self.signed)
        return mask

    @property
    def labels(self) -> tuple[str, ...]:
        """The m signs and bounds in words."""
        signs = (f"{self.columns[j]} ≥ 0" for j in self.signed)
        return (*signs, *(label for *_, label in self.bounds))

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
            Allowed violation of bodies and bounds, dimensionless.

        Returns
        -------
        (...) bool
        """
        slack = np.asarray(phi, float) @ self.rows.T - self.least
        inside = (slack >= -tolerance * self.bounded).all(axis=-1)
        return np.asarray(inside & (self.margins(phi) >= -tolerance).all(axis=-1))

    def violations(self, phi: Array) -> tuple[str, ...]:
        """Everything that keeps parameters ``phi (p,)`` out of the set, a sentence each."""
        pairs = zip(self.names, self.bodies, strict=True)
        checks = [check_body(phi[columns], name) for name, columns in pairs]
        slack = zip(self.labels, self.rows @ phi - self.least, strict=True)
        return (
            *(check.reason for check in checks if not check.feasible),
            *(f"{label} does not hold." for label, room in slack if room < 0),
        )


@lru_cache(maxsize=4)
def physical_set(structure: Structure) -> PhysicalSet:
    """Return the parameter vectors that a real robot of this structure can have."""
    theta = structure.nominal[structure.inertial]
    stated = (theta[:, 9] > 0) & (theta[:, [0, 3, 5]].sum(1) > 0)  # a file may state no mass at all
    mass, length = natural_scale(theta)
    mass = np.where(stated, mass, 1.0)
    return PhysicalSet(
        bodies=structure.inertial,
        nonnegative=structure.nonnegative,
        names=tuple(structure.bodies.values()),
        columns=structure.columns,
        mass=mass,
        length=np.where(stated, length, 0.1),
        bounds=tuple(_stated_bounds(structure, mass)),
        functions=tuple(list_functions(structure)),
    )


def _stated_bounds(structure: Structure, mass: Array) -> Iterator[Bound]:
    """Yield what the sidecar of a robot says of masses and centres, over a model's parameters.

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
        title = "total mass" if len(bound.bodies) > 1 else f"mass of {bound.bodies[0]}"
        if bound.mass is not None:
            yield from _between(m, 0.0 * m, bound.mass, 1.0, title, "kg")
        first = np.zeros((3, p))
        first[:, structure.inertial[members[0]][_FIRST]] = bound.rotation.T
        moment = first - np.outer(bound.rotation.T @ bound.origin, m)  # about the body's frame
        for k, span in enumerate(bound.box or ()):
            title = f"{'xyz'[k]} of the centre of {bound.bodies[0]}"
            yield from _between(moment[k], m, span, float(mass[members[0]]), title, "m")


def _between(
    value: Array, weight: Array, span: tuple[float, float], size: float, title: str, unit: str
) -> Iterator[Bound]:
    """Yield the rows of ``low ≤ value ≤ high``, times a weight where there is one."""
    low, high = span
    width = (high - low) * size
    constant = not weight.any()
    for sign, end, relation in ((1.0, low, "≥"), (-1.0, high, "≤")):
        row = sign * (value - end * weight) / width
        yield row, sign * end / width if constant else 0.0, f"{title} {relation} {end:g} {unit}"
