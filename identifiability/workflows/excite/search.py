"""Candidate motions, what they keep by construction and cost, and the search among them.

Many random starts, the best few improved, these to their ends, the best first.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, cast, get_args

import numpy as np
from scipy.optimize import minimize

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.simulation.motion import Trajectory
from identifiability.workflows.excite.criteria import Known, Question
from identifiability.workflows.excite.limits import (
    Clearance,
    Drive,
    Limits,
    Workspace,
    nearness,
    survey,
)
from identifiability.workflows.excite.rules import RULES

# Candidate motions: what a series keeps by construction, what it does, and what it costs.
#
# A candidate is a vector x of 2H + 1 numbers a joint: amplitudes of velocity in shares of the
# speed limit, and where in the room that is left the motion is centred. Whatever x is, its series
# is scaled down into the limits of position, speed and acceleration, so an optimiser needs no
# constraints [Swevers 1997]. What depends on the whole robot (loops, singular configurations,
# boxes) is punished while searching and refused at the end.
#
# A closure or a regressor costs about as much for one sample as for a hundred, so gradients by
# finite differences are one batch: candidate and all its neighbours.


#: Times a harmonic at which peaks are looked for. A trigonometric polynomial of degree H exceeds
#: its values at M even points by at most 1/cos(πH/M) [Ehlich 1964]: 0.3 % here.
FINENESS = 40
OVERSHOOT = float(1 / np.cos(np.pi / FINENESS))


#: Cost of each sample at which bodies touch that are not joined, and the step of its gradient, over
#: which distances change by more than their rounding.
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
        """Samples at which a search looks at a candidate."""
        # Samples at which the search looks, for each harmonic; the regressor has
        # harmonics of its own.
        return 12 * self.harmonics

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.limits.joints)

    @property
    def size(self) -> int:
        """Numbers a candidate has, ``n (2H + 1)``."""
        return self.joints * (2 * self.harmonics + 1)

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return random candidates (count, size); every second one fills its limits."""
        x = rng.standard_normal((count, self.size))
        amplitudes = self.joints * 2 * self.harmonics
        level = np.exp(rng.uniform(-2.0, 0.5, count))
        level[::2] = 3.0  # beyond any limit, so scaled down to it
        x[:, :amplitudes] *= level[:, None]
        return x

    def series(self, x: Array) -> tuple[Array, Array]:
        """Return offsets (m, n) and velocity amplitudes (m, n, 2H) of candidates (m, size)."""
        m, n, H = len(x), self.joints, self.harmonics
        limits = self.limits
        amplitude = x[:, : 2 * n * H].reshape(m, n, 2 * H) * limits.speed[:, None] / np.sqrt(H)
        if self.at_rest:
            amplitude = _from_rest(amplitude)
        q, v, a = self._motion(np.zeros((m, n)), amplitude, FINENESS * H)
        top, bottom = q.max(1), q.min(1)
        half = 0.5 * OVERSHOOT * (top - bottom)
        used = np.max(
            [
                half / limits.half_range,
                OVERSHOOT * np.abs(v).max(1) / limits.speed,
                OVERSHOOT * np.abs(a).max(1) / limits.acceleration,
            ],
            axis=0,
        )
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

    def complete(self, robot: Robot, x: Array, samples: int) -> Motion | None:
        """Return the motion of all joints of candidates one after the other, if loops close."""
        q, v, a = (part.reshape(-1, self.joints) for part in self.motion(x, samples))
        try:
            return complete_motion(robot, np.arange(len(q), dtype=float), q, v, a)
        except ClosureError:
            return None

    def survey(
        self, robot: Robot, motion: Motion, x: Array, samples: int, drive: Drive | None
    ) -> Workspace:
        """Return what candidates do beyond the limits of single joints."""
        step = self.period / samples
        return survey(robot, self.limits, motion, samples, len(x), step, drive)

    def _motion(self, offset: Array, amplitude: Array, samples: int) -> tuple[Array, Array, Array]:
        m, n, H = len(offset), self.joints, self.harmonics
        sin, cos = np.split(amplitude.reshape(m * n, 2 * H), 2, axis=1)
        many = Trajectory("", self.period, samples, offset.reshape(-1), sin, cos)
        q, v, a = (x.reshape(samples, m, n).transpose(1, 0, 2) for x in many.motion(many.times()))
        return q, v, a


