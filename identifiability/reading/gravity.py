"""Fit the direction of gravity: a tilted base loads the bodies differently."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import TypeAlias

import numpy as np
import pinocchio as pin
import scipy

from identifiability.effects.base import horizontal_axes
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.kinematics import turn

#: Widths of the two searches for a direction [rad].
WIDE: Tolerance = 0.3
NARROW: Tolerance = 0.03
#: Returns half the log of each joint's residual share (n,) under some gravity (3,) [m/s²].
Misfits: TypeAlias = Callable[[Array], Array]


def find_directions(stated: Array, misfits: Misfits, even: float, most: float) -> list[Array]:
    """Return the gravity (3,) [m/s²] of the stated size that fits best, and its opposite.

    It returns nothing if the best direction leaves more than `most`. The literal residual weighs
    joints by their squares. The evidence prefers the opposite at times.

    Parameters
    ----------
    stated : (3,) [m/s²]
        Gravity by the robot file.
    misfits : callable
    even : float
        Logs of the residual by which two directions are equally good.
    most : float
        Root of the sum of all residual shares.
    """
    size = float(np.linalg.norm(stated))
    down = stated / size

    def squares(direction: Array) -> float:
        gravity = size * (direction / np.linalg.norm(direction))
        return float(np.log(np.exp(2.0 * misfits(gravity)).sum()))

    # The sum of squares has a wide minimum [rad], the sum of the logs a narrow one.
    grid = list_directions(down)
    start = grid[int(np.argmin([squares(direction) for direction in grid]))]
    wide = refine_direction(start, squares, WIDE)
    if squares(wide) > 2.0 * np.log(most):
        return []
    best = tune_direction(size * wide / np.linalg.norm(wide), misfits)
    # Where weight acts along a slide alone, negative masses would fall upwards as well.
    mirrored = best - 2.0 * min(float(best @ down), 0.0) * down
    if squares(mirrored) <= squares(best) + even:
        best = mirrored
    return [best, tune_direction(-best, misfits)]


def tune_direction(gravity: Array, misfits: Misfits) -> Array:
    """Return the gravity (3,) [m/s²] near another one that fits best."""
    size = float(np.linalg.norm(gravity))

    def logs(direction: Array) -> float:
        unit = direction / np.linalg.norm(direction)
        return float(np.sum(misfits(size * unit)))

    direction = refine_direction(gravity / size, logs, NARROW)
    return size * (direction / np.linalg.norm(direction))


@frozen
class FirstZero:
    """A wrong encoder zero of the first joint, which acts as gravity turned about its axis.

    Attributes
    ----------
    joint : str
    angle : float [rad]
        By which its positions are too large.
    gravity : (3,) [m/s²]
        Gravity that acts as this zero does.
    """

    joint: str
    angle: float
    gravity: Array

    @staticmethod
    def near(robot: Robot, gravity: Array, misfits: Misfits) -> FirstZero | None:
        """Return the zero near another gravity (3,) that fits best; None if no zero acts.

        Only an arm that begins with one revolute joint has such a zero.
        """
        model = robot.model
        name = model.names[1]
        begins = [*model.parents][1:].count(0) == 1
        if robot.closed or robot.base is not None or not begins or name not in robot.joints:
            return None
        data = model.createData()
        pin.computeJointJacobians(model, data, pin.neutral(model))
        axis = pin.getJointJacobian(model, data, 1, pin.WORLD)[3:, 0]
        stated, found = (np.cross(axis, g) for g in (robot.gravity, gravity))
        if np.linalg.norm(stated) <= NEARLY * np.linalg.norm(robot.gravity):
            return None
        nearest = float(np.arctan2(axis @ np.cross(stated, found), stated @ found))

        def misfit(angle: float) -> float:
            return float(np.sum(misfits(turn(robot.gravity, angle * axis))))

        around = (nearest - NARROW, nearest + NARROW)
        angle = float(scipy.optimize.minimize_scalar(misfit, bounds=around, method="bounded").x)
        return FirstZero(name, angle, turn(robot.gravity, angle * axis))

    @property
    def text(self) -> str:
        """The zero in words, to follow a tilt."""
        side = "large" if self.angle > 0 else "small"
        return (
            f"positions of {self.joint} are {abs(self.angle):.3g} rad too {side}, "
            "which gives the same torque"
        )


def list_directions(stated: Array) -> list[Array]:
    """Return 26 directions (3,) about a stated unit vector: faces, edges and corners of a cube."""
    world = np.column_stack([*horizontal_axes(stated), stated])
    return [world @ d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)]


def refine_direction(start: Array, cost: Callable[[Array], float], width: float) -> Array:
    """Return the direction (3,) near a start at which a cost is least, not normalised."""
    axes = np.column_stack(horizontal_axes(start / np.linalg.norm(start)))
    simplex = width * np.vstack([np.zeros(2), np.eye(2)])
    options = {"maxfev": 40, "initial_simplex": simplex}

    def cost_of(x: Array) -> float:
        return cost(start + axes @ x)

    found = scipy.optimize.minimize(cost_of, simplex[0], method="Nelder-Mead", options=options)
    return start + axes @ found.x
