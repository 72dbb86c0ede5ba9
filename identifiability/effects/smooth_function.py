"""Torque along a joint of which nothing is known but what it depends on: smooth functions.

A diagnosis asks for them where no name explains what is left, and says that they have none.
"""

from abc import abstractmethod

import numpy as np
import scipy

from identifiability.effects.effect import Along, Shaped
from identifiability.effects.family import Span
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: Degree of the pieces, and how many there are along one coordinate, and along each of two.
DEGREE, PIECES, PIECES_OF_TWO = 2, 4, 3
#: Speed that motions are taken to reach where no limit is stated [rad/s, m/s].
TYPICAL_SPEED = (2.0, 0.3)


def splines(u: Array, pieces: int = PIECES) -> Array:
    """Return quadratic B-splines of u (N,) between −1 and 1, (N, pieces + 2).

    Beyond its ends they go on as they end.
    """
    step = 2.0 / pieces
    knots = -1.0 + step * np.arange(-DEGREE, pieces + DEGREE + 1)
    inside = np.clip(u, -1.0, 1.0)
    found: Array = scipy.interpolate.BSpline.design_matrix(inside, knots, DEGREE).toarray()
    return found


def fine_at_rest(speed: Array, largest: float) -> Array:
    """Return the root of speeds (N,) over the largest one: friction changes most at rest."""
    found: Array = np.sign(speed) * np.sqrt(np.abs(speed) / largest)
    return found


def largest_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed that an axis is taken to reach [rad/s or m/s]."""
    if axis.row is None:
        return TYPICAL_SPEED[axis.prismatic]
    used = axis.row != 0
    limit = float(np.abs(axis.row[used]) @ robot.speed_limits[used])
    return limit if np.isfinite(limit) and limit > 0 else TYPICAL_SPEED[axis.prismatic]


class SmoothFunction(Shaped):
    """``τ = f(u)``: quadratic splines of one coordinate, −1 … 1, or of two."""

    equation = "τ = f(u), f = Σ cₖ Bₖ"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    units = (("f", "N·m", "N"),)

    @abstractmethod
    def coordinates(self, at: Along) -> tuple[Array, ...]:
        """Return the one or two coordinates, (N,) each."""

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline."""
        del robot, axis
        return self.numbered(PIECES + DEGREE)

    def numbered(self, count: int) -> tuple[str, ...]:
        """Return so many kinds."""
        return tuple(f"{self.units[0][0]}{k + 1}" for k in range(count))

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, or their products."""
        found = self.coordinates(at)
        if len(found) == 1:
            return list(splines(found[0]).T)
        first, second = (splines(u, PIECES_OF_TWO) for u in found)
        return list((first[:, :, None] * second[:, None, :]).reshape(len(first), -1).T)


class OfTwo(SmoothFunction):
    """``τ = f(u, w)``: products of splines of two coordinates."""

    equation = "τ = f(u, w), f = Σ cₖₗ Bₖ Bₗ"

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every product."""
        del robot, axis
        return self.numbered((PIECES_OF_TWO + DEGREE) ** 2)


def fastest(span: Span) -> tuple[float, ...]:
    """Return the largest speed of the motions at an axis [rad/s or m/s]."""
    return (span.largest_speed,)
