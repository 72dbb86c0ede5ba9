"""Torque of commands minus the error of recording.

The encoder's steps, the rate of the log and the low-pass affect the servos' torque and the columns.
They bias least squares by some ten percent. A rollout of the fitted robot is sampled and rounded as
the log. The model explains its torque exactly, so its residual is due to recording alone. This
residual is subtracted. The rollout itself is the second record of the motion, whose errors are not
those of the log (calibrated instrumental variables).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.log import bridge_gaps
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.structure import Structure
from identifiability.simulation.rollout import CommandedRobot

from .descent import descend
from .positions import forgotten, record
from .problem import RolloutProblem
from .rollouts import KINDS
from .torque import servo_log
from .windows import Window

#: Recordings of a rollout that differ in where the encoders' steps lie.
PHASES = 4


def roll_delayed(
    machine: CommandedRobot, log: Log, delay: float | None = None
) -> tuple[float, Array]:
    """Return the delay [s] with which a rollout follows a log most closely, and its positions.

    Parameters
    ----------
    machine : CommandedRobot
    log : Log
        With commands, in the robot's order of joints.
    delay : float [s], optional
        Where it is known.

    Returns
    -------
    float [s], (N, n) [rad or m]
    """
    if delay is None:
        nothing_varies = np.zeros((len(KINDS), len(machine.trees)), bool)
        window = Window(0, log, np.ones(len(machine.trees), bool))
        problem = RolloutProblem(machine, [window], nothing_varies)
        start = problem.pack(machine.numbers(), 0.0)
        delay = float(descend(problem, start).x[-1])
    return delay, machine.roll(log, delay=delay)


def calibrate_torque(
    structure: Structure,
    log: Log,
    delay: float | None,
    values: Mapping[str, float],
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
    for _ in range(PHASES):
        again = replace(given, q=record(q, log, rng), unmeasured=None)
        recorded = servo_log(again, machine.servo, delay)
        one = prepare_recording(structure, recorded, values, how)
        moves[one.rows] &= one.moves
        # Dry friction of a recording that turns a row earlier than the log is not that of the log.
        like = one.moves & (one.direction == own.direction)
        left[one.rows] += np.where(like, one.residual, 0.0)
        count[one.rows] += like
    lost = ~moves | (count == 0) | log.is_unmeasured
    lost[: forgotten(log)] = True
    if given.unmeasured is not None:
        lost |= given.unmeasured
    calibrated = given.tau - left / np.maximum(count, 1)
    tau = bridge_gaps(log.t, calibrated, lost)
    return replace(given, tau=tau, unmeasured=lost if lost.any() else None, rollout=q)


class Recording(NamedTuple):
    """A recorded motion as it is prepared.

    Attributes
    ----------
    rows : (N,) int
        In its log.
    residual : (N, n) [N·m or N]
        Torque that the model does not explain.
    moves : (N, n) bool
        Where it is data.
    direction : (N, n) int
        Sign of the dry friction.
    """

    rows: np.ndarray
    residual: Array
    moves: np.ndarray
    direction: np.ndarray


def prepare_recording(
    structure: Structure, log: Log, values: Mapping[str, float], how: Preparation
) -> Recording:
    """Return a recorded motion with its residual torque."""
    robot = structure.robot
    known = {**robot.nominal, **values}
    phi = np.array([known.get(name, 0.0) for name in structure.columns])
    samples = prepare_log(robot, log, how)
    W = structure.model.regressor(robot, samples.motion)
    moves = samples.weight > 0
    residual = np.where(moves, samples.tau - W @ phi, 0.0)
    direction = np.zeros(moves.shape, int)
    columns = [*structure.columns]
    for j, joint in enumerate(robot.joints):
        if f"{joint}.Fc" in columns:
            direction[:, j] = np.rint(W[:, j, columns.index(f"{joint}.Fc")])
    return Recording(samples.motion.kept, residual, moves, direction)
