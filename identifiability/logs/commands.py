"""Commands of position servos: held between updates, delayed, and what torque servos make of them.

A command is held until the next one comes, so it is a staircase, and a delay shifts the staircase.
What of it acts at a sample is its mean over the interval around the sample, which depends on the
delay without jumps. Commands may come on another clock than rows (`Log.commands_since`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.quoting import option_for_shell
from identifiability.logs import signals
from identifiability.logs.log import Log
from identifiability.logs.rules import RULES
from identifiability.robot.servo import Servo


def held_mean(t: Array, x: Array, at: Array, width: float) -> Array:
    """Return means of staircases x (N, n), whose steps are at t (N,), over intervals.

    Parameters
    ----------
    t : (N,) [s]
    x : (N, n)
        Held from one time until the next; before the first and after the last as there.
    at : (m,) [s]
        Middles of the intervals.
    width : float [s]
        Their length.

    Returns
    -------
    (m, n)
    """
    area = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x[:-1] * np.diff(t)[:, None], 0)])
    ends = [_integral(t, x, area, at + side * 0.5 * width) for side in (-1, 1)]
    mean: Array = (ends[1] - ends[0]) / width
    return mean


def _integral(t: Array, x: Array, area: Array, at: Array) -> Array:
    """Return the integral of a staircase from its first time to others, (m, n)."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
    out: Array = area[k] + x[k] * (at - t[k])[:, None]
    return out


def acting(log: Log, servo: Servo, at: Array, width: float, delay: float) -> Array:
    """Return the targets that act at some times, (m, n): positions with all else in them.

    τ = kp (target − q) − kv dq is the servo's law, with dq_cmd and τ_ff in the target; of servos
    without kp it is a velocity, and τ = kv (target − dq), and without either it is τ_ff.

    Parameters
    ----------
    log : Log
        With commands.
    servo : Servo
    at : (m,) [s]
    width : float [s]
        Interval over which the held commands are averaged.
    delay : float [s]
    """

    def held(x: Array) -> Array:
        return held_mean(log.commands_since, x, at - delay, width)

    position, gain = servo.kp > 0, servo.gain
    out = np.zeros((len(at), len(log.joints)))
    if log.q_ref is not None:
        out += np.where(position, held(log.q_ref), 0.0)
    if log.dq_ref is not None:
        out += servo.kv / gain * held(log.dq_ref)
    if log.tau_ff is not None:
        out += held(log.tau_ff) / gain
    return out


def has_commands(log: Log) -> bool:
    """Whether a log holds positions or velocities that servos were told."""
    return log.q_ref is not None or log.dq_ref is not None


def of_commands(log: Log) -> bool:
    """Whether the torque of a log is what servos made of commands."""
    return log.servo_delay is not None


def servo_log(log: Log, servo: Servo, delay: float) -> Log:
    """Return a log of commands with the torque that the servos made of them.

    Where they were saturated torque is no data: an encoder's error then changes which it is. Where
    rows are lost it is none, either.

    Parameters
    ----------
    log : Log
        In the robot's order of joints.
    servo : Servo
    delay : float [s]
    """
    dt = signals.sampling_step(log.t)
    dq = signals.differentiate(log.q, dt) if log.dq is None else log.dq
    target = acting(log, servo, log.t, dt, delay)
    raw = servo.gain * target - servo.kp * log.q - servo.damping * dq
    tau = np.clip(raw, servo.low, servo.high)
    # Between rows that are far apart commands came that nobody wrote down.
    gaps = signals.has_gap(log.t)
    gone = held_mean(log.commands_since, np.append(gaps, False)[:, None], log.t - delay, dt) > 0
    lost = (tau != raw) | gone
    lost = lost if log.unmeasured is None else lost | log.unmeasured
    return replace(
        log,
        tau=tau,
        unmeasured=lost if lost.any() else None,
        motion_alone=False,
        servo_delay=float(delay),
    )


def moved(log: Log, servo: Servo, other: Servo, more: float = 0.0) -> Log:
    """Return a log as it is with other servos, and commands that act later by a little [s]."""
    assert log.servo_delay is not None
    before, after = (
        servo_log(log, one, log.servo_delay + d).tau for one, d in ((servo, 0.0), (other, more))
    )
    dt = signals.sampling_step(log.t)
    seeming = (servo.lead - other.lead) * signals.differentiate(
        signals.differentiate(log.q, dt), dt
    )
    tau = log.tau + after - before + seeming
    return replace(log, tau=tau, servo_delay=log.servo_delay + more)


def check_commands(log: Log) -> None:
    """Refuse commands that the motion contradicts: those of other joints, or of other units.

    Raises
    ------
    LogError
    """
    if log.q_ref is None:
        return
    # A command is followed at some delay up to this one [s].
    most = max(1, round(0.5 / signals.sampling_step(log.t)))
    for joint, command, q in zip(log.joints, log.q_ref.T, log.q.T, strict=True):
        told, moved = float(command.std()), float(q.std())
        if max(moved, told) < RULES.small:
            continue
        degrees = 0.5 < np.radians(told / max(moved, RULES.small)) < 2.0
        if degrees or _follows(command, q, most) <= 0.5:
            rule = option_for_shell("--map", f"COLUMN={joint}.cmd", always=True)
            raise LogError(
                f"{log.name}: '{joint}' does not follow its command"
                f"{'; it looks like degrees' if degrees else ''}: say which column is its command, "
                f"as in {rule}, and in which unit; if that is right, its servo "
                "is too weak for this motion: leave the log out."
            )


def _follows(command: Array, q: Array, most: int) -> float:
    """Return the correlation of a command (N,) with a position, at the best of some delays."""
    a, b = command - command.mean(), q - q.mean()
    lags = range(0, min(most, len(a) // 2) + 1, max(1, most // 32))
    size = float(np.sqrt((a @ a) * (b @ b) + 1e-300))
    return max(float(a[: len(a) - k] @ b[k:]) for k in lags) / size
