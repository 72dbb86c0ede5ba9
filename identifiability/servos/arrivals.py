"""Commands that arrive irregularly: later than most others, or never.

A servo without the new command still follows the command before it. The difference of the two
torques is regressed on the residual torque in each interval of a command: the slope is 0 for a
command that acts as usual, and 1 for a lost one. If joints agree on other times of commands, the
time at which each command arrived is found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.servo import Servo

from .calibration import Recording, calibrate_torque, leave_out, prepare_recording
from .descent import VALLEY
from .torque import servo_log

#: Standard errors beyond which a command surely acts otherwise: each of thousands is asked.
CLEAR: Tolerance = 6.0

#: Slopes of commands that come late or never; a contact changes torque by less or more.
SLOPES: tuple[Tolerance, Tolerance] = (0.25, 1.5)

#: Least share of irregular commands whose rows are left out.
LEAST_SHARE: Tolerance = 0.01


def move_commands(
    structure: Structure,
    log: Log,
    delay: float | None,
    values: NumberByName,
    how: Preparation,
    rng: np.random.Generator,
) -> tuple[Log, float, Log | None]:
    """Return a log whose irregular commands act when they arrived, and the share of such commands.

    A log stays as it is, with a share of zero, unless its joints agree on the times. Its calibrated
    version then follows, where one was made.

    Parameters
    ----------
    structure, log, delay, values, how, rng
        As of `calibrate_torque`.
    """
    servo = structure.robot.servo
    assert servo is not None
    starts = _list_commands(log)
    if len(starts) < 3:
        return log, 0.0, None
    # The noise of the first round holds the errors of irregular commands.
    for _ in range(2 if log.arrivals is None else 1):
        calibrated = calibrate_torque(structure, log, delay, values, how, rng)
        recording = prepare_recording(structure, calibrated, values, how)
        delay = calibrated.servo_delay
        if log.arrivals is None and not _agree_on_arrivals(calibrated, servo, recording, how):
            return log, 0.0, calibrated
        log = replace(log, arrivals=find_arrivals(calibrated, servo, recording, how))
    regular = replace(log, arrivals=None).commands_since[starts]
    apart = np.abs(log.commands_since[starts] - regular)
    period = np.median(np.diff(regular))
    is_irregular = apart > SLOPES[0] * period
    return log, float(is_irregular.mean()), None


def _agree_on_arrivals(log: Log, servo: Servo, recording: Recording, how: Preparation) -> bool:
    """Return whether arrivals that some joints tell explain the torque of the other joints.

    Errors of the model of one joint explain nothing of the others. Parameters are those of
    `find_arrivals`.
    """
    starts = _list_commands(log)
    jumps = _list_jumps(log, servo, starts)
    pulses = _list_pulses(log, log.commands_since[starts], recording.rows, how)
    joints = np.flatnonzero(recording.moves.any(0) & jumps.any(0))
    if len(joints) < 2:
        return False
    noise = usual_residual(recording)
    before = 0.0
    after = 0.0
    for turn in range(2):
        judged = np.isin(np.arange(len(noise)), joints[turn::2])
        others = recording._replace(moves=recording.moves & ~judged)
        later = _find_lateness(log, servo, others, how)
        explained = pulses @ (later[:, None] * jumps)
        scale = (recording.moves & judged) / noise
        residual = scale * recording.residual
        unexplained = residual - scale * explained
        before += np.sum(residual**2)
        after += np.sum(unexplained**2)
    return bool(after < VALLEY * before)


def find_arrivals(log: Log, servo: Servo, recording: Recording, how: Preparation) -> Array:
    """Return the time since which the commands of each row are held, (N,) [s].

    All joints receive a command at the same time. A later command changes their torque by a pulse
    of the size of its jump, which least squares fits to the residual torque together with the
    model. The mean of all times belongs to the delay of the log, and stays. A command ends where a
    later one arrives.

    Parameters
    ----------
    log : Log
        With calibrated torque of commands.
    servo : Servo
    recording : Recording
        The log as it is prepared.
    how : Preparation
        Of the recording.
    """
    starts = _list_commands(log)
    since = log.commands_since[starts]
    arrivals = since + _find_lateness(log, servo, recording, how)
    arrivals[0] = since[0]
    ordered = np.minimum.accumulate(arrivals[::-1])[::-1]
    number = np.searchsorted(starts, np.arange(len(log)), side="right") - 1
    return ordered[number]


def _find_lateness(log: Log, servo: Servo, recording: Recording, how: Preparation) -> Array:
    """Return by how much each command arrives later than now, (c,) [s], with a mean of zero.

    Parameters are those of `find_arrivals`.
    """
    starts = _list_commands(log)
    count = len(starts)
    regular = replace(log, arrivals=None).commands_since[starts]
    early = regular - log.commands_since[starts]
    precision, product = _regress_arrivals(log, servo, recording, how)
    weights = precision.diagonal()[:count]
    # The scatter is not normal: a few commands are lost, or all are late. A command that was found
    # apart stays apart, and others scatter as most of them.
    period = np.median(np.diff(regular))
    usual = np.median(np.abs(early)) or period
    variance = usual**2 + early**2
    known = 1.0 / variance
    product[:count] += known * early
    least = np.full(len(product), ROUNDOFF)
    least[:count] = known
    precision = precision + scipy.sparse.diags_array(least)
    later: Array = scipy.sparse.linalg.spsolve(precision.tocsc(), product)[:count]
    # Torque is linear in the time of a command up to about the next one.
    later = np.clip(later - np.average(later, weights=weights), -period, period)
    return later - np.average(later, weights=weights)


def _regress_arrivals(
    log: Log, servo: Servo, recording: Recording, how: Preparation
) -> tuple[scipy.sparse.csr_array, Array]:
    """Return the normal equations of the residual torque: (c + k, c + k) and (c + k,).

    Unknown are by how much each command is later [s], and the values of the model in units of the
    size of their columns. Parameters are those of `find_arrivals`.
    """
    starts = _list_commands(log)
    jumps = _list_jumps(log, servo, starts)
    pulses = _list_pulses(log, log.commands_since[starts], recording.rows, how)
    size = np.linalg.norm(recording.columns, axis=(0, 1))
    of_model = recording.columns[:, :, size > 0] / size[size > 0]
    width = len(starts) + of_model.shape[2]
    precision = scipy.sparse.csr_array((width, width))
    product = np.zeros(width)
    for joint, scale in enumerate(usual_residual(recording).tolist()):
        weight = scipy.sparse.diags_array(recording.moves[:, joint] / scale)
        of_commands = pulses @ scipy.sparse.diags_array(jumps[:, joint])
        both = scipy.sparse.hstack([of_commands, of_model[:, joint]])
        columns = weight @ both
        precision = precision + columns.T @ columns
        product += columns.T @ (recording.residual[:, joint] / scale)
    return precision, product


def _list_commands(log: Log) -> np.ndarray:
    """Return the rows at which new commands of positions begin, (c,) int; the first row is one."""
    if log.q_ref is None:
        return np.zeros(1, int)
    differs = np.diff(log.q_ref, axis=0) != 0
    changes = np.flatnonzero(np.any(differs, axis=1)) + 1
    return np.append(0, changes)


def _list_jumps(log: Log, servo: Servo, starts: np.ndarray) -> Array:
    """Return by how much each command changes the torque of a servo, (c, n)."""
    gains = {"q_ref": servo.kp, "dq_ref": servo.kv, "tau_ff": 1.0}
    torque = sum(gains[k] * getattr(log, k) for k in log.channels if k in gains)
    return np.diff(torque[starts], axis=0, prepend=torque[:1])


def _list_pulses(
    log: Log, since: Array, rows: np.ndarray, how: Preparation
) -> scipy.sparse.csr_array:
    """Return the change of prepared torque by later unit jumps, per time, (r, c) [1/s]."""
    assert log.servo_delay is not None
    step = signals.sampling_step(log.t)
    count = len(log)
    pulse = np.zeros(count)
    middle = count // 2
    pulse[middle] = 1.0 / step
    reach = 0
    if how.cutoff is not None:
        pulse = signals.lowpass(pulse, step, how.cutoff)
        reach = min(int(3 / (how.cutoff * step)), middle - 1)
    around = np.arange(-reach, reach + 1)
    elapsed = since + log.servo_delay - log.t[0]
    at = np.rint(elapsed / step).astype(int)
    places = at[:, None] + around
    inside = (places >= 0) & (places < count)
    which, column = np.nonzero(inside)
    entries = pulse[middle + around][column], (places[inside], which)
    return scipy.sparse.csr_array(entries, shape=(count, len(since)))[rows]


def leave_out_irregular(
    robot: Robot, log: Log, servo: Servo, recording: Recording, how: Preparation
) -> tuple[Log, float]:
    """Return a log without rows of irregular commands, and the share of such commands.

    A log with less than one such command in a hundred stays as it is, with a share of zero.
    Parameters are those of `find_arrivals`, after the robot.
    """
    starts = _list_commands(log)
    if len(starts) < 3 or log.q_ref is None or log.servo_delay is None:
        return log, 0.0
    command = np.searchsorted(starts, np.arange(len(log)), side="right") - 1
    before = log.q_ref[starts[np.maximum(command - 1, 0)]]
    delay = log.servo_delay
    late = servo_log(replace(log, q_ref=before), servo, delay)
    difference = late.tau - servo_log(log, servo, delay).tau
    prepared = prepare_log(robot, replace(log, tau=difference, unmeasured=None), how)
    rows = recording.rows
    column = prepared.tau * recording.moves / usual_residual(recording)
    residual = recording.residual / usual_residual(recording)
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


def usual_residual(recording: Recording) -> Array:
    """Return the usual size of the residual of each joint, (n,)."""
    sizes = np.where(recording.moves, np.abs(recording.residual), np.nan)
    moving = recording.moves.any(0)
    noise = np.full(recording.moves.shape[1], 1e-12)
    noise[moving] += 1.5 * np.nanmedian(sizes[:, moving], axis=0)
    return noise
