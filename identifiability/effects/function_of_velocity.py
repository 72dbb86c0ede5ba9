"""Torque that depends on the speed in a way that has no name here."""

import numpy as np

from identifiability.effects.effect import Along
from identifiability.effects.family import SPEEDS
from identifiability.effects.registry import declare
from identifiability.effects.smooth_function import (
    DEGREE,
    PIECES,
    SmoothFunction,
    fastest,
    fine_at_rest,
    largest_speed,
    straight_beyond,
)
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot


@declare(
    "an unnamed function of velocity",
    shapes=fastest,
    unnamed=True,
    flexible=True,
    told_by=SPEEDS,
    rank=30,
)
class FunctionOfVelocity(SmoothFunction):
    """``τ = f(q̇)``, smooth in the root of the speed but for a step at rest.

    Viscous and Coulomb friction and an offset are among its curves, at any speed. Its shape is the
    largest speed, beyond which it goes straight on.
    """

    name = "function_of_velocity"
    equation = "τ = f(q̇), f = Σ cₖ Bₖ(√|q̇/v| sign q̇) + c sign q̇"
    units = (("fv", "N·m", "N"),)
    curves_apart = 0

    def coordinate(self, at: Along) -> Array:
        """Return the root of the speed."""
        return fine_at_rest(at.speed, self.shape(at.robot, at.axis))

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return one for every spline, and one for the step."""
        del robot, axis
        return self.numbered(PIECES + DEGREE + 1)

    def curves(self, at: Along) -> list[Array]:
        """Return the splines and the step."""
        return [*straight_beyond(self.coordinate(at)).T, np.sign(at.speed)]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the limit of the speed [rad/s or m/s]."""
        return largest_speed(robot, axis)
