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
import scipy

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

#: Step of rollouts whose differences alone are looked at [s], and of those that tell numbers.
COARSE: Tolerance = 2.5 * STEP

#: Where a third of a log is so long, the search begins on that: steps there cost a third [s].
ENOUGH: Tolerance = 2.0

#: A step is taken again, more damped, so often; and the search ends where one promises less than
#: these shares of the error and of what noise makes of one number (σ²), or after so many
#: derivatives.
TRIED = 6
GAIN: Tolerance = 5e-3
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
    thirds = tuple(_middle(log) for log in logs)
    if not fitted and all(t[-1] - t[0] > ENOUGH for t in (log.t for log in thirds)):
        # Begun anew all the time, a rollout follows even where numbers are far from the robot's.
        x, *_ = _descend(Problem(machine, thirds, delay, anew=TOGETHER), x, steps)
        middle = Problem(machine, thirds, delay)
        x, q, *_ = _descend(middle, x, steps)
        errors = middle.errors(q)
        if contradicted(share_missed(errors, logs)):  # nor will whole logs be followed
            numbers, delays, _ = problem.unpack(x)
            return Rollouts(numbers, delays, errors, before, np.zeros(len(logs)))
    # Step of rollouts whose differences alone are looked at [s], and of those that tell
    # numbers.
    x, q, J, r = _descend(problem, x, steps, 0.25 * STEP)
    numbers, delays, _ = problem.unpack(x)
    sure = np.zeros(len(logs)) if delay is not None else problem.delay_errors(J, r, x)
    return Rollouts(numbers, delays, problem.errors(q), before, sure)


class Believed(Protocol):
    """Bodies as functions of coordinates, and what is believed of those."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """The body of each coordinate, (m,)."""

    def values(self, e: Array) -> dict[str, float]:
        """Return standard parameters at some coordinates (m,)."""

    def scaled(self, e: Array, by: float) -> Array:
        """Return the coordinates of bodies that are so many times as heavy and alike."""

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

    First with the file's bodies: the start is the best of a grid of natural frequencies and damping
    ratios, for what each joint feels of inertia. Then with bodies as they are believed.

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
    start = _start(robot, servo, min(logs, key=len))
    machine = CommandedRobot(robot, {}, start[0])
    late = np.full(len(logs), servo.delay or 0.0)
    x = np.concatenate([*(start[1][k] for k in kinds), late])
    thirds = [_middle(log) for log in logs]
    thirds = thirds if all(t.t[-1] - t.t[0] > ENOUGH for t in thirds) else list(logs)
    for part, of in ((thirds, None), (thirds, believed), (logs, believed)):
        problem = Problem(machine, tuple(part), servo.delay, kinds, free, of)
        x = problem.extended(x)
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
    by = J[len(J) - problem.believed_rows :] @ mean
    return Gains(machine.servo.having(numbers), numbers, problem.errors(q), covariance, by)


def _start(robot: Robot, servo: Servo, log: Log) -> tuple[Servo, dict[str, Array]]:
    """Return servos and joints' numbers from which the search for gains begins."""
    # Where a third of a log is so long, the search begins on that: steps there cost a third
    # [s].
    if len(log) * signals.sampling_step(log.t) > 3 * ENOUGH:
        log = _middle(log)
    free = np.isnan(servo.kp)
    guess = replace(servo, kp=np.where(free, 1.0, servo.kp), kv=np.nan_to_num(servo.kv))
    machine = CommandedRobot(robot, {}, guess)
    inertia, numbers = machine.inertia(log.q.mean(0)), machine.numbers()
    late = servo.delay or 0.0
    fastest = 1.0 / signals.sampling_step(log.t)
    # Frequencies [rad/s] and damping ratios of a servo and what it moves, then factors about them.
    grid = [(w, z) for w in np.geomspace(2, 250, 9) if w < fastest for z in (0.3, 1.0, 3.0)]
    nearer = [(a, b) for a in (0.6, 1.0, 1.7) for b in (0.6, 1.0, 1.7)]
    w, z = np.sqrt(guess.kp / inertia), np.ones(len(inertia))
    for factors in (grid, nearer, [(1.0, 1.0)]):
        tries = []
        for a, b in factors:
            v, d = (a, b) if factors is grid else (a * w, b * z)
            kp = np.where(free, inertia * v**2, servo.kp)
            damping = np.where(free, 2 * inertia * v * d, numbers["Fv"])
            tries.append({**numbers, "kp": kp, "kv": guess.kv, "Fv": damping})
        q = machine.roll(log, tries, late, step=COARSE)
        errors = np.nan_to_num((q - log.q) ** 2, nan=1e6).mean(1)
        best = errors.argmin(0)
        chosen = np.array(factors)[best]
        w, z = chosen.T if factors is grid else (chosen[:, 0] * w, chosen[:, 1] * z)
    return replace(guess, kp=tries[0]["kp"]), tries[0]


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


