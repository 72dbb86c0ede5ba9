"""From a periodic motion to what a controller plays: from rest, into the periods, back to rest.

The motion stands still in the middle of its range, grows to the full periods, and shrinks back:
``q = c + w(t) (q_F(t) - c)`` with a window w that rises from 0 to 1 with two continuous derivatives
(a quintic). The position is then always between middle and full motion, so limits of position are
kept; the rise is made so long that those of speed and acceleration are kept as well.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import ClosureError, LogError
from identifiability.robot import Robot, complete_motion
from identifiability.simulation.motion import MOST_SAMPLES, PrescribedMotion, Trajectory
from identifiability.workflows.excite.clearance import MARGIN, Clearance
from identifiability.workflows.excite.drive import Drive
from identifiability.workflows.excite.limits import Limits

#: Lengths of the rise that are tried, in periods.
RISES = (0.25, 0.5, 1.0, 2.0, 4.0)

#: What rounding and the harmonics between samples may add to a limit.
SLACK = 1.01


def play(
    robot: Robot, trajectory: Trajectory, limits: Limits, rate: float, periods: int
) -> PrescribedMotion:
    """Return a motion from rest to rest with whole periods in the middle.

    Parameters
    ----------
    robot : Robot
    trajectory : Trajectory
        Within the limits.
    limits : Limits
    rate : float [Hz]
        Samples a second.
    periods : int
        Whole periods between rise and fall.

    Raises
    ------
    LogError
        If it would have too many samples, or no rise keeps the limits.
    """
    longest = trajectory.period * (periods + 2 * RISES[-1])
    if longest * rate > MOST_SAMPLES:
        raise LogError(
            f"{longest:g} s at {rate:g} Hz are more than {MOST_SAMPLES:,} samples; give a lower "
            "rate or fewer periods."
        )
    drive, (watched, _) = Drive.of(robot, limits), Clearance.of(robot)
    for rise in RISES:
        motion = _windowed(trajectory, rise * trajectory.period, rate, periods)
        if _keeps(robot, motion, limits, drive, watched):
            return motion
    raise LogError(
        f"No way from rest into {trajectory.name} was found that keeps the limits of {robot.name} "
        "and its bodies apart; search with slightly narrower limits of position, speed, "
        "acceleration or workspace."
    )


def _windowed(path: Trajectory, rise: float, rate: float, periods: int) -> PrescribedMotion:
    whole = 2 * rise + periods * path.period
    t = np.arange(round(whole * rate) + 1) / rate
    up = np.clip(np.minimum(t, t[-1] - t) / rise, 0.0, 1.0)[:, None]
    side = np.where(t < t[-1] / 2, 1.0, -1.0)[:, None] / rise
    w = up**3 * (10 - 15 * up + 6 * up**2)
    dw = 30 * up**2 * (1 - up) ** 2 * side
    ddw = 60 * up * (1 - up) * (1 - 2 * up) * side**2
    q, dq, ddq = path.motion(t - rise)
    full = path.motion(path.times())[0]
    middle = 0.5 * (full.max(0) + full.min(0))
    away = q - middle
    return PrescribedMotion(
        t,
        middle + w * away,
        dw * away + w * dq,
        ddw * away + 2 * dw * dq + w * ddq,
        path.name,
    )


def _keeps(
    robot: Robot,
    motion: PrescribedMotion,
    limits: Limits,
    drive: Drive | None,
    watched: Clearance | None,
) -> bool:
    """Return whether a motion keeps every limit, of loops and workspace too, and bodies apart."""
    fast = np.abs(motion.dq).max(0) / limits.speed
    hard = np.abs(motion.ddq).max(0) / limits.acceleration
    if max(fast.max(), hard.max()) > SLACK:
        return False
    try:
        whole = complete_motion(robot, motion.t, motion.q, motion.dq, motion.ddq)
    except ClosureError:
        return False
    if len(whole) < len(motion.t) or whole.singular or whole.condition > limits.closure_bound:
        return False
    for box in limits.boxes:
        at = robot.tree.positions(whole.q, box.point)
        if np.any(at > box.high) or np.any(at < box.low):
            return False
    if drive is not None and float(drive.load(whole).max()) > SLACK:
        return False
    return watched is None or float(watched.gaps(whole.q).min()) >= MARGIN / 2
