"""Joints' numbers and delay of a commanded robot, from the error of its rollouts.

Positions are all that is measured and all that a rollout is asked for, so nothing is differentiated
and no noise stands in columns: damped Gauss–Newton steps on the positions that the servos make of
the commands. Bodies are the file's, or those that were fitted; where gains of the servos are to be
found, too, positions tell all numbers up to one factor, and bodies within what is believed of them
are fitted beside them (`fit_gains`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy.optimize import lsq_linear

from identifiability.estimation.noise import autocorrelation_time
from identifiability.estimation.rules import RULES
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.spectrum import noise_level, resolution
from identifiability.robot import Robot
from identifiability.robot.servo import Servo
from identifiability.simulation.rollout import STEP, CommandedRobot, forgotten

#: Length of the windows in which a search begins [s].
WINDOW: Tolerance = 1.0

#: How many other records of the same motion tell what the steps of encoders do to a delay.
RECORDS = 100

#: No delay that is looked for is longer [s].
LATEST: Tolerance = 0.06

#: What is found of each joint: rotor, viscous and dry friction, offset.
KINDS = ("Ia", "Fv", "Fc", "off")

#: Shares of the inertia, damping and torque of a joint by which its numbers are varied, and of a
#: sampling step by which the delay is.
VARIED: Tolerance = 0.02
LATER: Tolerance = 0.05

#: Step of rollouts whose differences alone are looked at, in that of others.
COARSE: Tolerance = 2.5

#: Where a third of a log is so long, the search begins on that: steps there cost a third [s].
ENOUGH: Tolerance = 2.0

#: A search ends where a step promises less than this share of the error, or after so many steps.
GAIN: Tolerance = 2e-4
STEPS = 20


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
    delay_errors : (L,) [s]
        Standard deviations of the delays; zero where they are known.
    """

    numbers: dict[str, Array]
    delays: Array
    errors: Array
    before: Array
    delay_errors: Array

    def parameters(self, robot: Robot) -> dict[str, float]:
        """Return standard parameters by name."""
        return {
            f"{joint}.{robot.inertia_parts[0] if kind == 'Ia' else kind}": float(value)
            for kind, values in self.numbers.items()
            if kind in KINDS
            for joint, value in zip(robot.joints, values, strict=True)
        }


