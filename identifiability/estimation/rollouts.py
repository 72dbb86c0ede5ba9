"""Rollouts of a commanded robot that follow logs most closely: joints, bodies, delays and gains.

Positions are all that is measured and all that a rollout is asked for, so nothing is differentiated
and no noise stands in columns: damped Gauss–Newton steps on the positions that the servos make of
the commands. Bodies are the file's but for their sizes, which are fitted beside the joints, within
shares. Where gains are to be found, too, positions tell all numbers up to one factor, which comes
from these shares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

from identifiability.estimation.rules import RULES
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.commands import servo_log
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.robot import Robot
from identifiability.simulation.rollout import (
    COARSE,
    STEP,
    CommandedRobot,
    explicable,
    forgotten,
    start_rollouts,
)

#: What is found of each joint: rotor, viscous and dry friction, offset, gains if nobody states
#: them, and play of its gear and what torque ends at where errors ask for it.
KINDS = ("Ia", "Fv", "Fc", "off", "play", "limit", "kv", "kp")

#: How far off the logarithm of a gain is at its start, which nothing bounds where all is followed.
LOOSE: Tolerance = 10.0

#: Shares of the inertia, damping and torque of a joint by which its numbers are varied, and of a
#: sampling step by which the delay is.
VARIED: Tolerance = 2e-4
LATER: Tolerance = 0.05
#: Play by which a gear without any is varied [rad or m]: what is small is lost in noise.
PLAY = 100 * VARIED

#: Length of logs that are rolled out, all together [s], of which the search begins on a part: more
#: says little more.
LONG: Tolerance = 45.0

#: Stretches of time of a rollout that are left out in turn [s].
BLOCK: Tolerance = 0.5

#: A search ends where a step promises less than this of the weighed squares, or one of a new
#: derivative brings no more: of a part of logs it is a beginning, of all a standard deviation; or
#: after so many steps.
BEGUN: Tolerance = 20.0
ENOUGH: Tolerance = 2.0
STEPS = 20
#: Steps that one derivative serves at most.
RENEWED = 4


@frozen
class Rollouts:
    """Numbers of a robot with which its rollouts follow logs most closely.

    Attributes
    ----------
    numbers : mapping of str to (n,)
        Rotor inertia ``Ia``, viscous ``Fv`` and dry friction ``Fc``, offset ``off``, and gains
        ``kv`` and ``kp``. Where commands have no speeds an unknown kv is 0, and viscous friction
        holds it. Half the logarithm of how much larger bodies are, ``sizes`` (nb,).
    parameters : mapping of str to float
        Standard parameters by name of joints and bodies.
    delays : (L,) [s]
        Of each log, as each has a clock of its own.
    errors : (n,) [rad or m]
        Of positions (rms), by joint.
    missed : (n,)
        Errors as shares of what there is to explain: how far a joint is from its command, merely
        delayed, which is what a servo makes torque of, and what any servo that is stiff enough
        would leave, whatever moves behind it; no more than how the joint moves, and no less than
        what noise would be.
    delay_errors : (L,) [s]
        Standard deviations of the delays; zero where they are known.
    covariance : (2 n, 2 n)
        Of kv and log kp.
    unsure : (p,)
        Standard deviations of the vector of the search.
    search : tuple
        The problem, and where its search ended: vector, positions, weighted derivative.
    """

    numbers: Mapping[str, Array]
    parameters: Mapping[str, float]
    delays: Array
    errors: Array
    missed: Array
    delay_errors: Array
    covariance: Array
    unsure: Array
    search: tuple[Any, ...] = ()


def contradicted(missed: Array) -> bool:
    """Return whether shares of what there is to explain (n,) that are missed say gains are wrong.

    Where most joints are followed, what is wrong at another is its own, and no less is known of
    these for it.
    """
    return bool(np.median(missed) > RULES.rollout_contradicted)


def fit_rollouts(
    robot: Robot, logs: Sequence[Log], shares: Mapping[str, float], delay: float | None = None
) -> Rollouts:
    """Return the numbers of joints, bodies and servos with which rollouts follow logs.

    Parameters
    ----------
    robot : Robot
        With servos, of which some gains may be NaN.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    shares : mapping of str to float
        Bodies whose sizes are fitted, and within which share each is the file's.
    delay : float [s], optional
        Where it is known.

    Raises
    ------
    RobotError
        If the robot cannot be rolled out.
    """
    assert robot.servo is not None
    rows = [round(LONG / len(logs) / signals.sampling_step(log.t)) for log in logs]
    logs = [log.rows(0, min(len(log), most)) for log, most in zip(logs, rows, strict=True)]
    # Logs often begin and end at rest.
    thirds = [log.rows(len(log) // 3, 2 * len(log) // 3) for log in logs]
    machine, numbers = start_rollouts(robot, min(thirds, key=len))
    free = np.ones((len(KINDS), len(robot.joints)), bool)
    spoken = all(log.dq_ref is not None for log in logs)
    known = machine.servo.having({"kp": robot.servo.kp})
    made = np.concatenate([servo_log(log, known, delay or 0.0).tau for log in logs])
    # What a servo makes of speeds counts within its limits, and what friction does not.
    limited = (known.high < np.inf) & ~np.all((made > known.low) & (made < known.high), axis=0)
    free[4:6] = False  # no gear has play as yet, and no torque an end that nobody states
    free[-2:] = np.isnan(robot.servo.kv) & (spoken | limited), np.isnan(robot.servo.kp)
    problem = Problem(machine, logs, free, delay, shares)
    x = problem.pack(numbers, delay or 0.0)
    problem.logs, problem.varied[problem.bodies] = thirds, False
    x, q, J = problem.descend(x, BEGUN)
    if not contradicted(problem.errors(q) / explicable(thirds)):
        problem.logs, problem.varied[problem.bodies] = logs, True
        x, q, J = problem.descend(x)
    return problem.conclude(x, q, J)


class Problem:
    """Positions of the rollouts of all logs, as a function of one vector of numbers.

    The vector holds numbers of the joints by kind, half the logarithm of how much larger bodies
    are, and a delay for each log. Where a gain is found its logarithm stands in the vector, and the
    joint's other numbers are over it: positions hardly tell what is common to all of them.

    Parameters
    ----------
    machine : CommandedRobot
    logs : sequence of Log
    free : (kinds, n) bool
        At which joints numbers are varied.
    delay : float [s], optional
        Where it is known.
    shares : mapping of str to float
        Bodies that are varied, and within which share each is the file's.
    """

    def __init__(
        self,
        machine: CommandedRobot,
        logs: Sequence[Log],
        free: np.ndarray,
        delay: float | None = None,
        shares: Mapping[str, float] | None = None,
    ) -> None:
        self.logs, self.shares = logs, shares or {}
        self.trees = machine.trees
        self.dt = min(signals.sampling_step(log.t) for log in logs)
        self.bodies = slice(free.size, free.size + len(self.shares))
        self.late = slice(self.bodies.stop, None)
        #: Which tree each number is of.
        self.tree_of = np.concatenate(
            [np.tile(self.trees, len(free)), machine.trees_of([*self.shares])]
        )
        #: Numbers that grow with the gain of their joint, (kinds, n).
        self.over = free & free[-1]
        self.over[-1] = False
        late = np.full(len(logs), delay is None)
        self.varied = np.concatenate([free.ravel(), np.ones(len(self.shares), bool), late])
        servo, moved = machine.servo, np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
        inertia = machine.inertia(logs[0].q.mean(0))
        torque = np.minimum(np.maximum(0.3 * servo.kp, servo.kv) * moved, servo.high)
        damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
        alike = np.ones(len(inertia))
        sizes = (inertia, damping, torque, torque, PLAY / VARIED * alike, torque, damping, alike)
        steps = VARIED * np.concatenate([*sizes, np.ones(len(self.shares))])
        #: By how much each number is varied.
        self.by = np.concatenate([steps, np.full(len(logs), LATER * self.dt)])
        self.machine = machine

    def parameters(self, numbers: Mapping[str, Array]) -> dict[str, float]:
        """Return standard parameters of joints, and of bodies, which are as often the file's."""
        robot, sizes = self.machine.robot, np.exp(2 * numbers["sizes"])
        each = zip(self.shares, sizes, strict=True)
        own = {f"{b}.{k}": x * robot.nominal[f"{b}.{k}"] for b, x in each for k in INERTIAL_KINDS}
        for kind in KINDS[:4]:
            called = robot.inertia_parts[0] if kind == "Ia" else kind
            pairs = zip(robot.joints, numbers[kind].tolist(), strict=True)
            own |= {f"{joint}.{called}": value for joint, value in pairs}
        return own

    def pack(self, numbers: Mapping[str, Array], late: Any) -> Array:
        """Return the vector of joints' numbers and delays, bodies as they are known."""
        none = np.zeros(len(self.trees))
        rows = [numbers.get(k, none) for k in KINDS[:-1]]
        sizes, late = np.zeros(len(self.shares)), np.full(len(self.logs), late)
        return np.concatenate([*rows, none, sizes, late])

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array]:
        """Return the numbers of a vector, and delays."""
        table = x[: self.over.size].reshape(self.over.shape)
        numbers = dict(zip(KINDS, table * np.exp(self.over * table[-1]), strict=True))
        gains = self.machine.servo.kp * np.exp(table[-1])
        return {**numbers, "kp": gains, "sizes": x[self.bodies]}, x[self.late]

    def conclude(self, x: Array, q: list[Array], J: Array) -> Rollouts:
        """Return what was found where a search ended."""
        (numbers, delays), late, n = self.unpack(x), self.late, len(self.trees)
        gains = slice(self.over.size - 2 * n, self.over.size)
        covariance = self.uncertainty(x, q, J)
        to_gains = np.diag(np.exp(np.append(self.over[-2] * x[gains][n:], np.zeros(n))))
        to_gains[range(n), range(n, 2 * n)] = self.over[-2] * numbers["kv"]
        unsure = np.sqrt(np.diag(covariance))
        return Rollouts(
            numbers=numbers,
            parameters=self.parameters(numbers),
            delays=delays,
            errors=self.errors(q),
            missed=self.errors(q) / explicable(self.logs),
            delay_errors=unsure[late] * self.varied[late],
            covariance=to_gains @ covariance[gains, gains] @ to_gains.T,
            unsure=unsure,
            search=(self, x, q, J),
        )

    def descend(self, x: Array, enough: float = ENOUGH) -> tuple[Array, list[Array], Array]:
        """Return the vector after damped Gauss–Newton steps, and positions along the logs.

        Then the weighted derivative (r, p), which is taken anew where the last step did not bring
        what it promised, and often enough that steps do not creep [Shamanskii 1967].
        """
        q, damping, at, poor = self.roll([x])[0], 1e-3, x[:0], True
        own = np.flatnonzero(self.varied)
        for turn in range(STEPS):
            if at is not x and (poor or turn % RENEWED == 0):
                J, at = self.linearise(x), x
            weights = self.weights(q)
            r = weights * self.residual(q, x)
            Q, R = np.linalg.qr(weights[:, None] * J[:, own])
            right, size = Q.T @ r, np.linalg.norm(R, axis=0) + 1e-12
            rows = np.vstack([R, np.sqrt(damping) * np.diag(size)])
            aim = np.concatenate([-right, np.zeros(len(own))])
            step = np.zeros(len(x))
            step[own] = lsq_linear(rows, aim, self.bounds(x)[:, own], method="bvls").x
            promised = right @ right - np.sum((right + R @ step[own]) ** 2)
            if promised <= enough:
                break
            moved = self.roll([x + step])[0]
            gained = r @ r - np.sum((weights * self.residual(moved, x + step)) ** 2)
            poor, settled = gained < 0.5 * promised, at is x and abs(gained) <= enough
            damping = damping / 3 if gained > 0 else damping * 10
            x, q = (x + step, moved) if gained > 0 else (x, q)
            if settled:
                break
        return x, q, weights[:, None] * J

    def uncertainty(self, x: Array, q: list[Array], J: Array) -> Array:
        """Return the covariance of a vector, (p, p).

        It is that of leaving out stretches of time in turn [Künsch 1989], which holds what errors
        remember and much of what the model lacks, and of what is known beforehand.

        Parameters
        ----------
        x : (p,)
        q : list of Array
            Positions along the logs.
        J : (r, p)
            Weighted derivative of the residual.
        """
        size = np.linalg.norm(J, axis=0)
        unit = np.where(size > 0, size, 1.0)
        J = J / unit
        n, ends = len(self.trees), np.cumsum([len(log) - forgotten(log) for log in self.logs])
        rows, known = np.split(J, [n * ends[-1]])
        # A number whose part another may play is known to its size alone.
        sizes = np.maximum(self.by / VARIED, np.abs(x))
        known = np.vstack([known, np.diag(self.varied / (sizes * unit))])
        scores = rows * (self.weights(q) * self.residual(q, x))[: len(rows), None]
        every = max(round(BLOCK / self.dt), 1)
        edges = n * np.unique([k for a, b in pairwise([0, *ends]) for k in range(a, b, every)])
        whole = rows.T @ rows + known.T @ known
        H, out = np.linalg.pinv(whole, hermitian=True), [*known]
        for a, b in pairwise([*edges, len(rows)]):
            left = np.linalg.pinv(whole - rows[a:b].T @ rows[a:b], hermitian=True)
            out.append(whole @ left @ scores[a:b].sum(0))
        root = out @ H / unit
        return np.asarray(root.T @ root)

    def bounds(self, x: Array) -> Array:
        """Return the least and largest step, (2, p): no friction or rotor is negative."""
        endless = np.isin(KINDS, ("off", "kp")).repeat(len(self.trees))
        low = np.full(len(x), -np.inf)
        low[: len(endless)] = np.where(endless, -np.inf, -x[: len(endless)])
        # A command was given at any time since the row before.
        low[self.late] = -self.dt - x[self.late]
        return np.stack([np.minimum(low, -1e-12), np.full(len(x), np.inf)])

    def roll(self, xs: Sequence[Array], step: float = STEP) -> list[list[Array]]:
        """Return positions along every log, for several vectors, all at one step [s]."""
        every = []
        for own, late in map(self.unpack, xs):
            sizes = dict(zip(self.shares, np.exp(2 * own["sizes"]).tolist(), strict=True))
            machine = self.machine
            if own["play"].any():
                loose = replace(machine.servo, play=own["play"])
                machine = CommandedRobot(machine.robot, {}, loose)
            every.append((machine.resized(sizes), own, late))
        step = min(step, *(machine.longest(own) for machine, own, _ in every))
        return [
            [m.roll(log, own, d, step) for log, d in zip(self.logs, late, strict=True)]
            for m, own, late in every
        ]

    def weights(self, q: list[Array]) -> Array:
        """Return weights of the residual, (r,): errors count as rarely as they are new."""
        apart = self.apart(q)
        each = np.maximum(self.errors(q), 1e-9) * np.sqrt(autocorrelation_time(apart))
        return np.append(np.tile(1.0 / each, len(apart)), np.ones(len(self.belief(0.0 * self.by))))

    def apart(self, q: list[Array]) -> Array:
        """Return errors of positions behind forgotten starts, (N, n); large where one diverged."""
        pairs = zip(q, self.logs, strict=True)
        rows = np.concatenate([(p - log.q)[forgotten(log) :] for p, log in pairs])
        return np.asarray(np.nan_to_num(rows, nan=1.0))

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint, (n,)."""
        return np.asarray(np.sqrt(np.mean(self.apart(q) ** 2, axis=0)))

    def residual(self, q: list[Array], x: Array) -> Array:
        """Return errors of positions, flat, then how far bodies are from what is known, (r,)."""
        return np.append(self.apart(q), self.belief(x))

    def belief(self, x: Array) -> Array:
        """Return how far bodies are from the file's, and all from what is stated, (b,) [σ]."""
        prior, numbers = self.machine.robot.prior, self.unpack(x)[0]
        found = self.parameters(numbers) if self.shares else {}
        stated = [(found[k] - m) / s for k, (m, s) in prior.items() if k in found]
        gains = (x * self.varied)[: self.over.size][-len(self.trees) :] / LOOSE
        return np.array([*numbers["sizes"] / [*self.shares.values()], *stated, *gains])

    def linearise(self, x: Array, own: np.ndarray | None = None, by: Array | None = None) -> Array:
        """Return the derivative of the residual, (r, p), by what is varied, or by some others.

        It is that of differences, of steps of some size, (p,).
        """
        by = self.by if by is None else by
        own = np.flatnonzero(self.varied[: self.bodies.stop]) if own is None else own
        trees = self.tree_of[own]  # all are varied at once
        turn = np.array([np.sum(trees[:k] == tree) for k, tree in enumerate(trees)], int)
        groups = [own[turn == k] for k in range(int(turn.max(initial=-1)) + 1)]
        alone = np.diag(by)
        xs = [x, *(x + alone[at].sum(0) for at in (*groups, self.late))]
        base, *others = map(self.apart, self.roll(xs, COARSE * STEP))
        J = np.zeros((*base.shape, len(x)))
        for columns, moved in zip(groups, others, strict=False):
            of_tree = self.trees[:, None] == self.tree_of[columns]
            J[:, :, columns] = (moved - base)[:, :, None] * of_tree / by[columns]
        ends = np.cumsum([0, *(len(log) - forgotten(log) for log in self.logs)]).tolist()
        for k, (a, b) in enumerate(pairwise(ends), self.bodies.stop):
            J[a:b, :, k] = (others[-1] - base)[a:b] / by[k]
        beliefs = [self.belief(x + step) - self.belief(x) for step in alone]
        return np.vstack([J.reshape(-1, len(x)), np.array(beliefs).T / by])
