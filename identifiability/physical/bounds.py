"""What is known of masses and centres of mass: rows and cones beside those of real bodies.

The mass ``m`` and the first moment ``h = m c`` are parameters, so that all of it is convex: a
bound of the mass and a box around the centre are linear, and an ellipsoid is a cone of second
order, ``‖(h − m c₀) / r‖ ≤ m``, which is a matrix of four by four as that of a body is:
``[[m 1, u], [uᵀ, m]] ⪰ 0`` with ``u = (h − m c₀) / r`` [Boyd 2004, §4.6].
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.values import frozen
from identifiability.regression.structure import Structure
from identifiability.robot.description import Ellipsoid

_MASS, _FIRST = INERTIAL.index("m"), [INERTIAL.index(kind) for kind in ("mx", "my", "mz")]


@frozen
class Bounds:
    """Rows ``rows @ phi ≥ least`` and matrices ``ellipsoids @ phi ⪰ 0`` of p parameters.

    Rows are in units of the width between the lower bound and the upper one, matrices in units of
    the body's mass.

    Attributes
    ----------
    rows : (k, p)
    least : (k,)
    labels : (k,) str
    ellipsoids : (e, 16, p)
    ellipsoid_labels : (e,) str
    """

    rows: Array
    least: Array
    labels: tuple[str, ...]
    ellipsoids: Array
    ellipsoid_labels: tuple[str, ...]

    @staticmethod
    def none(size: int) -> Bounds:
        """Return the absence of bounds of so many parameters."""
        return Bounds(np.zeros((0, size)), np.zeros(0), (), np.zeros((0, 16, size)), ())

    def widen(self, size: int) -> Bounds:
        """Return the bounds of these parameters where others follow them, `size` in all."""
        p = self.rows.shape[1]
        rows, ellipsoids = (
            np.zeros((len(self.rows), size)),
            np.zeros((len(self.ellipsoids), 16, size)),
        )
        rows[:, :p], ellipsoids[:, :, :p] = self.rows, self.ellipsoids
        return Bounds(rows, self.least, self.labels, ellipsoids, self.ellipsoid_labels)


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
    ellipsoids: list[tuple[Array, str]] = []
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
        if bound.ellipsoid is not None:
            matrix = _arrow(bound.ellipsoid, moment, m) / mass[members[0]]
            ellipsoids.append((matrix, f"centre of {bound.bodies[0]} inside its ellipsoid"))
    return Bounds(
        np.array([row for row, _, _ in rows]).reshape(-1, p),
        np.array([least for _, least, _ in rows]),
        tuple(label for _, _, label in rows),
        np.array([matrix for matrix, _ in ellipsoids]).reshape(-1, 16, p),
        tuple(label for _, label in ellipsoids),
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


def _arrow(ellipsoid: Ellipsoid, moment: Array, m: Array) -> Array:
    """Return the map (16, p) to the matrix that is positive where the centre is inside."""
    u = (moment - np.outer(ellipsoid.centre, m)) / np.array(ellipsoid.radii)[:, None]
    matrix = np.zeros((4, 4, len(m)))
    matrix[np.arange(4), np.arange(4)] = m
    matrix[:3, 3] = matrix[3, :3] = u
    return matrix.reshape(16, -1)
