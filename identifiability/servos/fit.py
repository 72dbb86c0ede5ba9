"""`fit_rollouts`: joints, bodies, delays and gains with which rollouts follow logs most closely.

Bodies are the file's but for their sizes. Sizes are fitted together with the joints, within shares
of the file. Where gains are unknown, positions tell all numbers up to one factor. These shares tell
that factor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.robot import Robot
from identifiability.robot.servo import Servo

from .descent import BEGUN, conclude, descend
from .problem import RolloutProblem
from .rollouts import KINDS, Rollouts, are_contradicted
from .start import start_rollouts
from .torque import servo_log

#: Total length of the logs that are rolled out [s]: more says little more.
LONG: Tolerance = 45.0


def fit_rollouts(
    robot: Robot, logs: Sequence[Log], shares: Mapping[str, float], delay: float | None = None
) -> Rollouts:
    """Return the numbers of joints, bodies and servos with which rollouts follow logs.

    The search begins on the middle third of each log.

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
    logs = [_shortened(log, LONG / len(logs)) for log in logs]
    # Logs often begin and end at rest.
    thirds = [log.rows(len(log) // 3, 2 * len(log) // 3) for log in logs]
    machine, numbers = start_rollouts(robot, min(thirds, key=len))
    free = list_free(robot.servo, machine.servo, logs, delay or 0.0)
    problem = RolloutProblem(machine, logs, free, delay, shares)
    start = problem.pack(numbers, delay or 0.0)
    problem.logs = thirds
    problem.varied[problem.bodies] = False
    end = descend(problem, start, BEGUN)
    if not are_contradicted(problem.missed(end.q)):
        problem.logs = logs
        problem.varied[problem.bodies] = True
        end = descend(problem, end.x)
    return conclude(problem, end)


def _shortened(log: Log, seconds: float) -> Log:
    """Return the first seconds of a log."""
    rows = round(seconds / signals.sampling_step(log.t))
    return log.rows(0, min(len(log), rows))


def list_free(asked: Servo, start: Servo, logs: Sequence[Log], delay: float) -> np.ndarray:
    """Return at which joints each kind of number is varied, (kinds, n) bool.

    Gains that are stated are not. Play and limits are varied only where errors ask for them.

    Parameters
    ----------
    asked, start : Servo
        With unknown gains, and with those of the start.
    logs : sequence of Log
    delay : float [s]
    """
    free = dict.fromkeys(KINDS, np.ones(len(asked.kp), bool))
    free["play"] = free["limit"] = np.zeros(len(asked.kp), bool)
    free["kp"] = np.isnan(asked.kp)
    # Commanded speeds, or a limit, tell kv from friction: only a servo's torque is limited.
    has_speeds = all(log.dq_ref is not None for log in logs)
    known = start.having({"kp": asked.kp})
    torque = np.concatenate([servo_log(log, known, delay).tau for log in logs])
    within = np.all((torque > known.low) & (torque < known.high), axis=0)
    is_limited = (known.high < np.inf) & ~within
    free["kv"] = np.isnan(asked.kv) & (has_speeds | is_limited)
    return np.array([free[kind] for kind in KINDS])
