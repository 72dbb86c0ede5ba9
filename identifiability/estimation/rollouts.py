"""Joints' numbers and delay of a commanded robot, from the error of its rollouts.

Positions are all that is measured and all that a rollout is asked for, so nothing is differentiated
and no noise stands in columns: damped Gauss–Newton steps on the positions that the servos make of
the commands. Bodies are the file's, or those that were fitted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import scipy

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.robot import Robot
from identifiability.simulation.rollout import STEP, CommandedRobot, forgotten

#: What is found of each joint: rotor, viscous and dry friction, offset.
KINDS = ("Ia", "Fv", "Fc", "off")

#: Shares of the inertia, damping and torque of a joint by which its numbers are varied, and of a
#: sampling step by which the delay is.
VARIED, LATER = 0.02, 0.05

#: Step of rollouts whose differences alone are looked at [s].
COARSE = 2.5 * STEP

#: No delay that is looked for is longer [s].
LATEST = 0.06

#: Where a third of a log is so long, the search begins on that: steps there cost a third [s].
ENOUGH = 2.0

#: Share of a joint's motion by which the best rollout errs where gains contradict it.
CONTRADICTED = 0.5

#: Length of blocks of time whose errors are taken to be independent [s].
TOGETHER = 1.0

#: A step is taken again, more damped, so often; and the search ends where one gains less than this
#: share of the error, or after so many.
TRIED, GAIN, STEPS = 6, 5e-3, 8


@frozen
class Rollouts:
    """Numbers of a robot's joints with which its rollouts follow logs most closely.

    Attributes
    ----------
    numbers : mapping of str to (n,)
        Rotor inertia ``Ia``, viscous ``Fv`` and dry friction ``Fc`` and offset ``off``.
    delays : (L,) [s]
        Of each log, as each has a clock of its own.
    errors : (n,) [rad or m]
        Of positions (rms), by joint.
    before : (n,) [rad or m]
        The same at the start.
    steps : int
        How many were taken.
    delay_errors : (L,) [s]
        Standard deviations of the delays; zero where they are known.
    """

    numbers: dict[str, Array]
    delays: Array
    errors: Array
    before: Array
    steps: int
    delay_errors: Array

    def parameters(self, robot: Robot) -> dict[str, float]:
        """Return standard parameters by name."""
        return {
            f"{joint}.{robot.inertia_parts[0] if kind == 'Ia' else kind}": float(value)
            for kind, values in self.numbers.items()
            for joint, value in zip(robot.joints, values, strict=True)
        }


def fit_rollouts(
    robot: Robot,
    logs: Sequence[Log],
    delay: float | None = None,
    steps: int = STEPS,
    fitted: Mapping[str, float] | None = None,
) -> Rollouts:
    """Return the numbers of the joints, and the delay, with which rollouts follow logs.

    Parameters
    ----------
    robot : Robot
        With servos.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    delay : float [s], optional
        Where it is known.
    steps : int
        At most.
    fitted : mapping, optional
        Standard parameters by name, of bodies and to begin with, near which the search stays; by
        default the file's.

    Raises
    ------
    RobotError
        If the robot cannot be rolled out.
    """
    machine = CommandedRobot(robot, fitted or {})
    late = [(log.servo_delay if fitted else delay) or 0.0 for log in logs]
    x = _pack(machine.numbers(), np.array(late))
    problem = _Problem(machine, tuple(logs), delay)
    before = problem.errors(problem.roll([x])[0])
    thirds = tuple(_middle(log) for log in logs)
    if not fitted and all(t[-1] - t[0] > ENOUGH for t in (log.t for log in thirds)):
        x, errors, taken, *_ = _descend(_Problem(machine, thirds, delay), x, steps)
        if share_missed(errors, logs).max() > CONTRADICTED:  # nor will whole logs be followed
            return Rollouts(*problem.unpack(x), errors, before, taken, np.zeros(len(logs)))
    x, errors, taken, J, r = _descend(problem, x, steps)
    numbers, delays = problem.unpack(x)
    sure = np.zeros(len(logs)) if delay is not None else problem.delay_errors(J, r)
    return Rollouts(numbers, delays, errors, before, taken, sure)


def share_missed(errors: Array, logs: Sequence[Log]) -> Array:
    """Return errors of positions (n,) as shares of how the joints of logs move, (n,)."""
    moved = np.sqrt(np.mean([log.q.var(0) for log in logs], axis=0))
    return np.asarray(errors / np.maximum(moved, 1e-3))


def _middle(log: Log) -> Log:
    """Return the middle third of a log, as they often begin and end at rest."""
    return log.rows(len(log) // 3, 2 * len(log) // 3)


def _pack(numbers: Mapping[str, Array], delays: Array) -> Array:
    """Return the vector of some numbers."""
    return np.concatenate([*(numbers[k] for k in KINDS), delays])


def _descend(problem: _Problem, x: Array, steps: int) -> tuple[Array, Array, int, Array, Array]:
    """Return the vector after damped Gauss–Newton steps, errors (n,), and how many were taken.

    Then the last derivative of the residual (r, p), and the residual there (r,).
    """
    errors = problem.errors(problem.roll([x])[0])
    taken, damping = 0, 1e-3
    J, r = np.zeros((0, len(x))), np.zeros(0)
    for _ in range(steps):
        weights = 1.0 / np.maximum(errors, 1e-9)
        J, r = problem.linearise(x, weights)
        cost = float(r @ r)
        R: Array = np.asarray(np.linalg.qr(np.column_stack([J, r]), mode="r"))
        size = np.sqrt((R[:-1, :-1] ** 2).sum(0)) + 1e-12
        better = None
        for _ in range(TRIED):
            rows = np.vstack([R[:, :-1], np.sqrt(damping) * np.diag(size)])
            right = np.concatenate([R[:, -1], np.zeros(len(size))])
            low, high = problem.bounds(x)
            step = scipy.optimize.lsq_linear(rows, -right, (low, high), method="bvls").x
            q = problem.roll([x + step])[0]
            found = problem.residual(q, weights)
            if float(found @ found) < cost:
                better = x + step, problem.errors(q), float(found @ found)
                break
            damping *= 10
        if better is None:
            break
        x, errors, now = better
        taken, damping = taken + 1, max(damping / 10, 1e-8)
        if now > (1 - GAIN) * cost:
            break
    return x, errors, taken, J, r


def find_delay(machine: CommandedRobot, logs: Sequence[Log]) -> float:
    """Return the delay with which a robot's rollouts follow logs most closely [s].

    Parameters
    ----------
    machine : CommandedRobot
    logs : sequence of Log
        With commands, in the robot's order of joints.
    """
    step = min(signals.sampling_step(log.t) for log in logs)
    width = np.concatenate([log.q for log in logs]).std(0) + 1e-6

    def costs(delays: Array, finest: float) -> Array:
        own = [machine.numbers()] * len(delays)
        total = np.zeros(len(delays))
        for log in logs:
            apart = (machine.roll(log, own, delays, step=finest) - log.q) / width
            total += np.nan_to_num(apart**2, nan=1e12).sum((1, 2))
        return total

    # A command was given at any time since the row before.
    grid = np.linspace(-step, LATEST, 12)
    best = int(np.argmin(costs(grid, COARSE)))
    wide = float(grid[1] - grid[0])
    near = np.linspace(max(grid[best] - wide, -step), grid[best] + wide, 7)
    found = costs(near, STEP)
    best = int(np.clip(np.argmin(found), 1, len(near) - 2))
    a, b, c = found[best - 1 : best + 2]  # through which goes a parabola
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if bend > 0 else 0.0
    return float(near[best] + np.clip(shift, -1, 1) * (near[1] - near[0]))


class _Problem:
    """Positions of the rollouts of all logs, as a function of one vector of numbers."""

    def __init__(self, machine: CommandedRobot, logs: tuple[Log, ...], delay: float | None) -> None:
        self.machine, self.logs, self.known = machine, logs, delay
        self.n = len(machine.robot.joints)
        self.dt = min(signals.sampling_step(log.t) for log in logs)
        inertia = machine.inertia(logs[0].q.mean(0))
        servo = machine.servo
        moved = np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
        torque = np.minimum(
            np.maximum(servo.kp * 0.3 * moved, servo.kv * moved), np.minimum(servo.high, 1e9)
        )
        damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
        self.varied = VARIED * np.concatenate([inertia, damping, torque, torque])
        self.trees = machine.trees
        place = np.array([int(np.sum(self.trees[:k] == t)) for k, t in enumerate(self.trees)])
        #: One joint of each tree, which are varied at once.
        self.groups = [np.flatnonzero(place == k) for k in range(int(place.max()) + 1)]

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array]:
        """Return the numbers of a vector."""
        rows = x[: 4 * self.n].reshape(4, -1).copy()
        return dict(zip(KINDS, rows, strict=True)), x[4 * self.n :].copy()

    def bounds(self, x: Array) -> tuple[Array, Array]:
        """Return the least and largest step: no friction or rotor is negative."""
        low = np.full(len(x), -np.inf)
        low[: 3 * self.n] = -x[: 3 * self.n]
        # A command was given at any time since the row before.
        high, late = np.full(len(x), np.inf), slice(4 * self.n, None)
        low[late] = -self.dt - x[late]
        if self.known is not None:
            low[late], high[late] = -1e-12, 1e-12
        return np.minimum(low, -1e-12), high

    def delay_errors(self, J: Array, r: Array) -> Array:
        """Return standard deviations of the delays, (L,) [s]: a sandwich of blocks of time."""
        if not len(r):
            return np.zeros(len(self.logs))
        a = np.linalg.pinv(J)[4 * self.n :]
        scores = (a * r).reshape(len(a), -1, self.n).sum(2)
        rows = max(1, round(TOGETHER / self.dt))
        starts = np.arange(0, scores.shape[1], rows)
        out: Array = np.sqrt((np.add.reduceat(scores, starts, axis=1) ** 2).sum(1))
        return out

    def roll(self, xs: Sequence[Array], step: float = STEP) -> list[list[Array]]:
        """Return positions along every log, for several vectors."""
        numbers, delays = zip(*map(self.unpack, xs), strict=True)
        late = np.array(delays).T
        pairs = zip(self.logs, late, strict=True)
        each = [self.machine.roll(log, numbers, own, step=step) for log, own in pairs]
        return [[q[k] for q in each] for k in range(len(xs))]

    def residual(self, q: list[Array], weights: Array) -> Array:
        """Return weighted errors of positions, flat; what diverged is far off."""
        pairs = zip(q, self.logs, strict=True)
        parts = [((x - log.q) * weights)[forgotten(log) :] for x, log in pairs]
        return np.asarray(np.nan_to_num(np.concatenate(parts).ravel(), nan=1e6))

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint, (n,)."""
        pairs = zip(q, self.logs, strict=True)
        square = np.concatenate([((x - log.q) ** 2)[forgotten(log) :] for x, log in pairs])
        out: Array = np.sqrt(np.nan_to_num(square, nan=1.0).mean(0))
        return out

    def linearise(self, x: Array, weights: Array) -> tuple[Array, Array]:
        """Return the derivative of the residual (r, p), and the residual (r,)."""
        n, p = self.n, len(x)
        tries, moved = [x], []
        for kind in range(4):
            for group in self.groups:
                own = x.copy()
                columns = kind * n + group
                own[columns] += self.varied[columns]
                tries.append(own)
                moved.append(columns)
        late = x.copy()
        late[4 * n :] += LATER * self.dt
        tries.append(late)
        base, *others = self.roll(tries, COARSE)
        r = self.residual(base, weights)
        J = np.zeros((len(r), p))
        rows = r.reshape(-1, n)
        for q, columns in zip(others, moved, strict=False):
            change = self.residual(q, weights).reshape(-1, n) - rows
            for column in columns:
                inside = self.trees == self.trees[column % n]
                block = np.zeros_like(rows)
                block[:, inside] = change[:, inside] / self.varied[column]
                J[:, column] = block.ravel()
        change = (self.residual(others[-1], weights) - r) / (LATER * self.dt)
        ends = np.cumsum([0, *(n * (len(log) - forgotten(log)) for log in self.logs)])
        for k, (a, b) in enumerate(pairwise(ends.tolist())):
            J[a:b, 4 * n + k] = change[a:b]
        return J, self.residual(self.roll([x])[0], weights)
