"""Commands that arrive irregularly: later than most others, or never.

A servo without the new command still follows the command before it. The difference of the two
torques is regressed on the residual torque in each interval of a command: the slope is 0 for a
command that acts as usual, and 1 for a lost one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.robot import Robot
from identifiability.robot.servo import Servo

from .calibration import Recording, leave_out
from .torque import servo_log

#: Standard errors beyond which a command surely acts otherwise: each of thousands is asked.
CLEAR: Tolerance = 6.0

#: Slopes of commands that come late or never; a contact changes torque by less or more.
SLOPES: tuple[Tolerance, Tolerance] = (0.25, 1.5)

#: Least share of irregular commands whose rows are left out.
LEAST_SHARE: Tolerance = 0.01


def leave_out_irregular(
    robot: Robot, log: Log, servo: Servo, recording: Recording, how: Preparation
) -> tuple[Log, float]:
    """Return a log without rows of irregular commands, and the share of such commands.

    A log with less than one such command in a hundred stays as it is, with a share of zero.

    Parameters
    ----------
    robot : Robot
    log : Log
        With calibrated torque of commands.
    servo : Servo
    recording : Recording
        The log as it is prepared.
    how : Preparation
        Of the recording.
    """
    if log.q_ref is None or log.servo_delay is None:
        return log, 0.0
    differs = np.diff(log.q_ref, axis=0) != 0
    changes = np.flatnonzero(np.any(differs, axis=1)) + 1
    if len(changes) < 2:
        return log, 0.0
    starts = np.append(0, changes)
    command = np.searchsorted(starts, np.arange(len(log)), side="right") - 1
    before = log.q_ref[starts[np.maximum(command - 1, 0)]]
    delay = log.servo_delay
    late = servo_log(replace(log, q_ref=before), servo, delay)
    difference = late.tau - servo_log(log, servo, delay).tau
    prepared = prepare_log(robot, replace(log, tau=difference, unmeasured=None), how)
    rows = recording.rows
    column = prepared.tau * recording.moves / _noise(recording)
    residual = recording.residual / _noise(recording)
    acting = np.searchsorted(log.commands_since[starts], log.t[rows] - delay, side="right") - 1
    acting = np.maximum(acting, 0)
    size = np.bincount(acting, np.sum(column**2, axis=1), len(starts))
    product = np.bincount(acting, np.sum(column * residual, axis=1), len(starts))
    slope = product / np.maximum(size, 1e-12)
    clear = np.abs(product) > CLEAR * np.sqrt(size)
    lowest, highest = SLOPES
    is_irregular = clear & (np.abs(slope) > lowest) & (np.abs(slope) < highest)
    share = float(is_irregular.sum() / max(np.sum(size > 0), 1))
    if share < LEAST_SHARE:
        return log, 0.0
    lost = np.zeros(log.q.shape, bool)
    lost[rows[is_irregular[acting]]] = True
    if log.unmeasured is not None:
        lost |= log.unmeasured
    return leave_out(log, lost, recording), share


def _noise(recording: Recording) -> Array:
    """Return the usual size of the residual of each joint, (n,)."""
    sizes = np.where(recording.moves, np.abs(recording.residual), np.nan)
    moving = recording.moves.any(0)
    noise = np.full(recording.moves.shape[1], 1e-12)
    noise[moving] += 1.5 * np.nanmedian(sizes[:, moving], axis=0)
    return noise
