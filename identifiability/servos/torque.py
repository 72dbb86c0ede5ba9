"""Torque that servos make of commands, and joints that do not follow their commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.foundation.quoting import option_for_shell
from identifiability.logs import Log, signals
from identifiability.logs.commands import (
    acting,
    are_positions_alone,
    find_exchanged,
    held_mean,
    integral_torque,
    longest_delay,
    state_exchanged,
)
from identifiability.logs.rules import RULES
from identifiability.robot.servo import Servo


def compute_torque(logs: Sequence[Log], servo: Servo | None) -> list[Log]:
    """Return logs with the servos' torque, where they hold commands and no measured torque.

    Delays are the stated ones. An unknown delay is zero as yet.

    Raises
    ------
    LogError
        If most joints do not follow their commands.
    """
    return [_with_torque(log, servo) for log in logs]


def _with_torque(log: Log, servo: Servo | None) -> Log:
    """Return a log with the servos' torque, if it needs that."""
    if servo is None or not (log.commanded and log.motion_alone):
        return log
    # A recorded rollout has no speeds of another sensor.
    positions = set_aside_joints(log, servo).without(("dq", "ddq"))
    return servo_log(positions, servo, servo.delay or 0.0)


def servo_log(log: Log, servo: Servo, delay: float) -> Log:
    """Return a log of commands with the torque that the servos made of them.

    Saturated torque is no data, because an error of the encoder changes which rows are saturated.
    Torque of lost rows is no data either.

    Parameters
    ----------
    log : Log
        In the robot's order of joints.
    servo : Servo
    delay : float [s]
        From the time of a row until its command acts.
    """
    if servo.integral.any() and not are_positions_alone(log):
        raise LogError(Finding("servos.integral", log.name))
    dt = signals.sampling_step(log.t)
    dq = signals.differentiate(log.q, dt) if log.dq is None else log.dq
    target = acting(log, servo, log.t, dt, delay)
    integral = integral_torque(log, servo, dt, delay)
    unlimited = servo.gain * target - servo.kp * log.q - servo.damping * dq + integral
    tau = np.clip(unlimited, servo.low, servo.high)
    # Commands between rows that are far apart are not in the log.
    gaps = np.append(signals.has_gap(log.t), False)
    unknown = held_mean(log.commands_since, gaps[:, None], log.t - delay, dt) > 0
    lost = (tau != unlimited) | unknown
    if log.unmeasured is not None:
        lost = lost | log.unmeasured
    unmeasured = lost if lost.any() else None
    return replace(
        log,
        tau=tau,
        unmeasured=unmeasured,
        motion_alone=False,
        servo_delay=float(delay),
    )


def may_saturate(log: Log, servo: Servo, delay: float) -> np.ndarray:
    """Return rows of a log in which a servo may reach a limit for a moment, (N, n) bool.

    Held commands jump, so the torque passes a limit in a row whose mean is below it. Parts of each
    row are looked at, up to its neighbours.

    Parameters
    ----------
    log : Log
        With torque of commands that are positions.
    servo : Servo
    delay : float [s]
    """
    dt = signals.sampling_step(log.t)
    speed = signals.differentiate(log.q, dt)
    mean = acting(log, servo, log.t, dt, delay)
    shifts = dt * np.linspace(-0.5, 0.5, 5)
    parts = [acting(log, servo, log.t + x, dt / 4, delay) - x * speed for x in shifts]
    return servo.reaches_limit(log.tau + servo.gain * (parts - mean))


def replace_servo(log: Log, servo: Servo, other: Servo, later: float = 0.0) -> Log:
    """Return a log of commands with the torque of another servo.

    Parameters
    ----------
    log : Log
        With the torque of a servo.
    servo, other : Servo
        That servo, and the one that replaces it.
    later : float [s]
        Time by which commands act later than before.
    """
    assert log.servo_delay is not None
    delay = log.servo_delay + later
    dt = signals.sampling_step(log.t)
    before = servo_log(log, servo, log.servo_delay).tau
    after = servo_log(log, other, delay).tau
    ddq = signals.differentiate(signals.differentiate(log.q, dt), dt)
    apparent_inertia = (servo.lead - other.lead) * ddq
    tau = log.tau + after - before + apparent_inertia
    return replace(log, tau=tau, servo_delay=delay)


