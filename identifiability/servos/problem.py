"""`RolloutProblem`: positions of the rollouts of all logs, as a function of one vector of numbers.

Only positions are compared, so nothing is differentiated and columns have no noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from identifiability.effects.vocabulary import drop_follower_friction
from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import remember
from identifiability.logs import Log, signals
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.simulation.rollout import COARSE, STEP, CommandedRobot, forgotten

from .positions import recording_error
from .rollouts import KINDS
from .torque import servo_log
from .windows import WINDOW, Window

#: Standard deviation of the logarithm of an unknown gain about its start.
LOOSE: Tolerance = 1.0

#: Differences of numbers as shares of a joint's inertia, damping and torque. Then those of the
#: delay as a share of a sampling step, and of the logarithm of a gain or of a robot's scale.
VARIED: Tolerance = 2e-4
LATER: Tolerance = 0.05

#: Usual step of rollouts as a share of a sampling step.
FINE: Tolerance = 0.1

#: Play by which a gear without any is varied [rad or m]: smaller play is lost in noise.
PLAY = 100 * VARIED


class RolloutProblem:
    """Positions of the rollouts of all logs, as a function of one vector of numbers.

    The vector holds numbers of the joints by kind, half the logarithm of each body's relative size,
    and the delay of each log. It holds the logarithm of an unknown gain: kv, where kp is zero. The
    other numbers of its joint are divided by it: positions hardly determine their common factor.

    Parameters
    ----------
    machine : CommandedRobot
    windows : sequence of Window
        Stretches of the logs. A joint counts in the windows in which its command moves.
    free : (kinds, n) bool
        Joints at which each kind of number is varied.
    delay : float [s], optional
        Where it is known.
    shares : mapping of str to float
        Bodies whose sizes are varied, and within which share each is the file's.
    """

    def __init__(
        self,
        machine: CommandedRobot,
        windows: Sequence[Window],
        free: np.ndarray,
        delay: float | None = None,
        shares: NumberByName | None = None,
    ) -> None:
        self.machine = machine
        #: Robots by which joints integrate, because their models are built anew.
        self.integrating = dict[tuple[bool, ...], CommandedRobot]()
        #: The last robots with sized bodies.
        self.sized = dict[Any, CommandedRobot]()
        self.windows = windows
        self.shares = shares or {}
        self.trees = machine.trees
        self.dt = min(signals.sampling_step(log.t) for log in self.logs)
        self.bodies = slice(free.size, free.size + len(self.shares))
        self.delays = slice(self.bodies.stop, None)
        #: Which tree each number belongs to.
        of_bodies = machine.trees_of([*self.shares])
        self.tree_of = np.concatenate([np.tile(self.trees, len(free)), of_bodies])
        #: Numbers that are divided by the factor of their joint's gain, (kinds, n).
        self.over = free.copy()
        self.over[-1] = False
        self.over[KINDS.index("kv")] |= machine.servo.kp == 0
        varied_sizes = np.ones(len(self.shares), bool)
        count = 1 + max(window.log for window in windows)
        varied_delays = np.full(count, delay is None)
        #: Numbers that are varied, (p,) bool.
        self.varied = np.concatenate([free.ravel(), varied_sizes, varied_delays])
        steps = [*list_steps(machine, self.logs), np.full(len(self.shares), VARIED)]
        #: Share of the squared errors that a stated gain leaves once it is free, and whether its kv
        #: may be right, by its number.
        self.freed = dict[int, tuple[float, bool]]()
        #: Differences by which each number is varied, (p,).
        self.by = np.concatenate([*steps, np.full(count, LATER * self.dt)])

    @property
    def logs(self) -> list[Log]:
        """Rows of the windows."""
        return [window.rows for window in self.windows]

    @property
    def moves(self) -> np.ndarray:
        """Joints whose command moves, by window, (windows, n) bool."""
        return np.array([window.moves for window in self.windows])

    @property
    def recorded(self) -> Array:
        """Errors of recording in `differences` (rms), (windows, n): of two rows without kp."""
        rows = 1 + (self.machine.servo.kp == 0)
        return np.sqrt(rows) * [recording_error(log) for log in self.logs]

    def exceeds(self, errors: Array) -> np.ndarray:
        """Return where errors of joints (n,) exceed those of recording, (n,) bool."""
        exceed: np.ndarray = errors**2 > 2.0 * self.recorded.max(0) ** 2
        return exceed

    @property
    def source(self) -> np.ndarray:
        """Which log each window is of, (windows,) int."""
        return np.array([window.log for window in self.windows], int)

    @property
    def scale(self) -> Array:
        """Size of each number of the vector, (p,)."""
        return self.by / VARIED

    def at(self, kind: str) -> np.ndarray:
        """Return the indices of the numbers of a kind in the vector, (n,) int."""
        n = len(self.trees)
        return KINDS.index(kind) * n + np.arange(n)

    def list_scaled(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Return `over` if numbers (k,) are varied: for gains, first with kv that grows with kp.

        A drive scales the torque of all gains of a joint, but kp alone may be wrong as well.
        """
        scaled = self.over.copy()
        joints = numbers % len(self.trees)
        is_kp = np.isin(numbers, self.at("kp"))
        scaled[KINDS.index("kv"), joints] |= is_kp & (self.machine.servo.kv[joints] > 0)
        return [scaled] * bool(np.any(scaled != self.over)) + [self.over]

    def parameters(self, numbers: Mapping[str, Array]) -> dict[str, float]:
        """Return standard parameters by name: of joints, and of scaled bodies."""
        robot = self.machine.robot
        sizes = np.exp(2 * numbers["sizes"])
        bodies = zip(self.shares, sizes, strict=True)
        pairs = [(f"{body}.{kind}", x) for body, x in bodies for kind in INERTIAL_KINDS]
        parameters = {name: x * robot.nominal[name] for name, x in pairs}
        parameters |= drop_follower_friction(robot)
        for kind in KINDS[:4]:
            name = robot.inertia_parts[0] if kind == "Ia" else kind
            # A bound may be passed by rounding.
            possible = numbers[kind] if kind == "off" else np.maximum(numbers[kind], 0.0)
            values = zip(robot.joints, possible.tolist(), strict=True)
            parameters |= {f"{joint}.{name}": value for joint, value in values}
        return parameters

    def pack(self, numbers: Mapping[str, Array], delay: Any) -> Array:
        """Return the vector of joints' numbers and delays, with bodies of the file's size."""
        none = np.zeros(len(self.trees))
        rows = [numbers.get(kind, none) for kind in KINDS[:-1]]
        sizes = np.zeros(len(self.shares))
        delays = np.full(len(self.by) - self.bodies.stop, delay)
        return np.concatenate([*rows, none, sizes, delays])

    def unpack(self, x: Array) -> tuple[dict[str, Array], Array]:
        """Return the numbers of a vector, and delays."""
        table = x[: self.over.size].reshape(self.over.shape)
        scales = np.exp(self.over * table[-1])
        numbers = dict(zip(KINDS, table * scales, strict=True))
        gains = self.machine.servo.kp * np.exp(table[-1])
        # An integral replaces any constant torque.
        numbers["off"] = np.where(numbers["ki"] > 0, 0.0, numbers["off"])
        return {**numbers, "kp": gains, "sizes": x[self.bodies]}, x[self.delays]

    def replace_numbers(self, x: Array, numbers: Mapping[str, Array], joints: np.ndarray) -> Array:
        """Return the vector with other numbers of some joints, (n,) bool, where they are varied."""
        count = self.over.size
        table = x[:count].reshape(self.over.shape).copy()
        servo = self.machine.servo
        log_kp = np.log(servo.having(numbers).gain / servo.gain)
        others = [numbers.get(kind, 0.0 * log_kp) for kind in KINDS[:-1]]
        replaced = np.array([*others, log_kp]) / np.exp(self.over * log_kp)
        is_replaced = self.varied[:count].reshape(self.over.shape) & joints
        return np.append(np.where(is_replaced, replaced, table), x[count:])

    def bounds(self, x: Array) -> Array:
        """Return the least and largest step, (2, p): no friction or rotor is negative.

        The response to a gain is curved, so that a step changes it by a third at most.
        """
        unbounded = np.isin(KINDS, ("off", "kp")).repeat(len(self.trees))
        low = np.full(len(x), -np.inf)
        to_zero = -x[: len(unbounded)]
        low[: len(unbounded)] = np.where(unbounded, -np.inf, to_zero)
        # A command was given at any time since the row before.
        low[self.delays] = -self.dt - x[self.delays]
        lower = np.minimum(low, -1e-12)
        upper = np.full(len(x), np.inf)
        log_kp = self.at("kp")
        lower[log_kp] = -0.3
        upper[log_kp] = 0.3
        return np.stack([lower, upper])

    def move(self, x: Array, step: Array) -> Array:
        """Return the vector after a step on the curve along which a gain keeps the motion.

        Fv and rotors replace a known kv, whose ratio to the gain is curved.
        """
        log_kp = self.at("kp")
        turn = step[log_kp]
        others = self._scales(x) - np.eye(len(x))[log_kp]
        bent = (np.expm1(-turn) + turn) @ others
        moved = x + step - bent
        possible = np.maximum(moved, 0.0)
        return np.where(bent == 0.0, moved, possible)

    def _scales(self, x: Array) -> Array:
        """Return the direction in which each gain hardly changes the motion, (n, p).

        A known kv does not grow with the gain. Fv grows in its place, and acts at once. Numbers
        that are not varied, as those of a bad joint, replace nothing.
        """
        log_kp = self.at("kp")
        can_grow = self.varied[log_kp] & self.varied[self.at("Fv")]
        is_known = can_grow & ~self.over[KINDS.index("kv")]
        damping = is_known * self.unpack(x)[0]["kv"] / np.exp(x[log_kp])
        scales = np.eye(len(x))[log_kp]
        scales[:, self.at("Fv")] = np.diag(damping)
        in_rotor = damping * self.varied[self.at("Ia")]
        scales[:, self.at("Ia")] = -self.machine.servo.speed_age * np.diag(in_rotor)
        return scales

    # Positions and their errors.

    def roll(self, xs: Sequence[Array], step: float | None = None) -> list[list[Array]]:
        """Return positions along every window, for several vectors, all at one step [s]."""
        machines = [self._machine(x) for x in xs]
        # Logs at a low rate hold little information on motion within a small share of their step.
        step = max(STEP, FINE * self.dt) if step is None else step
        step = min(machine.longest(numbers, step) for machine, numbers, _ in machines)
        sources = [window.source for window in self.windows]
        return [
            machine.roll_all(self.logs, numbers, delays[self.source].tolist(), step, sources)
            for machine, numbers, delays in machines
        ]

    def _machine(self, x: Array) -> tuple[CommandedRobot, dict[str, Array], Array]:
        """Return the robot of a vector, its joints' numbers, and delays."""
        numbers, delays = self.unpack(x)
        machine = self.machine
        integrates = numbers["ki"] > 0
        pattern = tuple(integrates.tolist())
        has_play = bool(numbers["play"].any())
        if pattern in self.integrating and not has_play:
            machine = self.integrating[pattern]
        elif has_play or (integrates & ~(machine.servo.integral > 0)).any():
            loose = replace(machine.servo, play=numbers["play"], ki=numbers["ki"])
            machine = CommandedRobot(machine.robot, drop_follower_friction(machine.robot), loose)
            if not has_play:
                self.integrating[pattern] = machine
        logs_of_sizes = np.exp(2 * numbers["sizes"])
        sizes = dict(zip(self.shares, logs_of_sizes.tolist(), strict=True))
        key = (machine, *sizes.values())
        sized = remember(self.sized, key, lambda: machine.resized(sizes), 2)
        return sized, numbers, delays

    def torque(self, x: Array) -> Array:
        """Return the torque of the servos in all windows, (N, n)."""
        numbers, delays = self.unpack(x)
        servo = self.machine.servo.having(numbers)
        pairs = zip(self.logs, delays[self.source].tolist(), strict=True)
        return np.concatenate([servo_log(log, servo, late).tau for log, late in pairs])

    def rows(self) -> np.ndarray:
        """Return where the judged rows of each window begin and end, (windows + 1,) int."""
        counts = [len(log) - forgotten(log) for log in self.logs]
        return np.cumsum([0, *counts])

    def differences(self, q: list[Array]) -> Array:
        """Return errors of positions in the judged rows, (N, n).

        They are one where a rollout diverged, and zero where a joint is not judged. A servo without
        kp never corrects an error, so only what its joint gains within some time counts.
        """
        errors = []
        for rolled, window in zip(q, self.windows, strict=True):
            start = forgotten(window.rows)
            error = rolled - window.rows.q
            error[:start] = 0.0
            lasting = np.where(self.machine.servo.kp == 0, error[: len(error) - start], 0.0)
            gained = np.nan_to_num(error[start:] - lasting, nan=1.0)
            errors.append(gained * window.judged[start:])
        return np.concatenate(errors)

    def window_errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by window and joint, (windows, n)."""
        squares = self.differences(q) ** 2
        windows = np.split(squares, self.rows()[1:-1])
        return np.sqrt([part.mean(0) for part in windows])

    def errors(self, q: list[Array]) -> Array:
        """Return errors of positions (rms) by joint where its command moves, (n,)."""
        judged = [window.judged[forgotten(window.rows) :].sum(0) for window in self.windows]
        squares = np.sum(self.differences(q) ** 2, axis=0)
        return np.sqrt(squares / np.maximum(np.sum(judged, axis=0), 1))

    def missed(self, q: list[Array]) -> Array:
        """Return errors as shares of the explicable motion, (n,): medians over windows."""
        sizes = np.array([window.explicable for window in self.windows])
        return self.median(self.window_errors(q) / sizes)

    def median(self, values: Array) -> Array:
        """Return medians over the windows in which a joint's command moves, (n,); else zero."""
        columns = zip(values.T, self.moves.T, strict=True)
        return np.array([np.median(x[moves]) if moves.any() else 0.0 for x, moves in columns])

    def residual(self, q: list[Array], x: Array) -> Array:
        """Return errors of positions, flat, then deviations from prior knowledge, (r,)."""
        return np.append(self.differences(q), self.prior_residual(x))

    def weights(self, q: list[Array]) -> Array:
        """Return weights of the residual, (r,): the inverse error of an independent row.

        Windows with errors above the median are weighted by their own error, because the model has
        no contacts or lost commands.
        """
        errors = self.window_errors(q)
        usual = self.median(errors)
        times = autocorrelation_time(self.differences(q))
        scale = np.maximum(np.maximum(errors, usual), 1e-9) * np.sqrt(times)
        of_rows = np.repeat(1.0 / scale, np.diff(self.rows()), axis=0)
        of_prior = np.ones(len(self.prior_residual(0.0 * self.by)))
        return np.append(of_rows, of_prior)

    def independent_share(self, q: list[Array]) -> Array:
        """Return which share of the independent errors of a joint tell its gain, (n,).

        Errors beyond those of recording are errors of the model. They depend on the motion, and
        tell the same throughout a window. The share is one for a stated gain.
        """
        recorded = np.median(self.recorded, axis=0)
        least = or_one(np.maximum(self.errors(q), recorded))
        by_model = self.varied[self.at("kp")] * (1 - (recorded / least) ** 2)
        times = autocorrelation_time(self.differences(q))
        longer = np.maximum(WINDOW / self.dt / times - 1, 0.0)
        return 1 / (1 + by_model * longer)

    def prior_residual(self, x: Array) -> Array:
        """Return deviations of numbers from the file's and the stated ones, (b,) [σ]."""
        prior = self.machine.robot.prior
        numbers = self.unpack(x)[0]
        parameters = self.parameters(numbers) if self.shares else {}
        stated = [
            (parameters[name] - mean) / sd
            for name, (mean, sd) in prior.items()
            if name in parameters
        ]
        joints = (x * self.varied)[: self.over.size]
        gains = joints[-len(self.trees) :] / LOOSE
        sizes = 2.0 * numbers["sizes"] / [*self.shares.values()]
        return np.array([*sizes, *stated, *gains])

    # The derivative.

    def linearise(
        self, x: Array, numbers: np.ndarray | None = None, by: Array | None = None
    ) -> Array:
        """Return the derivative of the residual by differences, (r, p).

        Numbers of different trees are varied in the same rollout, as no tree moves another.

        Parameters
        ----------
        x : (p,)
        numbers : (k,) int, optional
            Those that are varied; by default `varied` and all delays. Columns of others are zero.
        by : (p,), optional
            Differences, by default the usual ones.
        """
        if by is None:
            by = self.by.copy()
            by[self.at("kp")] = self._gain_steps(x)
        if numbers is None:
            every = self.varied.copy()
            every[self.delays] = True
            numbers = np.flatnonzero(every)
        positions = self._position_derivative(x, numbers, by)
        prior = self._prior_derivative(x, by)
        return np.vstack([positions.reshape(-1, len(x)), prior])

    def _position_derivative(self, x: Array, numbers: np.ndarray, by: Array) -> Array:
        """Return the derivative of positions in the judged rows by differences, (N, n, p)."""
        is_delay = numbers >= self.bodies.stop
        groups = self._group_by_tree(numbers[~is_delay])
        log_kp = self.at("kp")
        along = np.eye(len(x))
        along[log_kp] = scales = self._scales(x)
        steps = by[:, None] * along
        moved = [self._rescale(x, steps[group].sum(0)) for group in groups]
        if is_delay.any():
            moved.append(x + steps[numbers[is_delay]].sum(0))
        rolled = self.roll([x, *moved], COARSE * STEP)
        base, *others = [self.differences(q) for q in rolled]
        J = np.zeros((*base.shape, len(x)))
        for group, other in zip(groups, others, strict=False):
            acts = self.trees[:, None] == self.tree_of[group]
            J[:, :, group] = (other - base)[:, :, None] * acts / by[group]
        # Columns of gains are those of their scales minus those of the other numbers.
        J[:, :, log_kp] = 2 * J[:, :, log_kp] - J @ scales.T
        if not is_delay.any():
            return J
        # Each log has its own delay.
        late = others[-1]
        ends = pairwise(self.rows().tolist())
        for log, (start, stop) in zip(self.source, ends, strict=True):
            k = self.bodies.stop + log
            J[start:stop, :, k] = (late - base)[start:stop] / by[k]
        return J

    def delay_each(self, x: Array) -> Array:
        """Return the change of the residual by commands of each joint alone one row later, (r, n).

        Divided by a row's time: a delay of that size is what matters, and noise less than it.
        """
        columns = []
        base = self.differences(self.roll([x], COARSE * STEP)[0])
        problem = copy(self)
        for joint in range(len(self.trees)):
            problem.windows = [window.delay(joint) for window in self.windows]
            late = problem.differences(problem.roll([x], COARSE * STEP)[0])
            columns.append((late - base).ravel() / self.dt)
        known = np.zeros((len(columns), len(self.prior_residual(x))))
        return np.hstack([columns, known]).T

    def scale_responses(self, x: Array) -> tuple[Array, Array]:
        """Return directions that hardly change the motion, (p, k), and the responses, (r, k).

        Along the first ones one joint grows, along the last one all trees with unknown gains. A
        response is the derivative of positions in the judged rows, flat. Large steps measure it, as
        joints that stick make small differences noisy.
        """
        joints, turns = self._grow_joints(x)
        grows = self.varied[self.at("kp")]
        trees = grows @ self._scales(x)
        of_bodies = self.tree_of[self.over.size :]
        trees[self.bodies] = 0.5 * np.isin(of_bodies, self.trees[grows])
        ways = np.vstack([joints, trees])
        steps = np.append(turns, self._gain_steps(x)[grows].max(initial=-LATER))
        turned = [self._rescale(x, step) for step in steps[:, None] * ways]
        before, *after = (self.differences(q).ravel() for q in self.roll([x, *turned]))
        return ways.T, (np.transpose(after) - before[:, None]) / steps

    def _grow_joints(self, x: Array) -> tuple[Array, Array]:
        """Return directions along which one joint grows, (k, p), and a step along each, (k,).

        It has more of all, with an unknown gain, and a rotor in place of heavier bodies.
        """
        log_kp = self.at("kp")
        rotors = self.at("Ia")
        bodies = self.machine.bare / np.exp(self.over[KINDS.index("Ia")] * x[log_kp])
        ways = self._scales(x)
        ways[:, rotors] += np.diag(bodies)
        widest = 0.3  # as in a search
        lost = x[rotors] < widest * bodies  # a rotor would be less than nothing
        turns = np.where(lost, 1.0, np.sign(self._gain_steps(x)))
        free = self.varied[log_kp] & self.varied[rotors]
        return ways[free], widest * turns[free]

    def _gain_steps(self, x: Array) -> Array:
        """Return the difference of the logarithm of each gain, (n,).

        It is large, because joints that stick make small differences noisy. A smaller gain reaches
        no limit. A larger gain is taken where so little friction is left that a known kv exceeds
        the damping of a smaller one.
        """
        fv = self.at("Fv")
        needed = np.expm1(LATER) * self._scales(x)[:, fv].diagonal()
        return np.where(x[fv] < needed, LATER, -LATER)

    def _rescale(self, x: Array, step: Array) -> Array:
        """Return the vector after a step to smaller gains, with which rare limits shrink.

        A limit that acts only for moments after commands must not determine a gain: those moments
        depend on the rate of the servo and the step of the rollout.
        """
        turn = (step * self.varied)[self.at("kp")]
        moved = self.move(x, step)
        if not (turn < 0).any():
            return moved
        servo = self.machine.servo.having(self.unpack(x)[0])
        torque = self.torque(x)
        # Rare is a smaller share of rows than that by which gains are varied.
        is_rare = np.mean(np.abs(torque) >= servo.high, axis=0) < LATER
        shrinks = (turn < 0) & is_rare & (servo.high < np.inf)
        limits = self.at("limit")[shrinks]
        smaller = servo.high * np.exp(turn)
        moved[limits] = smaller[shrinks]
        return moved

    def _group_by_tree(self, numbers: np.ndarray) -> list[np.ndarray]:
        """Return groups of numbers, each with at most one number of a tree."""
        trees = self.tree_of[numbers]
        before = [np.sum(trees[:k] == tree) for k, tree in enumerate(trees)]
        turn = np.array(before, int)
        last = int(turn.max(initial=-1))
        return [numbers[turn == k] for k in range(last + 1)]

    def _prior_derivative(self, x: Array, by: Array) -> Array:
        """Return the derivative of the prior's residual by differences, (b, p)."""
        here = self.prior_residual(x)
        changes = [self.prior_residual(x + step) - here for step in np.diag(by)]
        return np.array(changes).T / by


def list_steps(machine: CommandedRobot, logs: Sequence[Log]) -> list[Array]:
    """Return differences by which the numbers of each kind are varied, (n,) each."""
    servo = machine.servo
    moved = np.max([log.q.std(0) for log in logs], axis=0) + 1e-3
    inertia = machine.inertia(logs[0].q.mean(0))
    torque = np.minimum(np.maximum(0.3 * servo.kp, servo.kv) * moved, servo.high)
    damping = servo.kv + inertia / 0.1  # of a servo that takes a tenth of a second
    ones = np.ones(len(inertia))
    sizes = {
        "Ia": inertia,
        "Fv": damping,
        "Fc": torque,
        "off": torque,
        "slide": LATER * PLAY / VARIED * ones,
        "play": PLAY / VARIED * ones,
        "limit": torque,
        "ki": servo.gain,  # it acts within a second
        "kv": damping,
        "kp": ones,
    }
    return [VARIED * sizes[kind] for kind in KINDS]
