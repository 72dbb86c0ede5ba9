"""Candidate motions within limits, their cost, and the search among them.

Many random candidates, the best of them improved one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property

import numpy as np
import scipy

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, complete_motion
from identifiability.simulation.motion import Trajectory

from .criteria import Known, Question
from .limits import CLEARANCE, Clearance, Drive, Limits, Workspace, nearness, survey

# Candidate motions: limits that a series keeps by construction, its motion and its cost.
#
# A candidate is a vector x of 2H + 1 numbers a joint: amplitudes of velocity in shares of the speed
# limit, and where in the room that is left the motion is centred. The series of any x is scaled
# down into the limits of position, speed and acceleration, so an optimiser needs no constraints
# [Swevers 1997]. Violations that depend on the whole robot (loops, singular configurations, drives)
# are penalised during the search and refused at the end.
#
# A closure or a regressor costs about as much for one sample as for a hundred, so gradients by
# finite differences are one batch: candidate and all its neighbours.


#: Times a harmonic at which peaks are searched. A trigonometric polynomial of degree H exceeds its
#: values at M even points by at most 1/cos(πH/M) [Ehlich 1964]: 0.3 % here.
FINENESS = 40


#: Cost of each sample at which unconnected bodies touch, and the step of its gradient. Distances
#: change by more than their rounding over this step.
TOUCHING: Tolerance = 4.0
NUDGE: Tolerance = 1e-3
#: Cost of a candidate whose loops do not close everywhere; more for each sample.
OPEN: Tolerance = 50.0


@frozen
class Series:
    """All finite Fourier series of one period within limits.

    Attributes
    ----------
    limits : Limits
    period : float [s]
    harmonics : int
        H.
    at_rest : bool
        Whether speed and acceleration are zero where the period begins and ends.
    """

    limits: Limits
    period: float
    harmonics: int
    at_rest: bool = False

    @property
    def looks(self) -> int:
        """Samples at which a search evaluates a candidate."""
        # The regressor has harmonics of its own.
        return 12 * self.harmonics

    @property
    def size(self) -> int:
        """Number of values of a candidate, ``n (2H + 1)``."""
        return len(self.limits.joints) * (2 * self.harmonics + 1)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return random candidates (count, size); every second one fills its limits."""
        x = rng.standard_normal((count, self.size))
        amplitudes = len(self.limits.joints) * 2 * self.harmonics
        level = np.exp(rng.uniform(-2.0, 0.5, count))
        level[::2] = 3.0  # beyond any limit, so scaled down to it
        x[:, :amplitudes] *= level[:, None]
        return x

    def series(self, x: Array) -> tuple[Array, Array]:
        """Return offsets (m, n) and velocity amplitudes (m, n, 2H) of candidates (m, size)."""
        m = len(x)
        n = len(self.limits.joints)
        H = self.harmonics
        limits = self.limits
        velocities = x[:, : 2 * n * H]
        speeds = limits.speed[:, None]
        amplitude = velocities.reshape(m, n, 2 * H) * speeds / np.sqrt(H)
        if self.at_rest:
            amplitude = _from_rest(amplitude)
        q, v, a = self._motion(np.zeros((m, n)), amplitude, FINENESS * H)
        top = q.max(1)
        bottom = q.min(1)
        over = 1 / np.cos(np.pi / FINENESS)
        half = 0.5 * over * (top - bottom)
        fast = over * np.abs(v).max(1)
        hard = over * np.abs(a).max(1)
        shares = half / limits.half_range, fast / limits.speed, hard / limits.acceleration
        used = np.max(shares, axis=0)
        scale = 1.0 / np.maximum(used, 1.0)
        room = np.maximum(limits.half_range - scale * half, 0.0)
        centre = limits.middle + np.tanh(x[:, 2 * n * H :]) * room
        return centre - 0.5 * scale * (top + bottom), scale[..., None] * amplitude

    def motion(self, x: Array, samples: int) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (m, samples, n) of candidates over one period."""
        return self._motion(*self.series(np.atleast_2d(x)), samples)

    def trajectory(self, x: Array, samples: int, name: str) -> Trajectory:
        """Return the trajectory of one candidate."""
        offset, amplitude = (part[0] for part in self.series(x[None]))
        sin, cos = np.split(amplitude, 2, axis=1)
        return Trajectory(name, self.period, samples, offset, sin, cos)

    def _motion(self, offset: Array, amplitude: Array, samples: int) -> tuple[Array, Array, Array]:
        (m, n), H = offset.shape, self.harmonics
        sin, cos = np.split(amplitude.reshape(m * n, 2 * H), 2, axis=1)
        many = Trajectory("", self.period, samples, offset.reshape(-1), sin, cos)
        motions = many.motion(many.times())
        q, v, a = (x.reshape(samples, m, n).transpose(1, 0, 2) for x in motions)
        return q, v, a


def _from_rest(amplitude: Array) -> Array:
    """Return the nearest velocity amplitudes (…, 2H) that begin without speed or acceleration.

    The amplitudes are those of sines and cosines of position. The first are changed so that the
    starting speed is zero. The second are changed so that the starting acceleration is zero.
    """
    sin, cos = np.split(amplitude, 2, axis=-1)
    order = np.arange(1, sin.shape[-1] + 1)
    cos = cos - (cos @ order)[..., None] * order / (order @ order)
    return np.concatenate([sin - sin.mean(-1, keepdims=True), cos], axis=-1)


@frozen
class Objective:
    """Cost of candidates of a `Series`.

    Attributes
    ----------
    question : Question
    known : Known
    series : Series
    samples : int
        At which a candidate is evaluated.
    drive : Drive, optional
        The drives with their limits, if any has one.
    """

    question: Question
    known: Known
    series: Series
    samples: int
    drive: Drive | None = None

    @property
    def limits(self) -> Limits:
        """Limits of the series."""
        return self.series.limits

    @cached_property
    def watched(self) -> tuple[Clearance | None, str]:
        """The pairs that may collide, or a sentence on why none is watched."""
        return Clearance.of(self.question.structure.robot)

    def __call__(self, x: Array) -> Array:
        """Return the costs of candidates (m, size), (m,)."""
        cost = self._alone(x)
        if self.watched[0] is not None:
            touching = nearness(self.gaps(x, self.samples)).sum(1)
            cost = cost + TOUCHING * touching
        return cost

    def _alone(self, x: Array) -> Array:
        """Return the costs without those of bodies that come near each other, (m,)."""
        # Samples of a batch at most: its regressor stays in the processor's cache.
        size = max(1, 2400 // self.samples)
        starts = range(0, len(x), size)
        parts = [self._batch(x[at : at + size]) for at in starts]
        return np.concatenate(parts)

    def gradient(self, x: Array, step: float = 1e-5) -> tuple[float, Array]:
        """Return the cost of one candidate and its gradient by forward differences."""
        moves = step * np.eye(len(x))
        cost = self._alone(np.vstack([x, x + moves]))
        slope: Array = (cost[1:] - cost[0]) / step
        if self.watched[0] is None:
            return float(cost[0]), slope
        gaps = self.gaps(x[None], self.samples)
        # Bodies farther apart than so many clearances do not come near each other by that.
        near = gaps[0] < 6 * CLEARANCE
        total = TOUCHING * float(nearness(gaps).sum())
        if near.any():
            moved = self.gaps(x + NUDGE * np.eye(len(x)), self.samples, near)
            touching = TOUCHING * nearness(moved).sum(1)
            slope = slope + (touching - total) / NUDGE
        return float(cost[0]) + total, slope

    def gaps(self, x: Array, samples: int, at: np.ndarray | None = None) -> Array:
        """Return the least distance of bodies that may collide, (m, samples) [m].

        It is infinite where nothing is watched, at samples whose loops do not close and, given
        `at` (samples,) bool, at the others.
        """
        x = np.atleast_2d(x)
        watched = self.watched[0]
        out = np.full(len(x) * samples, np.inf)
        motion = None if watched is None else self._complete(x, samples)
        if watched is not None and motion is not None:
            wanted = np.ones(samples, bool) if at is None else at
            rows = wanted[motion.kept % samples]
            out[motion.kept[rows]] = watched.gaps(motion.q[rows])
        return out.reshape(len(x), samples)

    def _complete(self, x: Array, samples: int) -> Motion | None:
        """Return the motion of all joints of candidates one after the other, where there is one."""
        q, v, a = (np.concatenate(part) for part in self.series.motion(x, samples))
        try:
            times = np.arange(len(q), dtype=float)
            return complete_motion(self.question.structure.robot, times, q, v, a)
        except ClosureError:
            return None

    def torque(self, x: Array, samples: int) -> Array:
        """Return the largest torque of each drive along a candidate, (n,); without limits none."""
        motion = self._complete(np.atleast_2d(x), samples)
        if motion is None or self.drive is None:
            return np.empty(0)
        return self.drive.predict(motion).max(0)

    def look(self, x: Array, samples: int) -> tuple[Array, Workspace]:
        """Return Gram matrices of logs and candidates together (m, k, k), and the workspace."""
        x = np.atleast_2d(x)
        known = self.known
        robot = self.question.structure.robot
        m = len(x)
        n = len(robot.actuated)
        motion = self._complete(x, samples)
        if motion is None:
            missing = np.full(m, samples)
            nowhere = np.full(m, np.inf)
            G = np.repeat(known.G[None], m, 0)
            return G, Workspace(missing, nowhere, missing, nowhere)
        step = self.series.period / samples
        space = survey(robot, self.limits, motion, samples, m, step, self.drive)
        W = self.question.model.all_sensors(robot, motion).take(self.question.columns, axis=2)
        sensors = W.shape[1] // n
        weights = np.tile(known.weights, sensors)
        W *= np.sqrt(weights * known.samples / samples)[:, None]
        if len(W) < m * samples:
            full = np.zeros((m * samples, *W.shape[1:]))
            full[motion.kept] = W
            W = full
        rows = W.reshape(m, samples * n * sensors, -1)
        # The product of one matrix with itself takes half of the work.
        return known.G + np.stack([own.T @ own for own in rows]), space

    def _batch(self, x: Array) -> Array:
        G, space = self.look(x, self.samples)
        bad = space.open > 0
        G[bad] = np.eye(G.shape[1])
        cost = self.question.criterion.cost(G) + space.cost(self.limits.closure_bound)
        return np.where(bad, OPEN * (1 + space.open / self.samples), cost)


# `search`: many random candidates, the best of them improved one after the other.
#
# BFGS copes with the kinks of peaks and singular values [Lewis 2013]. If it gets stuck at a kink,
# its curvature is discarded and estimated again.


#: Random candidates that are tried.
DRAWS = 128
#: Fall of the cost below which a start is stuck: the next one may get further.
STUCK: Tolerance = 2e-3


@frozen
class Search:
    """Result of a search.

    Attributes
    ----------
    found : tuple of (cost, x)
        The end of every start, best first; none if no random candidate closes its loops.
    draws : (DRAWS, size)
        Random candidates.
    costs : (DRAWS,)
        Theirs.
    evaluations : int
        Candidates whose cost was computed.
    """

    found: tuple[tuple[float, Array], ...]
    draws: Array
    costs: Array
    evaluations: int


class _SpentError(Exception):
    """Where no evaluations are left."""


def search(
    objective: Objective,
    rng: np.random.Generator,
    *,
    evaluations: int,
    say: Callable[[float, float], None],
) -> Search:
    """Return the best candidates.

    Parameters
    ----------
    objective : Objective
    rng : numpy.random.Generator
        Draws the starts.
    evaluations : int
        Candidates whose cost may be computed, after the random ones.
    say : callable(cost, share)
        Called after every step.
    """
    draws = objective.series.draw(DRAWS, rng)
    costs = objective(draws)
    found: list[tuple[float, Array]] = []
    spent = 0

    def look(x: Array) -> tuple[float, Array]:
        nonlocal spent
        if spent + len(x) + 1 > evaluations:
            raise _SpentError
        spent += len(x) + 1
        cost, slope = objective.gradient(x)
        if cost < found[-1][0]:
            found[-1] = cost, x.copy()
        say(min(cost for cost, _ in found), spent / evaluations)
        return cost, slope

    with suppress(_SpentError):
        for k in np.argsort(costs):
            if costs[k] >= OPEN:  # where loops do not close there is no slope
                break
            found.append((float(costs[k]), draws[k]))
            before = np.inf
            while before - found[-1][0] > STUCK:
                before, x = found[-1]
                scipy.optimize.minimize(
                    look,
                    x,
                    jac=True,
                    method="BFGS",
                    options={"gtol": 1e-4},
                )
    found.sort(key=lambda pair: pair[0])
    return Search(tuple(found), draws, costs, DRAWS + spent)