def set_aside_joints(log: Log, servo: Servo) -> Log:
    """Return a log in which joints that do not follow their commands are no data.

    Such a joint moves as it was measured, so that a rollout moves the other joints. Where no servo
    has kp, commanded positions are left out.

    Raises
    ------
    LogError
        If most joints whose commands move do not follow them, or speeds are followed and missing.
    """
    if not servo.kp.any():
        log = log.without(("q_ref",))
        if log.dq_ref is None:
            raise LogError(Finding("servos.speeds", log.name, joint=log.joints[0]))
    if log.q_ref is None:
        return log
    most = longest_delay(log)
    columns = zip(log.q_ref.T, log.q.T, strict=True)
    lost = np.array([not follows_command(command, q, most) for command, q in columns])
    stands = np.ptp(log.q_ref, axis=0) == 0.0
    if not lost.any():
        return log
    exchanged = find_exchanged(log)
    lost |= np.isin(log.joints, list(exchanged))
    if lost.sum() > np.sum(~lost & ~stands):
        joint = log.joints[int(np.argmax(lost))]
        if exchanged:
            why = phrase("servos.unfollowed", "exchanged", pairs=state_exchanged(exchanged))
        else:
            why = explain_lost(joint, log.q_ref[:, lost], log.q[:, lost], most)
        raise LogError(Finding("servos.unfollowed", log.name, joint=joint, why=why))
    return set_aside_rows(log, np.tile(lost, (len(log), 1)))


def set_aside_rows(log: Log, rows: np.ndarray) -> Log:
    """Return a log of commands in which joints move as measured in some rows, (N, n) bool.

    They are no data there.
    """
    if log.q_ref is None or not rows.any():
        return log
    unmeasured = rows if log.unmeasured is None else rows | log.unmeasured
    aside = rows if log.aside is None else rows | log.aside
    q_ref = np.where(rows, log.q, log.q_ref)
    return replace(log, q_ref=q_ref, unmeasured=unmeasured, aside=aside)


def follows_command(command: Array, q: Array, most: int) -> bool:
    """Whether a position (N,) follows its command (N,) within some samples, in the same unit."""
    # The standard deviation of a constant is not zero by rounding, but that of zeros is.
    size = float(np.std(command - command[0]))
    moved = float(q.std())
    # The command of a joint at rest gives no information.
    if min(size, max(moved, size) - RULES.small) <= 0.0:
        return True
    # A copy of the position is no command.
    if np.mean(command == q) > 1.0 - RULES.small:
        return False
    return not is_in_degrees(command, q) and correlation_when_delayed(command, q, most) > 0.5


def is_in_degrees(command: Array, q: Array) -> bool:
    """Return whether a command (N,) or its position (N,) seems to be in degrees."""
    ratio = float(command.std()) / max(float(q.std()), RULES.small)
    return bool(0.5 < np.radians(max(ratio, 1.0 / max(ratio, RULES.small))) < 2.0)


def explain_lost(joint: str, commands: Array, positions: Array, most: int) -> str:
    """Return why joints do not follow their commands, and the remedy.

    Parameters
    ----------
    joint : str
        The first of these joints.
    commands, positions : (N, k)
        Of the joints that do not follow.
    most : int
        Longest delay in samples.
    """
    pairs = list(zip(commands.T, positions.T, strict=True))
    degrees = sum(is_in_degrees(command, q) for command, q in pairs)
    against = sum(correlation_when_delayed(-command, q, most) > 0.5 for command, q in pairs)
    if 2 * degrees > len(pairs):
        command, q = pairs[0]
        ratio = float(command.std() / q.std())
        return phrase("servos.unfollowed", "degrees", ratio=ratio, joint=joint)
    if 2 * against > len(pairs):
        return phrase("servos.unfollowed", "reversed")
    rule = option_for_shell("--map", f"COLUMN={joint}.cmd", always=True)
    return phrase("servos.unfollowed", "other", rule=rule)


def correlation_when_delayed(command: Array, q: Array, most: int) -> float:
    """Return the largest correlation of a command (N,) with a position, over some delays.

    Parameters
    ----------
    command, q : (N,)
    most : int
        Longest delay in samples.
    """
    a = command - command.mean()
    b = q - q.mean()
    lags = range(0, min(most, len(a) // 2) + 1, max(1, most // 32))
    size = float(np.sqrt((a @ a) * (b @ b) + 1e-300))
    return max(float(a[: len(a) - k] @ b[k:]) for k in lags) / size