def _middle(log: Log) -> Log:
    """Return the middle third of a log, as they often begin and end at rest."""
    return log.rows(len(log) // 3, 2 * len(log) // 3)


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
        least = min(GAIN, CLOSE * memory / len(r)) * float(r @ r)
        for _ in range(TRIED):
            rows = np.vstack([R, np.sqrt(damping) * np.diag(size)])
            wanted = np.concatenate([-right, np.zeros(len(size))])
            step = scipy.optimize.lsq_linear(rows, wanted, problem.bounds(x), method="bvls").x
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
    if delay is not None:
        return delay, machine.roll(log, delay=delay)[0]
    none = np.zeros(len(machine.robot.joints), bool)
    problem = Problem(machine, (log,), None, free=dict.fromkeys(KINDS, none))
    numbers = machine.numbers()
    x, *_ = _descend(problem, np.concatenate([*(numbers[k] for k in KINDS), [0.0]]), STEPS)
    late = float(x[-1])
    return late, machine.roll(log, delay=late)[0]


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
        self.machine, self.logs, self.known = machine, logs, delay
        self.kinds, self.believed, robot = kinds, believed, machine.robot
        self.n = len(robot.joints)
        self.dt = min(signals.sampling_step(log.t) for log in logs)
        self.rows = [int(min(anew / self.dt, len(log))) for log in logs]
        inertia = machine.inertia(logs[0].q.mean(0))
        servo = machine.servo
        moved = np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
        torque = np.minimum(
            np.maximum(servo.kp * 0.3 * moved, servo.kv * moved), np.minimum(servo.high, 1e9)
        )
        damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
        each = {"Ia": inertia, "Fv": damping, "Fc": torque, "off": torque}
        each |= {"kp": servo.kp, "kv": damping}
        bodies = believed.bodies if believed else ()
        #: Where the coordinates of bodies begin, and where delays do.
        self.at = len(kinds) * self.n, len(kinds) * self.n + len(bodies)
        self.varied = VARIED * np.concatenate([*(each[k] for k in kinds), np.ones(len(bodies))])
        ones = np.ones(self.n, bool)
        fixed = [~(free or {}).get(k, ones) for k in kinds]
        self.fixed = np.concatenate([*fixed, np.zeros(len(bodies), bool)])
        self.trees = machine.trees
        #: Which tree each number is of.
        self.tree_of = np.concatenate([np.tile(self.trees, len(kinds)), machine.trees_of(bodies)])
        #: One number of each tree, which are varied at once.
        self.groups: list[np.ndarray] = []
        ends = [*range(0, self.at[0] + 1, self.n), *([self.at[1]] if bodies else [])]
        for a, b in pairwise(ends):
            own = np.flatnonzero(~self.fixed[a:b]) + a
            trees = self.tree_of[own]
            place = np.array([np.sum(trees[:k] == t) for k, t in enumerate(trees)], int)
            self.groups += [own[place == k] for k in range(int(place.max(initial=-1)) + 1)]
        self.machine_of = lru_cache(maxsize=4)(self._machine_of)

    def _machine_of(self, bodies: bytes) -> CommandedRobot:
        """Return the robot with bodies at some coordinates."""
        assert self.believed is not None
        values = self.believed.values(np.frombuffer(bodies))
        return CommandedRobot(self.machine.robot, values, self.machine.servo)

    def extended(self, x: Array) -> Array:
        """Return a vector of a problem of the same joints with coordinates of bodies, as believed.

        If it has them already it stays.
        """
        if len(x) == self.at[1] + len(self.logs):
            return x
        return np.insert(x, self.at[0], np.zeros(self.at[1] - self.at[0]))

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array, Array]:
        """Return the numbers of a vector, delays, and coordinates of bodies."""
        a, b = self.at
        rows = x[:a].reshape(len(self.kinds), -1).copy()
        return dict(zip(self.kinds, rows, strict=True)), x[b:].copy(), x[a:b].copy()

    def bounds(self, x: Array) -> tuple[Array, Array]:
        """Return the least and largest step: no friction, rotor or gain is negative."""
        low, high = np.full(len(x), -np.inf), np.full(len(x), np.inf)
        for k, kind in enumerate(self.kinds):
            if kind != "off":
                own = slice(k * self.n, (k + 1) * self.n)
                low[own] = -0.8 * x[own] if kind == "kp" else -x[own]
        fixed = np.flatnonzero(self.fixed)
        low[fixed], high[fixed] = -1e-12, 1e-12
        # A command was given at any time since the row before.
        late = slice(self.at[1], None)
        low[late] = -self.dt - x[late]
        if self.known is not None:
            low[late], high[late] = -1e-12, 1e-12
        return np.minimum(low, -1e-12), high

    def delay_errors(self, J: Array, r: Array, x: Array) -> Array:
        """Return standard deviations of the delays, (L,) [s].

        The larger one of two: that of a jackknife over blocks of time, as residuals of few blocks
        are small where many numbers follow them, and that of other records of the same rollouts,
        as where steps of encoders lie is the same in every block.
        """
        if not len(r):
            return np.zeros(len(self.logs))
        size = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
        scaled, late = J / size, slice(self.at[1], None)
        rows = self.n * max(1, round(TOGETHER / self.dt))
        parts = [slice(k, k + rows) for k in range(0, len(r), rows)]
        whole = scaled.T @ scaled
        moved = [
            np.linalg.pinv(whole - scaled[k].T @ scaled[k], hermitian=True) @ (scaled[k].T @ r[k])
            for k in parts
        ]
        blocks = np.sum(np.square(moved), axis=0)[late] * (len(parts) - 1) / len(parts)
        rng, q = np.random.default_rng(RECORDS), self.roll([x])[0]
        weights, _ = self.weights(q)
        follows = np.linalg.pinv(scaled)[late]
        others = []
        for _ in range(RECORDS):
            again = [record(p, log, rng) for p, log in zip(q, self.logs, strict=True)]
            others.append(follows @ self.residual(again, weights, x))
        return np.asarray(np.sqrt(np.maximum(blocks, np.var(others, axis=0))) / size[late])

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
        errors = np.maximum(self.errors(q), 1e-9)
        pairs = zip(q, self.logs, strict=True)
        times = [autocorrelation_time(np.nan_to_num(x - log.q)) for x, log in pairs]
        most = np.max(times, axis=0)
        rarely = 1.0 if self.believed is None else np.sqrt(most)
        return np.asarray(1.0 / (errors * rarely)), float(most.mean())

    def residual(self, q: list[Array], weights: Array, x: Array) -> Array:
        """Return weighted errors of positions, flat; what diverged is far off.

        Behind them is how far bodies are from what is believed.
        """
        pairs = zip(q, self.logs, strict=True)
        parts = [((p - log.q) * weights)[forgotten(log) :].ravel() for p, log in pairs]
        out = np.nan_to_num(np.concatenate(parts), nan=1e6)
        return np.asarray(np.concatenate([out, self._belief(x)]))

    def _belief(self, x: Array) -> Array:
        if self.believed is None:
            return np.zeros(0)
        numbers, _, e = self.unpack(x)
        return self.believed.rows(e, numbers)

    @property
    def believed_rows(self) -> int:
        """How many rows of the residual are about what is believed."""
        return len(self._belief(np.zeros(self.at[1] + len(self.logs))))

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint, (n,)."""
        pairs = zip(q, self.logs, strict=True)
        square = np.concatenate([((x - log.q) ** 2)[forgotten(log) :] for x, log in pairs])
        out: Array = np.sqrt(np.nan_to_num(square, nan=1.0).mean(0))
        return out

    def linearise(self, x: Array, weights: Array) -> Array:
        """Return the derivative of the residual, (r, p).

        That by a gain comes from a joint all of whose numbers are larger: what bodies alone tell of
        its scale is little, and would drown in errors of differences of large numbers.
        """
        n = self.n
        steps = [self._step(x, columns) for columns in self.groups]
        scaled = [] if self.believed is None else [self.scaled(x, 1 + VARIED)]
        late = x.copy()
        late[self.at[1] :] += LATER * self.dt
        base, *others = self.roll([x, *(x + step for step in steps), *scaled, late], COARSE)
        r = self.residual(base, weights, x)
        data = len(r) - len(self._belief(x))
        changes = [(self.residual(q, weights, x) - r)[:data] for q in others]
        J = np.zeros((len(r), len(x)))
        for change, columns, step in zip(changes, self.groups, steps, strict=False):
            for column in columns:
                beside = np.flatnonzero(step)
                beside = beside[
                    (beside % n == column % n) & (np.isin(beside, columns, invert=True))
                ]
                along = self._of_tree(change, int(self.tree_of[column]))
                J[:data, column] = (along - J[:data, beside] @ step[beside]) / step[column]
        if self.believed is not None:
            self._tell_scale(J[:data], x, changes[-2] / VARIED)
            for column in np.flatnonzero(~self.fixed):
                own = x.copy()
                own[column] += self.varied[column]
                J[data:, column] = (self._belief(own) - r[data:]) / self.varied[column]
        change = changes[-1] / (LATER * self.dt)
        ends = np.cumsum([0, *(n * (len(log) - forgotten(log)) for log in self.logs)])
        for k, (a, b) in enumerate(pairwise(ends.tolist())):
            J[a:b, self.at[1] + k] = change[a:b]
        return J

    def _of_tree(self, rows: Array, tree: int) -> Array:
        """Return rows of errors, flat, of the joints of a tree; zero of others."""
        return np.asarray(np.where(self.trees == tree, rows.reshape(-1, self.n), 0.0).ravel())

    def _step(self, x: Array, columns: np.ndarray) -> Array:
        """Return by how much a vector is varied for some columns, (p,)."""
        out = np.zeros(len(x))
        out[columns] = self.varied[columns]
        if columns[0] < self.at[0] and self.kinds[columns[0] // self.n] == "kp":
            every = (columns[:, None] % self.n + self.n * np.arange(len(self.kinds))).ravel()
            out[every] = np.where(self.fixed[every], 0.0, VARIED * x[every])
        return out

    def scaled(self, x: Array, by: float) -> Array:
        """Return a vector of which every torque is so many times as large."""
        assert self.believed is not None
        a, b = self.at
        out = x.copy()
        out[:a] = np.where(self.fixed[:a], x[:a], by * x[:a])
        out[a:b] = self.believed.scaled(x[a:b], by)
        return out

    def _tell_scale(self, J: Array, x: Array, change: Array) -> None:
        """Let a derivative (r, p) by the numbers of a tree be that by their scale.

        Positions say nothing of it, and differences of some percent would seem to; springs, stated
        gains and limits truly do.

        Parameters
        ----------
        J : (r, p)
        x : (p,)
        change : (r,)
            Of the residual, by the logarithm of the scale of all trees.
        """
        along = (self.scaled(x, 1 + 1e-6) - x) / 1e-6
        for tree in dict.fromkeys(self.trees.tolist()):
            d = np.zeros(len(x))
            own = np.flatnonzero(self.tree_of == tree)
            d[own] = along[own]
            size = (np.linalg.norm(J, axis=0) ** 2 * d) / (np.linalg.norm(J * d) ** 2 + 1e-300)
            J -= np.outer(J @ d - self._of_tree(change, tree), size)