def _from_rest(amplitude: Array) -> Array:
    """Return the nearest velocity amplitudes (…, 2H) that begin without speed or acceleration.

    The amplitudes are those of sines and cosines of position, so the first sum up to no speed, and
    the second, times their harmonics, to no acceleration.
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
    """

    question: Question
    known: Known
    series: Series
    samples: int

    @property
    def limits(self) -> Limits:
        """Limits of the series."""
        return self.series.limits

    @cached_property
    def drive(self) -> Drive | None:
        """What the drives can do, if it was stated."""
        return Drive.of(self.question.structure.robot, self.limits)

    @cached_property
    def watched(self) -> tuple[Clearance | None, str]:
        """What of the robot may collide, or the sentence that says why nothing is watched."""
        return Clearance.of(self.question.structure.robot)

    def __call__(self, x: Array) -> Array:
        """Return the costs of candidates (m, size), (m,)."""
        cost = self._alone(x)
        if self.watched[0] is not None:
            cost = cost + TOUCHING * nearness(self.gaps(x, self.samples)).sum(1)
        return cost

    def _alone(self, x: Array) -> Array:
        """Return the costs without those of bodies that come near each other, (m,)."""
        # Samples of a batch at most: its regressor stays in the processor's cache.
        size = max(1, 2400 // self.samples)
        parts = [self._batch(x[at : at + size]) for at in range(0, len(x), size)]
        return np.concatenate(parts)

    def gradient(self, x: Array, step: float = 1e-5) -> tuple[float, Array]:
        """Return the cost of one candidate and its gradient by forward differences."""
        cost = self._alone(np.vstack([x, x + step * np.eye(len(x))]))
        slope: Array = (cost[1:] - cost[0]) / step
        if self.watched[0] is None:
            return float(cost[0]), slope
        gaps = self.gaps(x[None], self.samples)
        # Bodies farther apart than so many clearances do not come near each other by
        # that.
        near = (
            gaps[0] < 3.0 * RULES.clearance
        )  # a neighbour is not far: the others stay where they are
        total = TOUCHING * float(nearness(gaps).sum())
        if near.any():
            moved = self.gaps(x + NUDGE * np.eye(len(x)), self.samples, near)
            slope = slope + (TOUCHING * nearness(moved).sum(1) - total) / NUDGE
        return float(cost[0]) + total, slope

    def gaps(self, x: Array, samples: int, at: np.ndarray | None = None) -> Array:
        """Return the least distance of bodies that may collide, (m, samples) [m].

        It is infinite where nothing is watched, at samples whose loops do not close and, given
        `at` (samples,) bool, at the others.
        """
        x, watched = np.atleast_2d(x), self.watched[0]
        out = np.full(len(x) * samples, np.inf)
        motion = None if watched is None else self._complete(x, samples)
        if watched is not None and motion is not None:
            wanted = np.ones(samples, bool) if at is None else at
            rows = wanted[motion.kept % samples]
            out[motion.kept[rows]] = watched.gaps(motion.q[rows])
        return out.reshape(len(x), samples)

    def _complete(self, x: Array, samples: int) -> Motion | None:
        """Return the motion of all joints of candidates one after the other, where there is one."""
        return self.series.complete(self.question.structure.robot, x, samples)

    def look(self, x: Array, samples: int) -> tuple[Array, Workspace]:
        """Return Gram matrices of logs and candidates together (m, k, k), and the workspace."""
        x = np.atleast_2d(x)
        known, robot = self.known, self.question.structure.robot
        m, n = len(x), len(robot.actuated)
        motion = self._complete(x, samples)
        if motion is None:
            missing = np.full(m, samples)
            nowhere = np.full(m, np.inf)
            G = np.repeat(known.G[None], m, 0)
            return G, Workspace(missing, nowhere, missing, nowhere, nowhere)
        space = self.series.survey(robot, motion, x, samples, self.drive)
        W = self.question.model.regressor(robot, motion)[:, :, self.question.columns]
        W = W * np.sqrt(known.weights * known.samples / samples)[:, None]
        full = W if len(motion) == m * samples else _padded(W, motion.kept, m * samples)
        rows = full.reshape(m, samples * n, -1)
        return known.G + rows.transpose(0, 2, 1) @ rows, space

    def _batch(self, x: Array) -> Array:
        G, space = self.look(x, self.samples)
        bad = space.open > 0
        G[bad] = np.eye(G.shape[1])
        cost = self.question.criterion.cost(G) + space.cost(self.limits.closure_bound)
        closed: Array = np.where(bad, OPEN * (1 + space.open / self.samples), cost)
        return closed


def _padded(W: Array, kept: np.ndarray, rows: int) -> Array:
    full = np.zeros((rows, *W.shape[1:]))
    full[kept] = W
    return full


# `search`: many random starts, the best few improved, these to their ends, the best first.
#
# BFGS copes with the kinks that peaks and singular values make [Lewis 2013]; its curvature is
# thrown away when it gets stuck at one, and found again from there.


End = Literal["converged", "evaluations", "time"]

#: Random candidates that are tried, and how many of them are improved.
DRAWS = 128
STARTS = 3
#: Rounds of BFGS on the best start, or the next one where that has converged.
ROUNDS = 4


@frozen
class Iteration:
    """One iteration: which start, how many iterations before it, and the cost so far."""

    start: int
    iteration: int
    cost: float


@frozen
class Search:
    """What was found.

    Attributes
    ----------
    found : tuple of (cost, x)
        The end of every start, best first; none if no random candidate closes its loops.
    draws : (DRAWS, size)
        Random candidates.
    costs : (DRAWS,)
        Theirs.
    steps : tuple of Iteration
    evaluations : int
        Candidates whose cost was computed.
    end : {"converged", "evaluations", "time"}
        What ended it; only time makes it depend on the machine.
    """

    found: tuple[tuple[float, Array], ...]
    draws: Array
    costs: Array
    steps: tuple[Iteration, ...]
    evaluations: int
    end: End


class _StoppedError(Exception):
    """Where a search was ended from outside."""


@dataclass
class _Run:
    """The best candidate of one start so far."""

    objective: Objective
    number: int
    x: Array
    cost: float
    deadline: float
    say: Callable[[float], None]
    allowed: float = 0.0
    iterations: int = 0
    evaluations: int = 0
    steps: list[Iteration] = field(default_factory=list)

    def improve(self, iterations: int) -> End:
        """Go on for some iterations of BFGS; return what ended them."""
        how = {"jac": True, "method": "BFGS", "options": {"maxiter": iterations, "gtol": 1e-4}}
        try:
            minimize(self._gradient, self.x, callback=self._count, **how)
        except _StoppedError as stop:
            return cast("End", str(stop))
        return "converged"

    def _gradient(self, x: Array) -> tuple[float, Array]:
        if time.monotonic() > self.deadline:
            raise _StoppedError("time")
        if self.evaluations + len(x) + 1 > self.allowed:
            raise _StoppedError("evaluations")
        cost, slope = self.objective.gradient(x)
        self.evaluations += len(x) + 1
        if cost < self.cost:
            self.cost, self.x = cost, x.copy()
        return cost, slope

    def _count(self, _x: Array) -> None:
        self.iterations += 1
        self.steps.append(Iteration(self.number, self.iterations, self.cost))
        self.say(self.cost)


def search(
    objective: Objective,
    rng: np.random.Generator,
    *,
    iterations: int,
    evaluations: float,
    time_limit: float,
    say: Callable[[float, float], None],
) -> Search:
    """Return the best candidates.

    Parameters
    ----------
    objective : Objective
    rng : numpy.random.Generator
        Draws the starts.
    iterations : int
        Of BFGS a round.
    evaluations : float
        Candidates whose cost may be computed, after the random ones.
    time_limit : float [s]
        After it the search stops wherever it is, and depends on the machine.
    say : callable(cost, share)
        Called after every iteration.
    """
    begin = time.monotonic()
    draws = objective.series.draw(DRAWS, rng)
    costs = objective(draws)
    # Share of the iterations that each start gets before the best is chosen.
    first = max(5, int(0.25 * iterations))
    total = STARTS * first + ROUNDS * iterations

    def spent() -> int:
        return sum(r.evaluations for r in runs)

    def tell(cost: float) -> None:
        done = sum(r.iterations for r in runs) / total
        say(cost, max(done, spent() / evaluations, (time.monotonic() - begin) / time_limit))

    runs = [
        _Run(objective, k, draws[at], float(costs[at]), begin + time_limit, tell)
        for k, at in enumerate(np.argsort(costs)[:STARTS])
        if costs[at] < OPEN  # where loops do not close there is no slope
    ]
    if not runs:
        return Search((), draws, costs, (), DRAWS, "converged")
    ends: list[End] = []
    for run in runs:  # half of the evaluations for choosing a start
        run.allowed = 0.5 * evaluations / len(runs)
        ends.append(run.improve(first))
    waiting = sorted(runs, key=lambda r: r.cost)
    for _ in range(ROUNDS):
        best = waiting[0]
        best.allowed = best.evaluations + evaluations - spent()
        before = best.cost
        ends.append(best.improve(iterations))
        # Fall of the cost of a whole round below which the search has converged.
        if before - best.cost < 2e-3:  # stuck at a kink: the next start may get further
            waiting = waiting[1:]
        if ends[-1] != "converged" or not waiting:
            break
    found = tuple(sorted(((r.cost, r.x) for r in runs), key=lambda pair: pair[0]))
    steps = tuple(step for r in runs for step in r.steps)
    end = max(ends, key=get_args(End).index)
    return Search(found, draws, costs, steps, DRAWS + spent(), end)