def fit_rollouts(
    robot: Robot,
    logs: Sequence[Log],
    delay: float | None = None,
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
    free = dict.fromkeys(KINDS, np.ones(len(robot.joints), bool))
    thirds = _thirds(logs)
    problem, part = (Problem(machine, x, delay, free) for x in (logs, thirds))
    x = problem.pack(machine.numbers(), np.array(late))
    before = problem.errors(problem.roll([x])[0])
    if not fitted and thirds is not logs:
        # Begun anew all the time, a rollout follows even where numbers are far from the robot's.
        x, *_ = Problem(machine, thirds, delay, free, anew=WINDOW).descend(x)
        errors = part.errors(part.roll([x])[0])
        if contradicted(share_missed(errors, logs)):  # nor will whole logs be followed
            numbers, _, delays = problem.unpack(x)
            return Rollouts(numbers, delays, errors, before, np.zeros(len(logs)))
    x, q, J = problem.descend(x, 0.25 * STEP)
    numbers, _, delays = problem.unpack(x)
    unsure = problem.delay_errors(J, q) if delay is None else np.zeros(len(logs))
    return Rollouts(numbers, delays, problem.errors(q), before, unsure)


class Believed(Protocol):
    """Bodies as functions of coordinates, and what is believed of those."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """The body of each coordinate, (m,)."""

    def values(self, e: Array) -> dict[str, float]:
        """Return standard parameters at some coordinates (m,)."""

    def along(self, e: Array) -> Array:
        """Return how coordinates change where bodies get heavier and stay alike, (m,)."""

    def rows(self, e: Array, numbers: Mapping[str, Array]) -> Array:
        """Return how far coordinates and joints' numbers are from what is believed, (r,) [σ]."""


@frozen
class Gains:
    """Gains of servos that were found from rollouts, with the robot that they move.

    Attributes
    ----------
    servo : Servo
        Where commands have no speeds kv is 0, and viscous friction holds it.
    numbers : mapping of str to (n,)
        Of the joints, as of `Rollouts`.
    errors : (n,) [rad or m]
        Of positions (rms), by joint.
    covariance : (n, n)
        Of log kp.
    by_belief : (r,)
        By how much log kp, in the mean over joints that are found, moves with each row of what is
        believed [σ].
    """

    servo: Servo
    numbers: dict[str, Array]
    errors: Array
    covariance: Array
    by_belief: Array


def fit_gains(robot: Robot, logs: Sequence[Log], believed: Believed) -> Gains:
    """Return the gains with which rollouts follow logs most closely.

    The start is the best of a grid of natural frequencies and damping ratios, for what each joint
    feels of inertia.

    Parameters
    ----------
    robot : Robot
        With servos of which some gains are NaN.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    believed : Believed

    Raises
    ------
    RobotError
        If the robot cannot be rolled out.
    """
    servo, n = robot.servo, len(robot.joints)
    assert servo is not None
    free = dict.fromkeys(KINDS, np.ones(n, bool))
    free |= {"kv": np.isnan(servo.kv)} if all(log.dq_ref is not None for log in logs) else {}
    free["kp"] = np.isnan(servo.kp)
    thirds = _thirds(logs)
    machine, numbers = _start(robot, servo, min(thirds, key=len))
    x = np.zeros(0)
    for part in (thirds, logs):
        problem = Problem(machine, part, servo.delay, free, believed)
        x = x if len(x) else problem.pack(numbers, servo.delay or 0.0)
        x, q, J = problem.descend(x)
    numbers, *_ = problem.unpack(x)
    size = np.linalg.norm(J, axis=0)
    size = np.where(size > 0, size, 1.0)  # of gains that are stated
    H = np.linalg.pinv((J / size).T @ (J / size), hermitian=True) / np.outer(size, size)
    kp = slice(problem.at[0] - n, problem.at[0])
    found = free["kp"] if free["kp"].any() else np.ones(n, bool)
    by = J[problem.apart(q).size :] @ (found / found.sum() @ H[kp])
    return Gains(machine.servo.having(numbers), numbers, problem.errors(q), H[kp, kp], by)


def _start(robot: Robot, servo: Servo, log: Log) -> tuple[CommandedRobot, dict[str, Array]]:
    """Return a robot and joints' numbers from which the search for gains begins."""
    free = np.isnan(servo.kp)
    guess = replace(servo, kp=np.where(free, 1.0, servo.kp), kv=np.nan_to_num(servo.kv))
    machine = CommandedRobot(robot, {}, guess)
    inertia, numbers = machine.inertia(log.q.mean(0)), machine.numbers()
    # Frequencies [rad/s] and damping ratios of a servo and what it moves.
    speeds = np.geomspace(2, 250, 17)
    tries = []
    for w in speeds[speeds < 1.0 / signals.sampling_step(log.t)]:
        for ratio in (0.2, 0.5, 1.0, 2.0, 4.0):
            kp = np.where(free, inertia * w**2, servo.kp)
            damping = np.where(free, 2 * inertia * w * ratio, numbers["Fv"])
            tries.append({**numbers, "Fv": damping, "kv": guess.kv, "kp": kp})
    q = machine.roll(log, tries, servo.delay or 0.0, step=COARSE * STEP)
    best = np.nan_to_num((q - log.q) ** 2, nan=1e6).mean(1).argmin(0)
    chosen = {k: np.array([x[k] for x in tries])[best, range(len(best))] for k in tries[0]}
    return CommandedRobot(robot, {}, replace(guess, kp=chosen["kp"])), chosen


def share_missed(errors: Array, logs: Sequence[Log]) -> Array:
    """Return errors of positions (n,) as shares of what there is to explain, (n,).

    That is how far a joint is from its command, merely delayed: it is what a servo makes torque of,
    and what any servo that is stiff enough would leave, whatever moves behind it. It is no more
    than how the joint moves, and no less than what noise would be.
    """
    every = np.mean([_unexplained(log) for log in logs], axis=0)
    return np.asarray(errors / np.maximum(np.sqrt(every), 1e-3))


def contradicted(share: Array) -> bool:
    """Whether shares of what there is to explain (n,) that are missed say that gains are wrong.

    Where most joints are followed, what is wrong at another is its own, and no less is known of
    these for it.
    """
    return bool(np.median(share) > RULES.rollout_contradicted)


def _unexplained(log: Log) -> Array:
    """Return the variance of a log's positions about its commands, merely delayed, (n,)."""
    moved = log.q.var(0)
    if log.q_ref is None:
        return np.asarray(moved)
    most = min(round(LATEST / signals.sampling_step(log.t)), len(log) // 2)
    target, q = log.q_ref, log.q[most:]
    apart = [(q - target[most - k : len(log) - k]).var(0) for k in range(most + 1)]
    # So many times the noise of positions is nothing to explain.
    noise = 5.0 * np.maximum(noise_level(log.q, log.t), resolution(log.q))
    return np.asarray(np.minimum(np.maximum(np.min(apart, axis=0), noise**2), moved))


def record(q: Array, log: Log, rng: np.random.Generator) -> Array:
    """Return positions (N, n) with the steps of a log's encoders, and what else is its noise."""
    finest = resolution(log.q)
    noise = np.sqrt(np.maximum(noise_level(log.q, log.t) ** 2 - finest**2 / 12, 0.0))
    at = rng.uniform(size=q.shape[1])
    width = np.where(finest > 0, finest, 1.0)
    rounded = np.where(finest > 0, (np.floor(q / width + at) + 0.5 - at) * width, q)
    return np.asarray(rounded + noise * rng.standard_normal(q.shape))


def _thirds(logs: Sequence[Log]) -> Sequence[Log]:
    """Return the middle thirds of logs, as they often begin and end at rest; all of short ones."""
    thirds = [log.rows(len(log) // 3, 2 * len(log) // 3) for log in logs]
    return thirds if all(x.t[-1] - x.t[0] > ENOUGH for x in thirds) else logs


def roll_late(machine: CommandedRobot, log: Log, delay: float | None = None) -> tuple[float, Array]:
    """Return the delay with which a rollout follows a log most closely [s], and that one (N, n).

    Parameters
    ----------
    machine : CommandedRobot
    log : Log
        With commands, in the robot's order of joints.
    delay : float [s], optional
        Where it is known.
    """
    if delay is None:
        free = dict.fromkeys(KINDS, np.zeros(len(machine.robot.joints), bool))
        problem = Problem(machine, [log], None, free)
        delay = float(problem.descend(problem.pack(machine.numbers(), 0.0))[0][-1])
    return delay, machine.roll(log, delay=delay)[0]


class Problem:
    """Positions of the rollouts of all logs, as a function of one vector of numbers.

    The vector holds numbers of the joints by kind, coordinates of bodies, and a delay for each log.
    Where a gain is found its logarithm stands in the vector, and the joint's other numbers are over
    it: positions hardly tell what is common to all of them.

    Parameters
    ----------
    machine : CommandedRobot
    logs : sequence of Log
    delay : float or None [s]
        Where it is known.
    free : mapping of str to (n,) bool
        Kinds of numbers, and at which joints they are varied; ``kp`` is the last.
    believed : Believed, optional
        Of bodies that are varied, too.
    anew : float [s]
        After which rollouts begin from the log again; by default never.
    """

    def __init__(
        self,
        machine: CommandedRobot,
        logs: Sequence[Log],
        delay: float | None,
        free: Mapping[str, np.ndarray],
        believed: Believed | None = None,
        anew: float = np.inf,
    ) -> None:
        self.logs, self.free, self.believed = logs, free, believed
        self.trees, bodies = machine.trees, believed.bodies if believed else ()
        self.dt = min(signals.sampling_step(log.t) for log in logs)
        ends = [[*range(0, len(x) - 1, int(min(anew / self.dt, len(x)))), len(x)] for x in logs]
        self.windows = [[*pairwise(own)] for own in ends]
        #: Where the coordinates of bodies begin, and where delays do.
        self.at = len(free) * len(self.trees), len(free) * len(self.trees) + len(bodies)
        #: Which tree each number is of.
        self.tree_of = np.concatenate([np.tile(self.trees, len(free)), machine.trees_of(bodies)])
        #: Numbers that grow with the gain of their joint, (kinds, n).
        self.over = np.array([free.get("kp", x & False) & x & (k != "kp") for k, x in free.items()])
        late = np.full(len(logs), delay is None)
        self.varied = np.concatenate([*free.values(), np.ones(len(bodies), bool), late])
        servo, moved = machine.servo, np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
        inertia = machine.inertia(logs[0].q.mean(0))
        torque = np.minimum(np.maximum(0.3 * servo.kp, servo.kv) * moved, servo.high)
        damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
        sizes = {"Ia": inertia, "Fv": damping, "Fc": torque, "off": torque, "kv": damping}
        rows = [sizes.get(kind, np.ones(len(inertia))) for kind in free]
        shares = VARIED * np.concatenate([*rows, np.ones(len(bodies))])
        #: By how much each number is varied.
        self.by = np.concatenate([shares, np.full(len(logs), LATER * self.dt)])
        self.machine, self.having = machine, lru_cache(maxsize=2)(self._having)

    def _having(self, e: bytes) -> CommandedRobot:
        """Return the robot with bodies at some coordinates."""
        if self.believed is None:
            return self.machine
        values = self.believed.values(np.frombuffer(e))
        return CommandedRobot(self.machine.robot, values, self.machine.servo)

    def pack(self, numbers: Mapping[str, Array], late: Array | float) -> Array:
        """Return the vector of joints' numbers and delays, bodies as they are believed."""
        rows = [np.zeros(len(self.trees)) if k == "kp" else numbers[k] for k in self.free]
        bodies = np.zeros(self.at[1] - self.at[0])
        return np.concatenate([*rows, bodies, np.full(len(self.logs), late)])

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array, Array]:
        """Return the numbers of a vector, coordinates of bodies, and delays."""
        a, b = self.at
        table = x[:a].reshape(self.over.shape)
        numbers = dict(zip(self.free, table * np.exp(self.over * table[-1]), strict=True))
        if "kp" in numbers:
            numbers["kp"] = self.machine.servo.kp * np.exp(table[-1])
        return numbers, x[a:b], x[b:]

    def descend(self, x: Array, width: float = STEP) -> tuple[Array, list[Array], Array]:
        """Return the vector after damped Gauss–Newton steps, and positions along the logs.

        Then the weighted derivative (r, p), which is taken anew where the last step did not bring
        what it promised. Rollouts are of that width [s].
        """
        q, damping, at, poor = self.roll([x], width)[0], 1e-3, x[:0], True
        own = np.flatnonzero(self.varied)
        for _ in range(STEPS):
            if poor and at is not x:
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
            if promised <= GAIN * float(r @ r):
                break
            moved = self.roll([x + step], width)[0]
            gained = r @ r - np.sum((weights * self.residual(moved, x + step)) ** 2)
            poor = gained < 0.5 * promised
            damping = damping / 10 if gained > 0 else damping * 10
            if gained > 0:
                x, q = x + step, moved
        return x, q, weights[:, None] * J

    def bounds(self, x: Array) -> Array:
        """Return the least and largest step, (2, p): no friction or rotor is negative."""
        # A command was given at any time since the row before.
        low = np.append(np.zeros(self.at[1]), np.full(len(self.logs), -self.dt)) - x
        low[self.at[0] : self.at[1]] = -np.inf
        for k, kind in enumerate(self.free):
            if kind in ("off", "kp"):
                low[k * len(self.trees) : (k + 1) * len(self.trees)] = -np.inf
        return np.stack([np.minimum(low, -1e-12), np.full(len(x), np.inf)])

    def delay_errors(self, J: Array, q: list[Array]) -> Array:
        """Return standard deviations of the delays by other records of the same rollouts, (L,) [s].

        Where steps of encoders lie is the same all the time, so that blocks of time do not tell.
        """
        rng, weights = np.random.default_rng(RECORDS), self.weights(q)
        size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        follows = np.linalg.pinv(J / size)[self.at[1] :] * weights / size[self.at[1] :, None]
        moved = []
        for _ in range(RECORDS):
            again = [record(p, log, rng) for p, log in zip(q, self.logs, strict=True)]
            moved.append(follows @ self.apart(again).ravel())
        return np.asarray(np.std(moved, axis=0))

    def roll(self, xs: Sequence[Array], step: float = STEP) -> list[list[Array]]:
        """Return positions along every log, for several vectors, all at one step [s]."""
        every = [(self.having(e.tobytes()), own, late) for own, e, late in map(self.unpack, xs)]
        step = min(step, *(machine.longest(own) for machine, own, _ in every))
        return [
            [
                machine.roll(log, [own], delay, windows, step)[0]
                for log, delay, windows in zip(self.logs, late, self.windows, strict=True)
            ]
            for machine, own, late in every
        ]

    def weights(self, q: list[Array]) -> Array:
        """Return weights of the residual, (r,).

        Beside what is believed of bodies errors count as rarely as they are new; alone it makes no
        difference.
        """
        apart, each = self.apart(q), np.maximum(self.errors(q), 1e-9)
        if self.believed is not None:
            each = each * np.sqrt(autocorrelation_time(apart))
        believed = len(self.belief(np.zeros(len(self.by))))
        return np.append(np.tile(1.0 / each, len(apart)), np.ones(believed))

    def apart(self, q: list[Array]) -> Array:
        """Return errors of positions behind forgotten starts, (N, n); large where one diverged."""
        pairs = zip(q, self.logs, strict=True)
        rows = np.concatenate([(p - log.q)[forgotten(log) :] for p, log in pairs])
        return np.asarray(np.nan_to_num(rows, nan=1.0))

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint, (n,)."""
        return np.asarray(np.sqrt(np.mean(self.apart(q) ** 2, axis=0)))

    def residual(self, q: list[Array], x: Array) -> Array:
        """Return errors of positions, flat, then how far bodies are from what is believed, (r,)."""
        return np.append(self.apart(q), self.belief(x))

    def belief(self, x: Array) -> Array:
        """Return how far bodies and joints' numbers are from what is believed, (b,) [σ]."""
        numbers, e, _ = self.unpack(x)
        return np.zeros(0) if self.believed is None else self.believed.rows(e, numbers)

    def linearise(self, x: Array) -> Array:
        """Return the derivative of the residual, (r, p); trees are varied at once."""
        own = np.flatnonzero(self.varied[: self.at[1]])
        trees, late = self.tree_of[own], slice(self.at[1], None)
        turn = np.array([np.sum(trees[:k] == tree) for k, tree in enumerate(trees)], int)
        groups = [own[turn == k] for k in range(int(turn.max(initial=-1)) + 1)]
        xs = [x, *(self._moved(x, at) for at in (*groups, late))]
        along = np.zeros(len(x)) if self.believed is None else self.scale(x)
        xs += [x + 1e-3 * along] if along.any() else []  # bodies grow by more than a line says
        base, *others = map(self.apart, self.roll(xs, COARSE * STEP))
        J = np.zeros((*base.shape, len(x)))
        for columns, moved in zip(groups, others, strict=False):
            of_tree = self.trees[:, None] == self.tree_of[columns]
            J[:, :, columns] = (moved - base)[:, :, None] * of_tree / self.by[columns]
        ends = np.cumsum([0, *(len(log) - forgotten(log) for log in self.logs)]).tolist()
        for k, (a, b) in enumerate(pairwise(ends), self.at[1]):
            J[a:b, :, k] = (others[len(groups)] - base)[a:b] / self.by[k]
        # Positions say nothing of the scale of all numbers of a tree, and differences of some
        # percent would seem to; springs, stated gains and limits truly do.
        for tree in np.unique(self.trees) if along.any() else ():
            d = np.append(np.where(self.tree_of == tree, along[: self.at[1]], 0.0), 0.0 * x[late])
            true = 1e3 * (others[-1] - base) * (self.trees == tree)
            size = np.sum(J**2, (0, 1)) * d / (np.sum((J * d) ** 2) + 1e-300)
            J -= (J @ d - true)[:, :, None] * size
        beliefs = [self.belief(self._moved(x, k)) - self.belief(x) for k in range(len(x))]
        return np.vstack([J.reshape(-1, len(x)), np.array(beliefs).T / self.by])

    def _moved(self, x: Array, at: slice | np.ndarray | int) -> Array:
        """Return a vector with some numbers varied."""
        out = x.copy()
        out[at] += self.by[at]
        return out

    def scale(self, x: Array) -> Array:
        """Return the direction in which every torque grows, (p,)."""
        assert self.believed is not None
        table = np.where(self.over, 0.0, x[: self.at[0]].reshape(self.over.shape))
        table[-1] = 1.0
        bodies = self.believed.along(x[self.at[0] : self.at[1]])
        every = np.concatenate([table.ravel(), bodies, np.zeros(len(self.logs))])
        return np.asarray(self.varied * every)
