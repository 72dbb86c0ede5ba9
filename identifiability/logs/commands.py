"""Commands of position servos: held between updates, and delayed.

A command is held until the next one, so commands form a staircase, and a delay shifts it. The
command that acts at a sample is the mean over the interval around the sample. This mean is
continuous in the delay. Commands may have another clock than rows (`Log.commands_since`).
"""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy

from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.robot.servo import Servo

from .log import Log
from .signals import sampling_step


def held_mean(t: Array, x: Array, at: Array, width: float) -> Array:
    """Return means of staircases x (N, n), whose steps are at t (N,), over intervals.

    Parameters
    ----------
    t : (N,) [s]
    x : (N, n)
        Values, each held until the next time. They are constant before the first and after the
        last.
    at : (m,) [s]
        Centres of the intervals.
    width : float [s]
        Their length.

    Returns
    -------
    (m, n)
    """
    areas = x[:-1] * np.diff(t)[:, None]
    start = np.zeros((1, x.shape[1]))
    sums = np.cumsum(areas, 0)
    area = np.concatenate([start, sums])
    ends = [_integral(t, x, area, at + side * 0.5 * width) for side in (-1, 1)]
    return (ends[1] - ends[0]) / width


def _integral(t: Array, x: Array, area: Array, at: Array) -> Array:
    """Return the integral of a staircase from its first time to others, (m, n)."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 1)
    return area[k] + x[k] * (at - t[k])[:, None]


def acting(log: Log, servo: Servo, at: Array, width: float, delay: float) -> Array:
    """Return the targets that act at some times, (m, n): positions that include all commands.

    The law of the servo is τ = kp (target − q) − kv dq, with dq_cmd and τ_ff included in the
    target. Without kp the target is a velocity, and τ = kv (target − dq). Without both gains it is
    τ_ff.

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

    position = servo.kp > 0
    gain = servo.gain
    out = np.zeros((len(at), len(log.joints)))
    if log.q_ref is not None:
        out += np.where(position, held(log.q_ref), 0.0)
    if log.dq_ref is not None:
        out += servo.kv / gain * held(log.dq_ref)
    if log.tau_ff is not None:
        out += held(log.tau_ff) / gain
    return out


def integral_torque(log: Log, servo: Servo, dt: float, delay: float) -> Array:
    """Return the torque of integral gains along a log, (N, n), without its unknown mean.

    Parameters
    ----------
    log : Log
    servo : Servo
    dt : float [s]
        Sampling step.
    delay : float [s]
    """
    if log.q_ref is None or not servo.integral.any():
        return np.zeros(log.q.shape)
    error = held_mean(log.commands_since, log.q_ref, log.t - delay, dt) - log.q
    torque = servo.integral * np.cumsum(error, axis=0) * dt
    return torque - torque.mean(0)


def are_positions_alone(log: Log) -> bool:
    """Return whether the commands of a log are neither speeds nor torque."""
    return log.dq_ref is None and log.tau_ff is None


def has_commands(log: Log) -> bool:
    """Return whether a log holds commanded positions or velocities."""
    return log.q_ref is not None or log.dq_ref is not None


def longest_delay(log: Log) -> int:
    """Return within how many samples a joint follows its command."""
    return max(1, round(0.5 / sampling_step(log.t)))


def find_exchanged(log: Log) -> dict[str, str]:
    """Return joints that follow the command of another joint, and that joint.

    Commands are assigned to positions such that the sum of squared distances is least. They are
    exchanged where this at least halves the squared distance of each joint of an exchange.
    """
    assert log.q_ref is not None
    most = longest_delay(log)
    far = np.array([[_distance(command, q, most) for command in log.q_ref.T] for q in log.q.T])
    if not np.isfinite(far).all():
        return {}
    joints, command_of = scipy.optimize.linear_sum_assignment(far)
    closer = 2 * far[joints, command_of] < far[joints, joints]
    exchanged = closer & closer[command_of]
    names = np.array(log.joints)
    pairs = zip(names[exchanged], names[command_of[exchanged]], strict=True)
    return {str(joint): str(other) for joint, other in pairs}


def state_exchanged(exchanged: Mapping[str, str]) -> list[str]:
    """Return which joint follows the command of which other joint, as words."""
    return [
        phrase("servos.unfollowed", "pair", joint=joint, other=other)
        for joint, other in exchanged.items()
    ]


def find_earliest(logs: Sequence[Log], delays: Sequence[float]) -> list[Finding]:
    """Return of which logs the commands have the earliest delay [s] that is searched, if any."""
    first = -min(sampling_step(log.t) for log in logs)
    at_end = np.isclose(delays, first)
    names = [log.name for log, is_first in zip(logs, at_end, strict=True) if is_first]
    return [Finding("early_commands", names=names, by=-1e3 * first)] if names else []


def _distance(command: Array, q: Array, most: int) -> float:
    """Return the mean square of a position (N,) about its command (N,), at the best delay."""
    lags = range(0, min(most, len(q) // 2) + 1, max(1, most // 32))
    return min(float(np.mean((command[: len(q) - k] - q[k:]) ** 2)) for k in lags)


def of_commands(log: Log) -> bool:
    """Return whether the torque of a log was computed from commands of servos."""
    return log.servo_delay is not None
