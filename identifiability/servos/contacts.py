"""Joints that something outside the robot holds: a gripper on an object, a hand on a table.

Friction holds a resting joint until its command is far enough away. If a joint rests while its
command is much further away than where the joint usually lets go, something else holds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.quoting import option_for_shell
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import First, Progress
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.simulation.rollout import CommandedRobot

from .fit import fit_rollouts, refit_rollouts
from .positions import encoder_noise, resting_rows
from .rollouts import Rollouts
from .standing import FEWEST_RESTS
from .torque import set_aside_rows
from .windows import Window

#: How many times further away than where friction lets go the command of a blocked joint is.
FURTHER: Tolerance = 2.25


def fit_unblocked(
    robot: Robot,
    logs: Sequence[Log],
    shares: NumberByName,
    say: Progress,
    first: First | None,
) -> Rollouts:
    """Return rollouts that follow logs where nothing holds a joint, with these rows.

    Parameters
    ----------
    robot, logs, shares, say, first
        As of `fit_rollouts`.
    """
    assert robot.servo is not None
    found = fit_rollouts(robot, logs, shares, robot.servo.delay, say, first)
    blocked = tuple[np.ndarray, ...]()
    # Numbers of blocked joints find joints that are nearly as blocked.
    for _ in range(2):
        before = found.search[0].windows
        machine = move_by_rollouts(robot, found)
        blocked = tuple(find_blocked(machine, log) for log in logs)
        aside = list(map(set_aside_rows, logs, blocked))
        after = [window.along(aside[window.log]) for window in before]
        lost = _lost_share(before, after)
        if not lost.any():
            break
        # Where a tenth of its rows was no data, the search was far from the joint's numbers.
        found = refit_rollouts(found, aside, lost > 0.1)
    return replace(found, blocked=blocked)


def _lost_share(before: Sequence[Window], after: Sequence[Window]) -> Array:
    """Return which share of the judged rows of each joint is judged no longer, or anew, (n,)."""
    old, new = (np.concatenate([window.judged for window in x]) for x in (before, after))
    share: Array = np.mean(old != new, axis=0) / np.maximum(np.mean(old, axis=0), 1e-9)
    return share


def move_by_rollouts(robot: Robot, found: Rollouts) -> CommandedRobot:
    """Return a robot with the numbers of rollouts."""
    assert robot.servo is not None
    known = replace(robot, servo=robot.servo.having(found.numbers))
    return CommandedRobot(known, found.parameters)


def leave_out_blocked(
    robot: Robot, values: NumberByName, logs: Sequence[Log]
) -> tuple[list[Log], list[Finding]]:
    """Return logs in which joints that something else holds are no data, and their findings.

    Logs without commands, and those of a robot that cannot be rolled out, are returned as they are.

    Parameters
    ----------
    robot : Robot
    values : mapping of str to float
        Standard parameters by name that replace its own.
    logs : sequence of Log
        In the robot's order of joints.
    """
    if robot.servo is None or not any(log.q_ref is not None for log in logs):
        return list(logs), []
    try:
        machine = CommandedRobot(robot, values)
    except RobotError:
        return list(logs), []
    aside = [set_aside_blocked(machine, log) for log in logs]
    return aside, state_blocked(logs, aside)


def set_aside_blocked(machine: CommandedRobot, log: Log) -> Log:
    """Return a log in which joints that something else holds are no data.

    Such a joint moves as it was measured.

    Parameters
    ----------
    machine : CommandedRobot
    log : Log
        In the robot's order of joints.
    """
    return set_aside_rows(log, find_blocked(machine, log))


def state_blocked(logs: Sequence[Log], aside: Sequence[Log]) -> list[Finding]:
    """Return which joints something else holds, for logs as they came, and without these rows."""
    where = list[str]()
    often = dict[str, str]()
    for log, other in zip(logs, aside, strict=True):
        if other.q_ref is None:
            continue
        shares = np.mean(other.q_ref != log.select(other.joints).q_ref, axis=0)
        for joint, share in zip(other.joints, shares, strict=True):
            if share > 0:
                where.append(f"{joint} for {100 * share:.2g} % of {log.name}")
            if share > 0.5:
                often[joint] = option_for_shell("--map", f"{joint}.cmd=left_out")
    if not where:
        return []
    part = "often" if often else "seldom"
    remedy = phrase("blocked", part, joints=[*often], rules=" ".join(often.values()))
    return [Finding("blocked", where=where, remedy=remedy)]


def find_blocked(machine: CommandedRobot, log: Log) -> np.ndarray:
    """Return rows in which something outside the robot holds a joint, (N, n) bool.

    A joint is judged if friction lets it go at least twice in each direction, or if it moves
    for some time in each. Without commanded positions no joint is judged.

    Parameters
    ----------
    machine : CommandedRobot
        Its gravity moves a joint off its command, and is subtracted.
    log : Log
        In the robot's order of joints.
    """
    blocked = np.zeros(log.q.shape, bool)
    if log.q_ref is None:
        return blocked
    gain = machine.servo.gain
    judged = np.flatnonzero((gain > 0) & ~(machine.servo.integral > 0) & ~log.is_unmeasured)
    rests = {j: each for j in judged.tolist() if (each := list_rests(log, j))}
    if not rests:
        return blocked
    apart = log.q_ref - log.q - machine.gravity(log.q) / np.where(gain > 0, gain, 1.0)
    rows = resting_rows(log)
    for j, of_joint in rests.items():
        blocked[:, j] = _find_held_rests(apart[:, j], log.q[:, j], of_joint, rows)
    return blocked


def _find_held_rests(
    apart: Array, q: Array, rests: Sequence[tuple[int, int]], rows: int
) -> np.ndarray:
    """Return rows of the rests at which more than friction holds a joint, (N,) bool.

    Parameters
    ----------
    apart : (N,) [rad or m]
        Command minus position, without the share of gravity.
    q : (N,) [rad or m]
    rests : sequence of (int, int)
    rows : int
        For which a joint stands before it is at rest.
    """
    held = np.zeros(len(q), bool)
    let_go = np.array([stop - 1 for _, stop in rests], int)
    limits = _friction_limits(apart, q, let_go, rows, FEWEST_RESTS)
    # A joint that friction rarely lets go is compared with its own motion.
    limits = limits or _motion_limits(apart, q, rests, rows)
    if limits is None:
        return held
    middle, reach = limits
    is_far = np.abs(apart - middle) > FURTHER * reach
    for start, stop in rests:
        # A command that jumps is far away until it acts.
        held[start:stop] = np.sum(is_far[start:stop]) > rows
    return held


def _motion_limits(
    apart: Array, q: Array, rests: Sequence[tuple[int, int]], rows: int
) -> tuple[float, float] | None:
    """Return limits as `_friction_limits` does, of motion. Parameters: see `_find_held_rests`."""
    # An object may hold a joint before it rests, and until it moves.
    near = [np.arange(start - rows, stop + rows) for start, stop in rests]
    moves = np.setdiff1d(np.arange(len(q)), np.concatenate(near))
    # Delays and viscous friction also keep it behind its command.
    speed = np.gradient(q)
    motion = np.stack([speed, np.sign(speed), np.ones(len(q))], axis=1)
    slope = np.linalg.lstsq(motion[moves], apart[moves], rcond=None)[0]
    return _friction_limits(apart - slope[0] * speed, q, moves, rows, rows)


def list_rests(log: Log, joint: int) -> list[tuple[int, int]]:
    """Return where a joint begins and ends to rest, as rows [start, stop)."""
    rows = resting_rows(log)
    q = log.q[:, joint]
    noise = 3.0 * encoder_noise(log)[joint]
    if len(q) < rows:
        return []
    stretches = np.lib.stride_tricks.sliding_window_view(q, rows)
    begins = np.flatnonzero(np.ptp(stretches, axis=1) <= noise)
    rests = np.zeros(len(q) + 2, int)
    for k in range(rows):
        rests[begins + k + 1] = 1
    edges = np.flatnonzero(np.diff(rests))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _friction_limits(
    apart: Array, q: Array, at: np.ndarray, rows: int, fewest: int
) -> tuple[float, float] | None:
    """Return the middle of the distances at which friction lets a joint go, and their reach.

    There is nothing if too few rows are followed by motion in a direction.

    Parameters
    ----------
    apart : (N,) [rad or m]
        Command minus position, without the share of gravity.
    q : (N,) [rad or m]
    at : (m,) int
        Rows after which the joint may move.
    rows : int
        A joint that is let go moves on for as many rows.
    fewest : int
        In each direction.
    """
    at = at[at + rows < len(q)]
    ahead = q[at + rows] - q[at]
    let_go = apart[at][ahead * apart[at] > 0]
    forward = let_go[let_go > 0]
    backward = let_go[let_go < 0]
    if min(len(forward), len(backward)) < fewest:
        return None
    middle = 0.5 * (np.median(forward) + np.median(backward))
    # A joint that slips while it is blocked is let go further away.
    reach = np.quantile(np.abs(let_go - middle), 0.9)
    return float(middle), float(reach)
