"""Unknown gains of servos: they are found from logs of commands.

Commands and positions determine ratios only: if gains, rotors, friction and bodies are all twice as
large, the motion is the same. The scale comes from other knowledge: bodies within a share of the
robot file's, or single bodies that its sidecar states (``[prior_share]``, ``[prior]``).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.rounding import REACH, percent
from identifiability.foundation.runs import First, Progress
from identifiability.logs import Log
from identifiability.logs.commands import has_commands
from identifiability.logs.contradictions import check_units
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.robot import Robot
from identifiability.robot.servo import FOUND, Servo, state_gain

from .contacts import fit_unblocked
from .rollouts import Rollouts
from .torque import set_aside_joints


def file_shares(robot: Robot) -> dict[str, float]:
    """Return the share within which each body is the robot file's, for bodies with mass there."""
    heavy = [b for b in robot.bodies if robot.nominal.get(f"{b}.m", 0.0) > 0]
    return {b: robot.said.prior_share.get(b, PHYSICAL_RULES.body_within) for b in heavy}


def select_commanded(robot: Robot, logs: Iterable[Log]) -> list[Log]:
    """Return logs in the robot's order of joints, without joints that do not follow commands.

    Raises
    ------
    LogError
        If the motion contradicts the commands.
    """
    selected = [log.select(robot.joints) for log in logs]
    for log in selected:
        check_units(robot, [log])
    return [set_aside_joints(log, robot.servo) if robot.servo else log for log in selected]


def learn_gains(robot: Robot, logs: Sequence[Log], say: Progress, first: First | None) -> Robot:
    """Return a robot whose servos have gains; logs of commands determine the unknown ones.

    Raises
    ------
    RobotError
        If it cannot be rolled out.
    """
    commanded = [log for log in logs if has_commands(log)]
    if robot.servo is None or not (commanded and robot.servo.unknown.any()):
        return robot
    shares = file_shares(robot)
    if not shares:
        raise RobotError(Finding("gains.massless", robot.path))
    found = fit_unblocked(robot, commanded, shares, say, first)
    text = state_gains(robot, [x.name for x in commanded], found, shares)
    servo = replace(with_numbers(robot.servo, found), found=text, rolled=found)
    return replace(robot, servo=servo)


def with_numbers(servo: Servo, found: Rollouts) -> Servo:
    """Return servos with the gains and limits that rollouts found, and their uncertainty."""
    values, axes = np.linalg.eigh(found.covariance)
    doubt = (np.sqrt(np.maximum(values, 0.0)) * axes).T
    # A smaller uncertainty counts as zero.
    doubt = doubt[np.linalg.norm(doubt, axis=1) > 1e-4]
    doubt[:, np.diag(found.covariance) == 0] = 0.0  # of stated gains; axes are known to rounding
    return replace(servo.having(found.numbers), source=FOUND, doubt=doubt)


def state_gains(robot: Robot, names: Sequence[str], found: Rollouts, shares: NumberByName) -> str:
    """Return sentences on the gains that were found, and on the source of their scale.

    Parameters
    ----------
    robot : Robot
        With unknown gains.
    names : sequence of str
        Of the logs.
    found : Rollouts
    shares : mapping of str to float
        As of `file_shares`.
    """
    assert robot.servo is not None
    asked = robot.servo
    servo = asked.having(found.numbers)
    ki_sd, kv_sd, log_kp_sd = np.split(np.sqrt(np.diag(found.covariance)), 3)
    problem = found.search[0]
    moves = problem.moves.any(0)
    # Where zero is within the error of a gain, logs determine only ratios to it.
    is_told = REACH * log_kp_sd < 1
    new_kp = np.isnan(asked.kp) & moves
    new_kv = np.isnan(asked.kv) & (servo.kv > 0) & moves
    new_ki = np.isnan(asked.integral) & moves
    of_kp = _list_gains("kp", robot, servo.kp, log_kp_sd * servo.kp, new_kp)
    of_kv = _list_gains("kv", robot, servo.kv, kv_sd, new_kv)
    of_ki = _list_gains("ki", robot, servo.integral, ki_sd, new_ki)
    surest = min(shares, key=lambda body: shares[body])
    within = percent(shares[surest])
    listed = "; ".join(filter(None, [of_kp, of_kv, of_ki]))
    text = [phrase("gains.found", "says", names=list(names), gains=listed or "none by itself")]
    if np.isnan(asked.gain).all():
        text.append(phrase("gains.found", "bodies", body=surest, within=within))
    ratios = np.flatnonzero(np.isnan(asked.gain) & moves & ~is_told)
    if len(ratios):
        text.append(phrase("gains.found", "ratios", joints=[robot.joints[k] for k in ratios]))
    guessed = np.flatnonzero(np.isnan(asked.gain) & ~moves)
    if len(guessed):
        text.append(phrase("gains.found", "guessed", joints=[robot.joints[k] for k in guessed]))
    mute = np.flatnonzero(np.isnan(asked.kv) & ~(servo.kv > 0) & moves)
    if len(mute):
        text.append(phrase("gains.found", "damping", joints=[robot.joints[k] for k in mute]))
    return " ".join(text)


def _list_gains(kind: str, robot: Robot, values: Array, sd: Array, new: np.ndarray) -> str:
    """Return the new gains of a kind with their errors (95 %); nothing if there are none."""
    joints = np.flatnonzero(new)
    each = [f"{robot.joints[k]} {state_gain(values[k], sd[k])}" for k in joints]
    return f"{kind} of {listing(each)}" if each else ""
