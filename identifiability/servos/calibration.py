"""Torque of commands minus the error of recording.

The encoder's steps, the rate of the log and the low-pass affect the servos' torque and the columns.
They bias least squares by some ten percent. A rollout of the fitted robot is sampled and rounded as
the log. The model explains its torque exactly, so its residual is due to recording alone. This
residual is subtracted. The rollout itself is the second record of the motion, whose errors are not
those of the log (calibrated instrumental variables).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from identifiability.foundation.linalg import or_one, solve_least
from identifiability.foundation.names import Array, NumberByName
from identifiability.logs import Log, signals
from identifiability.logs.commands import longest_delay
from identifiability.logs.log import bridge_gaps
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.information import gather_information
from identifiability.regression.structure import Structure
from identifiability.simulation.rollout import CommandedRobot, forgotten

from .descent import BLOCK, descend
from .positions import are_aside, record
from .problem import RolloutProblem
from .rollouts import KINDS
from .torque import may_saturate, servo_log
from .windows import Window, cut_windows

#: Recordings of a rollout that differ in where the encoders' steps lie.
PHASES = 4

#: Squared residuals by stretch of time and joint, (B, n), and rows, (n,), of a delay [s].
DelaySquares = Callable[[float], tuple[Array, Array]]


def roll_delayed(
    machine: CommandedRobot, log: Log, delay: float | None = None
) -> tuple[float, Array]:
    """Return the delay [s] with which a rollout follows a log most closely, and its positions.

    Parameters
    ----------
    machine : CommandedRobot
    log : Log
        With commands, in the robot's order of joints. An unknown delay is searched near its own.
    delay : float [s], optional
        Where it is known. Windows of a long log determine one that is not.

    Returns
    -------
    float [s], (N, n) [rad or m]
    """
    nothing_varies = np.zeros((len(KINDS), len(machine.trees)), bool)
    every = np.ones(len(machine.trees), bool)
    windows = [replace(window, moves=every) for window in cut_windows([log])]
    problem = RolloutProblem(machine, windows, nothing_varies, delay)
    begin = log.servo_delay if delay is None else delay
    x = problem.pack(machine.numbers(), begin or 0.0)
    if delay is None:
        x = descend(problem, x).x
        delay = float(x[-1])
    problem.windows = [Window(0, log, every, log)]
    (q,) = problem.roll([x])[0]
    return delay, q


def calibrate_torque(
    structure: Structure,
    log: Log,
    delay: float | None,
    values: NumberByName,
    how: Preparation,
    rng: np.random.Generator,
) -> Log:
    """Return a log of commands minus the torque error that recording a rollout of it shows.

    Parameters
    ----------
    structure : Structure
    log : Log
        As `compute_torque` returned it, in the robot's order of joints.
    delay : float or None [s]
        Where it is known; else it is found.
    values : mapping of str to float
        Standard parameters by name of the robot that is rolled out.
    how : Preparation
        With the cut-off of all logs.
    rng : Generator
    """
    machine = CommandedRobot(structure.robot, values)
    delay, q = roll_delayed(machine, log, delay)
    given = servo_log(replace(log, unmeasured=None), machine.servo, delay)
    if not np.isfinite(q).all():  # the rollout diverged
        return given
    own = prepare_recording(structure, replace(given, unmeasured=None), values, how)
    left = np.zeros(q.shape)
    count = np.zeros(q.shape)
    moves = np.full(q.shape, False)
    moves[own.rows] = True
    turns = np.full(q.shape, True)
    turns[own.rows] = own.turns
    for _ in range(PHASES):
        again = replace(given, q=record(q, log, rng), unmeasured=None)
        recorded = servo_log(again, machine.servo, delay)
        one = prepare_recording(structure, recorded, values, how)
        moves[one.rows] &= one.moves
        # Dry friction of a recording that turns a row earlier than the log is not that of the log.
        like = one.moves & (one.direction == own.direction)
        left[one.rows] += np.where(like, one.residual, 0.0)
        count[one.rows] += like
    unlike = count == 0
    lost = ~moves | (unlike & turns) | log.is_unmeasured | are_aside(log)
    lost[: forgotten(log)] = True
    if log.q_ref is not None:  # friction holds a joint whose command stands
        lost[:, np.ptp(log.q_ref, axis=0) == 0] = True
    if given.unmeasured is not None:
        lost |= given.unmeasured
    # Away from reversals the friction of the log is known, and the error changes slowly.
    error = bridge_gaps(log.t, left / np.maximum(count, 1), unlike)
    calibrated = replace(given, tau=given.tau - error, rollout=q)
    # Only calibrated torque has the mean of an integral.
    lost |= may_saturate(calibrated, machine.servo, delay) & (machine.servo.integral > 0)
    return leave_out(calibrated, lost, own)


def leave_out(log: Log, lost: np.ndarray, recording: Recording) -> Log:
    """Return a log without torque in some rows, (N, n) bool.

    Short gaps are used as data. Dry friction may jump in them, so the torque is that of the model
    and the residual is interpolated.
    """
    modelled = np.zeros(lost.shape)
    modelled[recording.rows] = recording.modelled
    residual = bridge_gaps(log.t, log.tau - modelled, lost)
    unmeasured = lost if lost.any() else None
    return replace(log, tau=modelled + residual, unmeasured=unmeasured)


class Recording(NamedTuple):
    """A recorded motion as it is prepared.

    Attributes
    ----------
    rows : (N,) int
        In its log.
    modelled : (N, n) [N·m or N]
        Torque of the model.
    residual : (N, n) [N·m or N]
        Torque that the model does not explain.
    moves : (N, n) bool
        Where it is data.
    direction : (N, n) int
        Sign of the dry friction.
    columns : (N, n, k)
        Of the model.
    """

    rows: np.ndarray
    modelled: Array
    residual: Array
    moves: np.ndarray
    direction: np.ndarray
    columns: Array

    @property
    def turns(self) -> np.ndarray:
        """Return rows next to a change of the sign of dry friction, (N, n) bool."""
        changes = np.diff(self.direction, axis=0, prepend=self.direction[:1]) != 0
        return changes | np.roll(changes, -1, axis=0)


def prepare_recording(
    structure: Structure, log: Log, values: NumberByName, how: Preparation
) -> Recording:
    """Return a recorded motion with its residual torque."""
    robot = structure.robot
    known = {**robot.nominal, **values}
    phi = np.array([known.get(name, 0.0) for name in structure.columns])
    samples = prepare_log(robot, log, how)
    W = structure.model.regressor(robot, samples.motion)
    moves = samples.weight > 0
    residual = samples.tau - W @ phi
    modelled = log.tau[samples.motion.kept] - residual
    direction = np.zeros(moves.shape, int)
    columns = [*structure.columns]
    for j, joint in enumerate(robot.joints):
        if f"{joint}.Fc" in columns:
            direction[:, j] = np.rint(W[:, j, columns.index(f"{joint}.Fc")])
    residual = np.where(moves, residual, 0.0)
    return Recording(samples.motion.kept, modelled, residual, moves, direction, W)


def fit_delay(structure: Structure, logs: Sequence[Log]) -> tuple[float, float]:
    """Return the delay [s] with which the model explains the torque of commands best, and its sd.

    Errors of rows depend on each other, and those of stretches of time hardly do [Künsch 1989].

    Parameters
    ----------
    structure : Structure
        Of a robot with servos.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    """
    dt = max(signals.sampling_step(log.t) for log in logs)
    squares = _delay_squares(structure, logs, Preparation(cutoff=0.1 / dt))

    def misfit(delay: float) -> float:
        return _delay_misfit(*squares(delay))

    first, *later = dt * np.arange(-1, min(map(longest_delay, logs)) + 1)
    start = min([first, *later], key=misfit)
    bounds = max(start - dt, first), start + dt
    best = scipy.optimize.minimize_scalar(misfit, bounds=bounds, method="bounded").x
    best = float(min(first, best, key=misfit))
    return best, min(_delay_error(squares, best, 0.1 * dt), float(later[-1]))


def _delay_misfit(each: Array, rows: Array) -> float:
    """Return the negative log likelihood of squares (B, n) of residuals, with joint noise."""
    return float(0.5 * rows @ np.log(or_one(each.sum(0))))


def _delay_error(squares: DelaySquares, best: float, near: float) -> float:
    """Return the standard error of the best delay [s] by differences of some size [s]."""
    before, _ = squares(best - near)
    here, rows = squares(best)
    after, _ = squares(best + near)
    bends = _delay_misfit(before, rows) - 2 * _delay_misfit(here, rows) + _delay_misfit(after, rows)
    curvature = max(bends, 1e-12)
    scores = (after - before) @ (0.25 * rows / or_one(here.sum(0)))
    scatter = max(float(scores @ scores), curvature)
    return float(near * np.sqrt(scatter) / curvature)


def _delay_squares(structure: Structure, logs: Sequence[Log], how: Preparation) -> DelaySquares:
    """Return a function of a delay [s]: squared residuals by stretch and joint, (B, n), and rows.

    Steps of held commands between rows bias it where torque is kept up to a high frequency.
    """
    servo = structure.robot.servo
    assert servo is not None
    samples = [prepare_log(structure.robot, log, how) for log in logs]
    regression = structure.regression(samples)
    seconds = sum(float(log.t[-1] - log.t[0]) for log in logs)

    def squares(delay: float) -> tuple[Array, Array]:
        changes = [servo_log(log, servo, delay).tau - log.tau for log in logs]
        pairs = zip(samples, changes, strict=True)
        later = [replace(s, tau=s.tau + change[s.motion.kept]) for s, change in pairs]
        rows = gather_information(regression.with_torque(later), math.ceil(seconds / BLOCK))
        R = rows.factor(1.0 / or_one(rows.variation))
        values = solve_least(R[:, :-1], R[:, -1])
        return rows.squares_of_blocks(np.append(values, -1.0)), rows.rows_each

    return squares
