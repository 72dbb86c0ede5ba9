"""The direction of gravity that fits the torque best: other bodies act where a base is tilted."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import TypeAlias

import numpy as np
import scipy

from identifiability.effects.base import horizontal_axes
from identifiability.foundation.names import Array

#: Returns half the log of each joint's residual share (n,) under some gravity (3,) [m/s²].
Misfits: TypeAlias = Callable[[Array], Array]


def find_gravity(stated: Array, misfits: Misfits, even: float) -> Array:
    """Return the gravity (3,) [m/s²] of the stated size that fits best.

    Parameters
    ----------
    stated : (3,) [m/s²]
        Gravity by the robot file.
    misfits : callable
    even : float
        Logs of the residual by which two directions are equally good.
    """
    size = float(np.linalg.norm(stated))
    stated = stated / size

    def along(direction: Array) -> Array:
        return np.asarray(size * (direction / np.linalg.norm(direction)))

    def squares(direction: Array) -> float:
        return float(np.log(np.exp(2.0 * misfits(along(direction))).sum()))

    def logs(direction: Array) -> float:
        return float(np.sum(misfits(along(direction))))

    grid = list_directions(stated)
    best = grid[int(np.argmin([squares(direction) for direction in grid]))]
    # The sum of squares has a wide minimum [rad], the sum of the logs a narrow one.
    for width, cost in ((0.3, squares), (0.03, logs)):
        found = refine_direction(best, cost, width)
        best = along(found) / size
        # Where weight acts along a slide alone, negative masses would fall upwards as well.
        down = best - 2.0 * min(float(best @ stated), 0.0) * stated
        if squares(down) <= squares(best) + even:
            best = down
    return along(best)


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
    return np.asarray(start + axes @ found.x)
