"""`Workspace`: whether a motion closes its loops, stays away from singularities and in its boxes.

Unlike the limits of joints these depend on the whole robot, so candidates that violate them are
punished while searching and refused at the end.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.loop_equations import loop_jacobian
from identifiability.robot.newton import LEAP, invert
from identifiability.workflows.excite.limits import Box, Limits

#: Share of a bound from which on the search keeps away from it.
INNER = 0.9


@frozen
class Workspace:
    """What candidates do outside their joints' limits.

    Attributes
    ----------
    open : (m,) int
        Samples whose loops do not close.
    condition : (m,)
        Largest condition number of the closure; 1 for an open chain.
    leaps : (m,) int
        Samples before which the dependent joints jump or pass a singular configuration.
    outside : (m,)
        Largest distance outside a box [m]; negative: the smallest distance inside.
    """

    open: np.ndarray
    condition: Array
    leaps: np.ndarray
    outside: Array

    def kept(self, bound: float) -> np.ndarray:
        """Return whether candidates stay within the workspace, (m,) bool."""
        closed = (self.open == 0) & (self.leaps == 0) & (self.condition <= bound)
        kept: np.ndarray = closed & (self.outside <= 0)
        return kept

    def cost(self, bound: float) -> Array:
        """Return what is added to the cost of candidates, (m,): nothing well inside."""
        with np.errstate(divide="ignore"):
            near = np.maximum(np.log(np.minimum(self.condition, 1e12) / (INNER * bound)), 0.0)
        room = np.maximum(self.outside + 1e-3, 0.0)  # a millimetre inside
        cost: Array = 20 * near**2 + 200 * room + 5.0 * (self.leaps > 0)
        return cost


def survey(
    robot: Robot, limits: Limits, motion: Motion, samples: int, count: int, step: float
) -> Workspace:
    """Return what candidates do, from the motion of all of them one after the other.

    Parameters
    ----------
    robot : Robot
    limits : Limits
    motion : Motion
        Of count × samples samples, less those whose loops do not close.
    samples, count : int
        Samples a candidate, and candidates.
    step : float [s]
        From sample to sample.
    """
    which = motion.kept // samples
    missing = samples - np.bincount(which, minlength=count)
    condition, leaps = np.ones(count), np.zeros(count, int)
    if robot.closed:
        each, sign = _closure(robot, motion, INNER * limits.closure_bound)
        np.maximum.at(condition, which, each)
        jump = _jumps(robot, motion, step) | (sign[1:] != sign[:-1])
        same = which[1:] == which[:-1]
        leaps = np.bincount(which[1:], jump & same, count).astype(int)
    outside = np.full(count, -np.inf)
    for box in limits.boxes:
        np.maximum.at(outside, which, _outside(robot, motion, box))
    return Workspace(missing, condition, leaps, outside)


def _closure(robot: Robot, motion: Motion, enough: float) -> tuple[Array, Array]:
    """Return condition number and sign of the determinant at each sample, (N,).

    Where the whole batch is far from singular its largest condition number will do.
    """
    if motion.condition <= enough and not motion.singular:
        return np.full(len(motion), motion.condition), np.ones(len(motion))
    A = loop_jacobian(robot, motion.q)[:, :, robot.dependent]
    return invert(A)[1], np.linalg.slogdet(A)[0]


def _jumps(robot: Robot, motion: Motion, step: float) -> np.ndarray:
    """Return whether each next sample is where the velocities do not lead, (N - 1,) bool."""
    mean = 0.5 * (motion.v[1:] + motion.v[:-1])
    led = robot.tree.integrate(motion.q[:-1], step * mean)
    far = np.zeros(len(led), bool)
    for j in robot.tree.joints:
        at = slice(j.iq, j.iq + j.nq)
        a, b = led[:, at], motion.q[1:, at]
        if j.kind in ("ball", "free"):  # a quaternion and its negative are one rotation
            a, b = a[:, -4:], b[:, -4:]
            b = b * np.where(np.sum(a * b, 1, keepdims=True) < 0, -1.0, 1.0)
        far |= np.abs(a - b).max(1) > LEAP
    return far


def _outside(robot: Robot, motion: Motion, box: Box) -> Array:
    """Return how far the point of a box is outside at each sample, (N,) [m]."""
    at = robot.tree.positions(motion.q, box.point)
    distance: Array = np.maximum(at - box.high, box.low - at).max(1)
    return distance
