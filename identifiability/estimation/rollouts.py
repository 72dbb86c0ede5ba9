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

#: Length of blocks of time whose errors are taken to be independent, and of the windows in which a
#: search begins [s].
TOGETHER: Tolerance = 1.0

#: No delay that is looked for is longer [s].
LATEST: Tolerance = 0.06

#: What is found of each joint: rotor, viscous and dry friction, offset.
KINDS = ("Ia", "Fv", "Fc", "off")

#: Share of the inertia, damping and torque of a joint by which its numbers are varied, and of a
#: sampling step by which the delay is.
VARIED: Tolerance = 1e-4

#: The search ends where a step promises less than this share of what noise makes of one number
#: (σ²), or after so many derivatives.
CLOSE: Tolerance = 0.1
STEPS = 8


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
        return by_name(robot, self.numbers)


def by_name(robot: Robot, numbers: Mapping[str, Array]) -> dict[str, float]:
    """Return standard parameters of joints by name, of numbers by kind."""
    return {
        f"{joint}.{robot.inertia_parts[0] if kind == 'Ia' else kind}": float(value)
        for kind in KINDS
        for joint, value in zip(robot.joints, numbers[kind], strict=True)
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
    numbers = machine.numbers()
    x = np.concatenate([*(numbers[k] for k in KINDS), late])
    problem = Problem(machine, tuple(logs), delay)
    before = problem.errors(problem.roll([x])[0])
    if not fitted:
        # Begun anew all the time, a rollout follows even where numbers are far from the robot's.
        x, *_ = _descend(Problem(machine, tuple(logs), delay, anew=TOGETHER), x, steps)
    x, q, J, r = _descend(problem, x, steps, 0.25 * STEP)
    numbers, delays, _ = problem.unpack(x)
    sure = np.zeros(len(logs)) if delay is not None else problem.delay_errors(J, r)
    return Rollouts(numbers, delays, problem.errors(q), before, sure)


class Believed(Protocol):
    """Bodies as functions of coordinates, and what is believed of those."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """The body of each coordinate, (m,)."""

    def values(self, e: Array) -> dict[str, float]:
        """Return standard parameters at some coordinates (m,)."""

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

    First with the file's bodies: each joint starts at the best of some natural frequencies, damped
    critically. Then with bodies as they are believed.

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
    servo = robot.servo
    assert servo is not None
    told = all(log.dq_ref is not None for log in logs)
    kinds = (*KINDS, "kv", "kp") if told else (*KINDS, "kp")
    free = {"kp": np.isnan(servo.kp), "kv": np.isnan(servo.kv)}
    servo, numbers = _start(robot, servo, min(logs, key=len))
    machine = CommandedRobot(robot, {}, servo)
    x = np.concatenate([*(numbers[k] for k in kinds), np.full(len(logs), servo.delay or 0.0)])
    for of, anew in ((None, TOGETHER), (believed, np.inf)):
        problem = Problem(machine, tuple(logs), servo.delay, kinds, free, of, anew)
        x = np.insert(x, problem.at[0], np.zeros(problem.at[1] - problem.at[0]))
        x, q, J, _ = _descend(problem, x, 3 * STEPS)
    numbers, _, _ = problem.unpack(x)
    n, at = len(robot.joints), kinds.index("kp") * len(robot.joints)
    size = np.linalg.norm(J, axis=0)
    size = np.where(size > 0, size, 1.0)  # of gains that are stated
    H = np.linalg.pinv((J / size).T @ (J / size), hermitian=True) / np.outer(size, size)
    kp = np.maximum(numbers["kp"], 1e-12)
    covariance = H[at : at + n, at : at + n] / np.outer(kp, kp)
    found = free["kp"] if free["kp"].any() else np.ones(n, bool)
    mean = (found / kp / found.sum()) @ H[at : at + n]
    by = J[len(J) - len(problem.belief(x)) :] @ mean
    return Gains(machine.servo.having(numbers), numbers, problem.errors(q), covariance, by)


def _start(robot: Robot, servo: Servo, log: Log) -> tuple[Servo, dict[str, Array]]:
    """Return servos and joints' numbers from which the search for gains begins."""
    free = np.isnan(servo.kp)
    guess = replace(servo, kp=np.where(free, 1.0, servo.kp), kv=np.nan_to_num(servo.kv))
    machine = CommandedRobot(robot, {}, guess)
    inertia, numbers = machine.inertia(log.q.mean(0)), machine.numbers()
    fastest = 1.0 / signals.sampling_step(log.t)
    speeds = np.geomspace(2.0, min(250.0, fastest), 9)[:, None]  # [rad/s]
    kp = np.where(free, inertia * speeds**2, servo.kp)
    damping = np.where(free, 2 * inertia * speeds, numbers["Fv"])
    tries = [{**numbers, "kp": p, "Fv": d} for p, d in zip(kp, damping, strict=True)]
    q = machine.roll(log, tries, servo.delay or 0.0)
    best = np.nan_to_num((q - log.q) ** 2, nan=1e6).mean(1).argmin(0)
    kp, damping = (x[best, np.arange(len(best))] for x in (kp, damping))
    return replace(guess, kp=kp), {**numbers, "kp": kp, "kv": guess.kv, "Fv": damping}


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


def _descend(
    problem: Problem, x: Array, steps: int, width: float = STEP
) -> tuple[Array, list[Array], Array, Array]:
    """Return the vector after damped Gauss–Newton steps, and positions along the logs.

    Then the last derivative of the residual (r, p), and the last residual (r,). Rollouts are of
    that width [s].
    """
    q = problem.roll([x], width)[0]
    damping = 1e-3
    J, r = np.zeros((0, len(x))), np.zeros(0)
    for _ in range(steps):
        weights, memory = problem.weights(q)
        J, r = problem.linearise(x, weights), problem.residual(q, weights, x)
        Q, R = np.linalg.qr(J)
        size, right = np.sqrt((R**2).sum(0)) + 1e-12, Q.T @ r
        least = CLOSE * memory / len(r) * float(r @ r)
        for _ in range(6):  # more damped each time
            rows = np.vstack([R, np.sqrt(damping) * np.diag(size)])
            wanted = np.concatenate([-right, np.zeros(len(size))])
            step = lsq_linear(rows, wanted, problem.bounds(x), method="bvls").x
            left = right + R @ step
            if right @ right - left @ left <= least:
                return x, q, J, r
            moved = problem.roll([x + step], width)[0]
            found = problem.residual(moved, weights, x + step)
            if found @ found < r @ r:
                x, q, r, damping = x + step, moved, found, max(damping / 10, 1e-8)
                break
            damping = 10 * damping
        else:
            break
    return x, q, J, r


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
        none = np.zeros(len(machine.robot.joints), bool)
        problem = Problem(machine, (log,), None, free=dict.fromkeys(KINDS, none))
        numbers = machine.numbers()
        x = np.concatenate([*(numbers[k] for k in KINDS), [0.0]])
        delay = float(_descend(problem, x, STEPS)[0][-1])
    return delay, machine.roll(log, delay=delay)[0]


class Problem:
    """Positions of the rollouts of all logs, as a function of one vector of numbers.

    The vector holds numbers of the joints by kind, coordinates of bodies, and a delay for each log.

    Parameters
    ----------
    machine : CommandedRobot
    logs : tuple of Log
    delay : float or None [s]
        Where it is known.
    kinds : tuple of str
        Of the joints' numbers.
    free : mapping of str to (n,) bool
        Kinds that are varied at some joints only.
    believed : Believed, optional
        Of bodies that are varied, too.
    anew : float [s]
        After which rollouts begin from the log again; by default never.
    """

    def __init__(
        self,
        machine: CommandedRobot,
        logs: tuple[Log, ...],
        delay: float | None,
        kinds: tuple[str, ...] = KINDS,
        free: Mapping[str, np.ndarray] | None = None,
        believed: Believed | None = None,
        anew: float = np.inf,
    ) -> None:
        self.machine, self.logs, self.kinds, self.believed = machine, logs, kinds, believed
        self.n = len(machine.robot.joints)
        self.dt = min(signals.sampling_step(log.t) for log in logs)
        self.rows = [int(min(anew / self.dt, len(log))) for log in logs]
        inertia, servo = machine.inertia(logs[0].q.mean(0)), machine.servo
        moved = np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
        torque = np.minimum(np.maximum(servo.kp, servo.kv) * moved, np.minimum(servo.high, 1e9))
        damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
        each = {"Ia": inertia, "Fv": damping, "Fc": torque, "off": torque}
        each |= {"kp": servo.kp, "kv": damping}
        bodies, late = np.ones(len(believed.bodies) if believed else 0), np.ones(len(logs))
        #: Where the coordinates of bodies begin, and where delays do.
        self.at = len(kinds) * self.n, len(kinds) * self.n + len(bodies)
        self.varied = VARIED * np.concatenate([*(each[k] for k in kinds), bodies, self.dt * late])
        every = dict.fromkeys(kinds, np.ones(self.n, bool)) | (dict(free) if free else {})
        self.open = np.concatenate([*(every[k] for k in kinds), bodies > 0, late * (delay is None)])
        signed = [np.full(self.n, k == "off") for k in kinds]
        self.signed = np.concatenate([*signed, bodies > 0, late > 0])
        self.machine_of = lru_cache(maxsize=4)(self._machine_of)

    def _machine_of(self, bodies: bytes) -> CommandedRobot:
        """Return the robot with bodies at some coordinates."""
        assert self.believed is not None
        values = self.believed.values(np.frombuffer(bodies))
        return CommandedRobot(self.machine.robot, values, self.machine.servo)

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array, Array]:
        """Return the numbers of a vector, delays, and coordinates of bodies."""
        a, b = self.at
        rows = x[:a].reshape(len(self.kinds), -1).copy()
        return dict(zip(self.kinds, rows, strict=True)), x[b:].copy(), x[a:b].copy()

    def bounds(self, x: Array) -> tuple[Array, Array]:
        """Return the least and largest step: no friction, rotor or gain becomes negative."""
        low = np.where(self.signed, -np.inf, -0.8 * x)
        low[self.at[1] :] = -self.dt - x[self.at[1] :]  # a command is as old as the row before
        low, high = np.where(self.open, [low, np.full(len(x), np.inf)], 0.0)
        return np.minimum(low, -1e-12), np.maximum(high, 1e-12)

    def delay_errors(self, J: Array, r: Array) -> Array:
        """Return standard deviations of the delays, (L,) [s]: a jackknife over blocks of time."""
        size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        scaled, rows = J / size, self.n * max(1, round(TOGETHER / self.dt))
        parts = [(scaled[k : k + rows], r[k : k + rows]) for k in range(0, len(r), rows)]
        whole = scaled.T @ scaled
        moved = [np.linalg.pinv(whole - X.T @ X, hermitian=True) @ (X.T @ y) for X, y in parts]
        spread = np.sqrt(np.sum(np.square(moved), axis=0) * (1.0 - 1.0 / max(len(parts), 1)))
        return np.asarray((spread / size)[self.at[1] :])

    def roll(self, xs: Sequence[Array], step: float = STEP) -> list[list[Array]]:
        """Return positions along every log, for several vectors."""
        every = [self.unpack(x) for x in xs]
        machines = [self.machine_of(e.tobytes()) if len(e) else self.machine for _, _, e in every]
        pairs = zip(machines, every, strict=True)
        step = min(step, *(m.longest(numbers) for m, (numbers, _, _) in pairs))
        out: list[list[Array]] = [[] for _ in xs]
        for machine in dict.fromkeys(machines):
            own = [k for k, m in enumerate(machines) if m is machine]
            numbers = [every[k][0] for k in own]
            for i, log in enumerate(self.logs):
                late = [every[k][1][i] for k in own]
                windows = [*pairwise([*range(0, len(log) - 1, self.rows[i]), len(log)])]
                rolled = machine.roll(log, numbers, late, windows, step)
                for k, q in zip(own, rolled, strict=True):
                    out[k].append(q)
        return out

    def weights(self, q: list[Array]) -> tuple[Array, float]:
        """Return weights of errors of positions, (n,), and of how many samples each is new.

        Beside what is believed of bodies errors count as rarely as they are new; alone it makes no
        difference.
        """
        pairs = zip(q, self.logs, strict=True)
        times = [autocorrelation_time(np.nan_to_num(x - log.q)) for x, log in pairs]
        most = np.max(times, axis=0)
        rarely = 1.0 if self.believed is None else np.sqrt(most)
        return np.asarray(1.0 / (np.maximum(self.errors(q), 1e-9) * rarely)), float(most.mean())

    def residual(self, q: list[Array], weights: Array, x: Array) -> Array:
        """Return weighted errors of positions, flat; what diverged is far off.

        Behind them is how far bodies are from what is believed.
        """
        pairs = zip(q, self.logs, strict=True)
        parts = [((p - log.q) * weights)[forgotten(log) :].ravel() for p, log in pairs]
        out: Array = np.nan_to_num(np.concatenate([*parts, self.belief(x)]), nan=1e6)
        return out

    def belief(self, x: Array) -> Array:
        """Return how far bodies are from what is believed, (r,) [σ]."""
        numbers, _, e = self.unpack(x)
        return np.zeros(0) if self.believed is None else self.believed.rows(e, numbers)

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint, (n,)."""
        pairs = zip(q, self.logs, strict=True)
        square = np.concatenate([((x - log.q) ** 2)[forgotten(log) :] for x, log in pairs])
        out: Array = np.sqrt(np.nan_to_num(square, nan=1.0).mean(0))
        return out

    def linearise(self, x: Array, weights: Array) -> Array:
        """Return the derivative of the residual, (r, p): each number is varied, and all delays."""
        late = self.at[1]
        columns = np.flatnonzero(self.open[:late])
        steps = np.zeros((len(columns) + 1, len(x)))
        steps[np.arange(len(columns)), columns] = self.varied[columns]
        steps[-1, late:] = self.varied[late:]
        base, *others = self.roll([x, *(x + steps)])
        r = self.residual(base, weights, x)
        *changes, later = [
            (self.residual(q, weights, x + step) - r) / step.max()
            for q, step in zip(others, steps, strict=True)
        ]
        J = np.zeros((len(r), len(x)))
        for column, change in zip(columns, changes, strict=True):
            J[:, column] = change
        ends = np.cumsum([0, *(self.n * (len(log) - forgotten(log)) for log in self.logs)])
        for k, (a, b) in enumerate(pairwise(ends.tolist())):
            J[a:b, late + k] = later[a:b]
        return J
