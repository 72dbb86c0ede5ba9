"""States that are not in the logs, but that the same robot could go through in the same ranges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot, complete_motion

#: States drawn; their mean squares are then known to a few percent.
STATES = 500

#: Share of states with the largest torques that is left out where loops may come near a singular
#: configuration: the torques of a handful of them would outweigh all others.
TRIMMED = 0.05


def unseen_regressor(
    structure: Structure,
    samples: Sequence[Prepared],
    rng: np.random.Generator,
    reach: float = 1.0,
) -> Array:
    """Return the regressor at states drawn from the ranges of the logs, (m, n, b).

    Position, velocity and acceleration of every actuated joint are uniform between the least and
    the largest value in the logs, independently of each other.

    Parameters
    ----------
    structure : Structure
        Its b base parameters are the columns.
    samples : sequence of Samples or LongSamples
    rng : numpy.random.Generator
    reach : float
        How much faster than in the logs; ranges of velocity grow by it, of acceleration by its
        square.
    """
    robot, columns = structure.robot, structure.base.kept
    motion = draw_states(robot, samples, rng, reach)
    if motion is None:
        return np.zeros((0, len(robot.actuated), len(columns)))
    W: Array = structure.model.regressor(robot, motion)[:, :, columns]
    if not robot.closed:
        return W
    length = np.sqrt(np.mean(W**2, axis=(0, 1)))
    size = np.linalg.norm(W / np.where(length > 0, length, 1.0), axis=(1, 2))
    kept: Array = W[size <= np.quantile(size, 1 - TRIMMED)]
    return kept


def draw_states(
    robot: Robot, samples: Sequence[Prepared], rng: np.random.Generator, reach: float = 1.0
) -> Motion | None:
    """Return the states; None if the loops close at none of them."""
    drawn = []
    lows = np.min([s.survey.low for s in samples], axis=0)
    highs = np.max([s.survey.high for s in samples], axis=0)
    for power, (low, high) in enumerate(zip(lows, highs, strict=True)):
        middle, half = 0.5 * (low + high), 0.5 * reach**power * (high - low)
        drawn.append(rng.uniform(middle - half, middle + half, (STATES, len(low))))
    try:
        return complete_motion(robot, np.arange(STATES, dtype=float), *drawn)
    except ClosureError:
        return None
