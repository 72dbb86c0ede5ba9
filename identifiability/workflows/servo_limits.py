"""Torque at which servos are at their limit where nobody states it, told by logs.

A drive that makes no more than some torque moves as if its servo were another one, and nothing in a
log of commands says so but the motion: what the servo's law asks for beyond the limit does not act.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from identifiability.effects.nominal import rigid_torque
from identifiability.estimation.noise import autocorrelation_time
from identifiability.estimation.rollouts import FAR, LATEST, fit_limits
from identifiability.estimation.rules import RULES
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.commands import servo_log
from identifiability.robot import Robot, complete_motion

#: Delays that are tried, and limits of a joint, from that share of its torque on.
DELAYS, LEVELS = 8, 40


def learn_limits(robot: Robot, logs: Sequence[Log]) -> Robot:
    """Return a robot whose servos have the limits of torque that logs with commands show.

    Those that the sidecar or an actuator states stay. What the law asks for is compared with what
    moves the joint, as far as a constant, speed, acceleration, direction and the bodies of the file
    explain it: it is more than that where, and only where, the drive is at its limit. Rollouts
    refine it.

    Parameters
    ----------
    robot : Robot
        Its gains are known.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    """
    servo = robot.servo
    if servo is None or robot.closed or not logs or not servo.limit_open.any():
        return robot
    asked = _Asked.of(robot, logs)
    limit = np.minimum(-servo.low, servo.high)
    for k in np.flatnonzero(servo.limit_open):
        limit[k] = asked.find_limit(int(k))
    shown = servo.limit_open & np.isfinite(limit)
    found = fit_limits(robot, logs, limit, shown) if shown.any() else limit
    shown &= np.isfinite(found)
    if not shown.any():
        return robot
    each = [f"{robot.joints[k]} {found[k]:.3g}" for k in np.flatnonzero(shown)]
    text = (
        f"Nobody states the limits of the servos, and {listing([x.name for x in logs], 4)} "
        f"{'shows' if len(logs) == 1 else 'show'} that torque of some ends at one: "
        f"{listing(each, 12)} ([servo] limit states them); torque beyond it is no data."
    )
    return replace(robot, servo=servo.at_most(found, f"{servo.found} {text}".strip()))


@frozen
class _Asked:
    """Torque that servos are asked for, and what moves joints.

    Attributes
    ----------
    raw : (N, n)
    own : (n, N, 5)
        Orthonormal columns of each joint: a constant, speed, acceleration, direction, and the
        torque of the file's bodies.
    windows : tuple of (start, rows)
        Of each log: where it begins, and over how many samples it is smoothed.
    """

    raw: Array
    own: Array
    windows: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, robot: Robot, logs: Sequence[Log]) -> _Asked:
        """Return that of logs, with the delay of commands that agrees best with the motion."""
        servo = robot.servo
        assert servo is not None
        free = servo.at_most(np.full(len(robot.joints), np.inf))
        late = np.linspace(0, LATEST, DELAYS) if servo.delay is None else [servo.delay]
        own, raws, windows = list[Array](), list[list[Array]]([] for _ in late), []
        start = 0
        for log in logs:
            dt = signals.sampling_step(log.t)
            # Time over which positions are smoothed [s].
            rows = min(2 * max(2, round(0.5 * 0.1 / dt)) + 1, (len(log) - 1) // 2 * 2 + 1)
            q, v, a = (_smooth(log.q, rows, order, dt) for order in range(3))
            bodies = rigid_torque(robot, complete_motion(robot, log.t, q, v, a))
            own.append(np.stack([np.ones(q.shape), v, a, np.sign(v), bodies]))
            calm = replace(log, dq=v, unmeasured=None)  # steps of encoders are no torque that ends
            for raw, delay in zip(raws, late, strict=True):
                raw.append(servo_log(calm, free, float(delay)).tau)
            windows.append((start, rows))
            start += len(log)
        columns = np.linalg.qr(np.concatenate(own, 1).transpose(2, 1, 0))[0]
        tried = [cls(np.concatenate(raw), columns, tuple(windows)) for raw in raws]
        endless = np.full(1, np.inf)
        joints = range(len(robot.joints))
        return min(tried, key=lambda x: sum(x.unexplained(k, endless)[0][0] for k in joints))

    def unexplained(self, k: int, limits: Array) -> tuple[Array, Array]:
        """Return what the motion leaves of the torque of a joint with some limits (m,).

        Returns
        -------
        (m,)
            As a share of how much it varies.
        (N, m)
        """
        raw = np.clip(self.raw[:, k, None], -limits, limits)
        starts = [start for start, _ in self.windows]
        parts = zip(np.split(raw, starts[1:]), self.windows, strict=True)
        y = np.concatenate([_smooth(part, rows) for part, (_, rows) in parts])
        left = y - self.own[k] @ (self.own[k].T @ y)
        return (left**2).sum(0) / np.maximum(((y - y.mean(0)) ** 2).sum(0), 1e-300), left

    def find_limit(self, k: int) -> float:
        """Return the limit of a joint that explains most; infinite if none does surely.

        Sure is a ratio of likelihoods that none of as many limits reaches by chance, and one that
        leaves less than half of what is unexplained: rollouts, which cost more, ask for that, too.
        """
        size = np.abs(self.raw[:, k])
        # Delays that are tried, and limits of a joint, from that share of its torque on.
        levels = np.quantile(size, np.linspace(0.3, 1, LEVELS, endpoint=False))
        levels = np.array([np.inf, *levels[levels > 0]])
        share, left = self.unexplained(k, levels)
        best = int(np.argmin(share))
        if not 0 < share[best] < FAR * share[0]:
            return np.inf
        count = len(left) / autocorrelation_time(left[:, [best]])[0]
        tests = len(levels) * self.raw.shape[1]
        sure = float(scipy.special.chdtri(1, RULES.unasked_level / tests))
        return float(levels[best]) if count * np.log(share[0] / share[best]) > sure else np.inf


def _smooth(x: Array, rows: int, order: int = 0, dt: float = 1.0) -> Array:
    """Return columns (N, ...) or derivatives of them: of parabolas through so many samples."""
    out: Array = scipy.signal.savgol_filter(x, rows, 3, order, dt, axis=0)
    return out
