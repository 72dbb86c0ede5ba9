"""Joints that something outside the robot holds: a gripper on an object, a hand on a table.

Friction holds a resting joint until its command is far enough away. If a joint rests while its
command is much further away than where the joint usually lets go, something else holds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import First, Progress
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.simulation.rollout import CommandedRobot

from .fit import fit_rollouts, refit_rollouts
from .positions import encoder_noise, resting_rows
from .rollouts import Rollouts
from .standing import FEWEST_RESTS
from .windows import Window

#: How many times further away than where friction lets go the command of a blocked joint is.
FURTHER: Tolerance = 2.25


def fit_unblocked(
    robot: Robot,
    logs: Sequence[Log],
    shares: Mapping[str, float],
    say: Progress,
    first: First | None,
) -> tuple[Rollouts, list[Log]]:
    """Return rollouts that follow logs, and the logs in which blocked joints are no data.

    Parameters
    ----------
    robot, logs, shares, say, first
        As of `fit_rollouts`.
    """
    assert robot.servo is not None
    found = fit_rollouts(robot, logs, shares, robot.servo.delay, say, first)
    aside = list(logs)
    # Numbers of blocked joints find joints that are nearly as blocked.
    for _ in range(2):
        before = found.search[0].windows
        aside = [set_aside_blocked(robot, log, found) for log in logs]
        after = [window.along(aside[window.log]) for window in before]
        lost = _lost_share(before, after)
        if not lost.any():
            break
        # Where a tenth of its rows was no data, the search was far from the joint's numbers.
        found = refit_rollouts(found, aside, lost > 0.1)
    return found, aside


def _lost_share(before: Sequence[Window], after: Sequence[Window]) -> Array:
    """Return which share of the judged rows of each joint is judged no longer, or anew, (n,)."""
    old, new = (np.concatenate([window.judged for window in x]) for x in (before, after))
    share: Array = np.mean(old != new, axis=0) / np.maximum(np.mean(old, axis=0), 1e-9)
    return share


def set_aside_blocked(robot: Robot, log: Log, found: Rollouts) -> Log:
    """Return a log in which joints that something else holds are no data.

    Such a joint moves as it was measured.

    Parameters
    ----------
    robot : Robot
    log : Log
        With commands, in the robot's order of joints.
    found : Rollouts
        Of this robot.
    """
    if log.q_ref is None or robot.servo is None:
        return log
    known = replace(robot, servo=robot.servo.having(found.numbers))
    blocked = find_blocked(CommandedRobot(known, found.parameters), log)
    if not blocked.any():
        return log
    unmeasured = blocked if log.unmeasured is None else blocked | log.unmeasured
    return replace(log, q_ref=np.where(blocked, log.q, log.q_ref), unmeasured=unmeasured)


def state_blocked(logs: Sequence[Log], aside: Sequence[Log]) -> list[Finding]:
    """Return which joints something else holds, for logs as they came, and without these rows."""
    where = []
    for log, other in zip(logs, aside, strict=True):
        if other.q_ref is None:
            continue
        shares = np.mean(other.q_ref != log.select(other.joints).q_ref, axis=0)
        where += [
            f"{other.joints[j]} for {100 * shares[j]:.2g} % of {log.name}"
            for j in np.flatnonzero(shares)
        ]
    return [Finding("blocked", where=where)] if where else []


def find_blocked(machine: CommandedRobot, log: Log) -> np.ndarray:
    """Return rows in which something outside the robot holds a joint, (N, n) bool.

    A joint is judged if friction lets it go at least twice in each direction.

    Parameters
    ----------
    machine : CommandedRobot
        Its gravity moves a joint off its command, and is subtracted.
    log : Log
        With commands, in the robot's order of joints.
    """
    assert log.q_ref is not None
    blocked = np.zeros(log.q.shape, bool)
    gain = machine.servo.gain
    judged = np.flatnonzero((gain > 0) & ~(machine.servo.integral > 0) & ~log.is_unmeasured)
    rests = {j: list_rests(log, j) for j in judged.tolist()}
    if not any(rests.values()):
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

    Parameters are those of `_friction_limits`.
    """
    held = np.zeros(len(q), bool)
    limits = _friction_limits(apart, q, rests, rows)
    if limits is None:
        return held
    middle, reach = limits
    is_far = np.abs(apart - middle) > FURTHER * reach
    for start, stop in rests:
        # A command that jumps is far away until it acts.
        held[start:stop] = np.sum(is_far[start:stop]) > rows
    return held


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
    apart: Array, q: Array, rests: Sequence[tuple[int, int]], rows: int
) -> tuple[float, float] | None:
    """Return the middle of the distances at which friction lets a joint go, and their reach.

    There is nothing if friction rarely lets the joint go.

    Parameters
    ----------
    apart : (N,) [rad or m]
        Command minus position, without the share of gravity.
    q : (N,) [rad or m]
    rests : sequence of (int, int)
    rows : int
        A joint that is let go moves on for as many rows.
    """
    ends = np.array([stop for _, stop in rests if stop + rows <= len(q)], int)
    ahead = q[ends + rows - 1] - q[ends - 1]
    let_go = apart[ends - 1][ahead * apart[ends - 1] > 0]
    forward = let_go[let_go > 0]
    backward = let_go[let_go < 0]
    if min(len(forward), len(backward)) < FEWEST_RESTS:
        return None
    middle = 0.5 * (np.median(forward) + np.median(backward))
    # A joint that slips while it is blocked is let go further away.
    reach = np.quantile(np.abs(let_go - middle), 0.9)
    return float(middle), float(reach)
