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

#: Degree of the pieces, and how many there are: alone, and of what goes with the velocity.
DEGREE, PIECES, PIECES_OF_TWO = 2, 4, 3
#: Speed that motions are taken to reach where no limit is stated [rad/s, m/s].
TYPICAL_SPEED = (2.0, 0.3)
#: What every function contains: its splines add up to one.
CONTAINED = ("torque_offset",)


def splines(u: Array, pieces: int = PIECES) -> Array:
    """Return quadratic B-splines of u (N,) between −1 and 1, (N, pieces + 2).

    Beyond its ends they go on as they end.
    """
    step = 2.0 / pieces
    knots = -1.0 + step * np.arange(-DEGREE, pieces + DEGREE + 1)
    inside = np.clip(u, -1.0, 1.0)
    found: Array = scipy.interpolate.BSpline.design_matrix(inside, knots, DEGREE).toarray()
    return found


def straight_beyond(u: Array, pieces: int = PIECES) -> Array:
    """Return the same splines of u (N,), which beyond their ends go straight on, (N, pieces + 2).

    At an end the slope of a curve is the difference of its two last values over a step.
    """
    found, over = splines(u, pieces), (np.abs(u) - 1.0).clip(min=0.0) * (pieces / 2.0)
    for end, before, here in ((-1, -2, u > 0), (0, 1, u < 0)):
        found[here, end] += over[here]
        found[here, before] -= over[here]
    return found


def fine_at_rest(speed: Array, largest: float) -> Array:
    """Return the root of speeds (N,) over the largest one: friction changes most at rest.

    Beyond the largest one it goes straight on, as splines do that are `straight_beyond`.
    """
    share = np.abs(speed) / largest
    found: Array = np.sign(speed) * np.where(share < 1.0, np.sqrt(share), 0.5 * (1.0 + share))
    return found


def largest_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed that an axis is taken to reach [rad/s or m/s]."""
    if axis.row is None:
        return TYPICAL_SPEED[axis.prismatic]
    used = axis.row != 0
    limit = float(np.abs(axis.row[used]) @ robot.speed_limits[used])
    return limit if np.isfinite(limit) and limit > 0 else TYPICAL_SPEED[axis.prismatic]


class SmoothFunction(Shaped):
    """``τ = f(u)``: quadratic splines of a coordinate from −1 to 1; a constant is one of them."""

    equation = "τ = f(u), f = Σ cₖ Bₖ"
    source = "[de Boor 1978; Eilers & Marx 1996]"
    supersedes = CONTAINED
    units = (("f", "N·m", "N"),)

    @abstractmethod
    def coordinate(self, at: Along) -> Array:
        """Return the coordinate, (N,)."""

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline."""
        del robot, axis
        return self.numbered(PIECES + DEGREE)

    def numbered(self, count: int) -> tuple[str, ...]:
        """Return so many kinds."""
        return tuple(f"{self.units[0][0]}{k + 1}" for k in range(count))

    def curves(self, at: Along) -> list[Array]:
        """Return the splines."""
        return list(splines(self.coordinate(at)).T)


class WithVelocity(SmoothFunction):
    """``τ = f₀(u) + f₁(u) sign q̇ + f₂(u) q̇``: splines of a coordinate, each for itself."""

    curves_apart = 3

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline and part."""
        del robot, axis
        return self.numbered(3 * (PIECES_OF_TWO + DEGREE))

    def curves(self, at: Along) -> list[Array]:
        """Return the splines, alone and times direction and speed."""
        columns, speed = splines(self.coordinate(at), PIECES_OF_TWO), at.speed[:, None]
        largest = largest_speed(at.robot, at.axis)
        return [*columns.T, *(columns * at.sign[:, None]).T, *(columns * speed / largest).T]


def fastest(span: Span) -> tuple[float, ...]:
    """Return the largest speed of the motions at an axis [rad/s or m/s]."""
    return (span.largest_speed,)
