"""What candidate motions do beyond the limits of single joints: loops, leaps, boxes, drives."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.dependence import invert, passes_singular
from identifiability.robot.loop_equations import loop_jacobian
from identifiability.robot.newton import LEAP
from identifiability.workflows.excite.drive import Drive
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
    load : (m,)
        Largest share of a drive's torque or power that is asked for; zero where none is stated.
    """

    open: np.ndarray
    condition: Array
    leaps: np.ndarray
    outside: Array
    load: Array

    def kept(self, bound: float) -> np.ndarray:
        """Return whether candidates stay within the workspace, (m,) bool."""
        closed = (self.open == 0) & (self.leaps == 0) & (self.condition <= bound)
        kept: np.ndarray = closed & (self.outside <= 0) & (self.load <= 1)
        return kept

    def cost(self, bound: float) -> Array:
        """Return what is added to the cost of candidates, (m,): nothing well inside."""
        with np.errstate(divide="ignore"):
            near = np.maximum(np.log(np.minimum(self.condition, 1e12) / (INNER * bound)), 0.0)
        room = np.maximum(self.outside + 1e-3, 0.0)  # a millimetre inside
        heavy = np.maximum(np.log(np.maximum(self.load, INNER) / INNER), 0.0)
        cost: Array = 20 * near**2 + 200 * room + 5.0 * (self.leaps > 0) + 20 * heavy
        return cost


def survey(
    robot: Robot,
    limits: Limits,
    motion: Motion,
    samples: int,
    count: int,
    step: float,
    drive: Drive | None = None,
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
    drive : Drive, optional
    """
    which = motion.kept // samples
    missing = samples - np.bincount(which, minlength=count)
    condition, leaps = np.ones(count), np.zeros(count, int)
    if robot.closed:
        each, passed = _closure(robot, motion, INNER * limits.closure_bound)
        np.maximum.at(condition, which, each)
        jump = _jumps(robot, motion, step) | passed
        same = which[1:] == which[:-1]
        leaps = np.bincount(which[1:], jump & same, count).astype(int)
    outside = np.full(count, -np.inf)
    for box in limits.boxes:
        np.maximum.at(outside, which, _outside(robot, motion, box))
    load = np.zeros(count)
    if drive is not None:
        np.maximum.at(load, which, drive.load(motion))
    return Workspace(missing, condition, leaps, outside, load)


def _closure(robot: Robot, motion: Motion, enough: float) -> tuple[Array, np.ndarray]:
    """Return the condition number (N,), and whether a singular pose is before each next sample.

    Where the whole batch is far from singular its largest condition number will do.
    """
    if motion.condition <= enough and not motion.singular:
        return np.full(len(motion), motion.condition), np.zeros(len(motion) - 1, bool)
    A = loop_jacobian(robot, motion.q)[:, :, robot.dependent]
    return invert(A)[1], passes_singular(A)


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
