"""What is odd about positions, time, contacts, the robot file, and joints that say nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.contradictions import looks_like_degrees
from identifiability.logs.prepare.dataset import stands_still
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.quality.mends import find_runs
from identifiability.quality.registry import Does, MeasuredLogs, check
from identifiability.quality.rules import RULES

# Positions beyond the limits of the robot file: another unit, zero, sign or joint.


TURN = 2 * np.pi


@check("limits", Does.HINTS)
def find_beyond_limits(logs: MeasuredLogs) -> list[Finding]:
    """Return positions beyond the limits that no whole turn explains."""
    robot, said = logs.robot, []
    for k, joint in enumerate(logs.joints):
        low, high = robot.limits[k]
        q = logs.motion.actuated_q[:, k]
        turns = not robot.is_prismatic(int(robot.actuated[k]))
        if not np.isfinite(high - low) or not _outside(q, low, high, turns=turns):
            continue
        why = ""
        if turns and robot.angles is None and looks_like_degrees(q, low, high):
            why = phrase("limits", "degrees")
        elif not _outside(-q, low, high, turns=turns):
            why = phrase("limits", "sign")
        span = {"joint": joint, "low": q.min(), "high": q.max(), "least": low, "most": high}
        said.append(phrase("limits", "one", why=why, **span))
    return [Finding("limits", where=said)] if said else []


def _outside(q: Array, low: float, high: float, *, turns: bool) -> bool:
    """Return whether positions (N,) lie outside of limits, whole turns aside."""
    if turns:
        q = q - TURN * round((float(np.median(q)) - 0.5 * (low + high)) / TURN)
    # They lie outside by this share of the allowed range.
    margin = 0.05 * (high - low)
    # Share of the samples that must lie outside the limits of a joint.
    return bool(np.mean((q < low - margin) | (q > high + margin)) > 0.2)


# Time in another unit: speeds that contradict the file's limits, or too few samples.


@check("clock", Does.MISREADS)
def find_time_scale(logs: MeasuredLogs) -> list[Finding]:
    """Return speeds that contradict the file's limits, or too few samples."""
    why = _by_limits(logs) or _by_rate(logs)
    return [Finding("clock", why=why)] if why else []


def _by_limits(logs: MeasuredLogs) -> str:
    """Compare speeds with the file's limits."""
    limits = np.asarray(logs.robot.speed_limits, float)
    known = np.isfinite(limits) & (limits > 0)
    if not known.any():
        return ""
    speed, times = np.abs(logs.motion.actuated_v).max(0), RULES.speed_beyond
    if not (speed[known] > times * limits[known]).all():
        return ""
    k = int(np.flatnonzero(known)[np.argmax(speed[known] / limits[known])])
    told = {"joint": logs.joints[k], "speed": speed[k], "limit": limits[k]}
    return phrase("clock", "limits", times=times, **told)


def _by_rate(logs: MeasuredLogs) -> str:
    for log in logs.recordings:
        step = (log.clock.last - log.clock.first) / max(len(log) - 1, 1)
        if step > LOG_RULES.slowest_step:
            return phrase("clock", "rate", log=log.name, step=step)
    return ""


# Positions that repeat one value although the joint goes on: a reading that hung.


@check("stopped", Does.HINTS)
def find_hung(logs: MeasuredLogs) -> list[Finding]:
    """Return stretches in which positions hang; torque that does is left out (`stuck`)."""
    found = [(s, x, log.name) for s, log in logs.windows() for x in find_stretches(log)]
    said = [
        phrase("stopped", "one", joint=joint, first=s + a + 1, last=s + b, log=name)
        for s, (joint, a, b), name in found
    ]
    columns = tuple(dict.fromkeys(f"{joint}.q" for _, (joint, *_), _ in found))
    rows = sum(b - a for _, (_, a, b), _ in found)
    return [Finding("stopped", where=said, rows=rows, columns=columns)] if said else []


def find_stretches(log: Log) -> Iterator[tuple[str, int, int]]:
    """Yield joint, first row and last (exclusive) of stretches in which its position hangs.

    When it goes on it leaps, where a joint that rested starts by and by.
    """
    for joint, x in zip(log.joints, log.q.T, strict=True):
        step = np.abs(np.diff(x, append=x[-1]))
        usual = float(np.quantile(step, 0.9))
        for a, b in find_runs(x[:, None]):
            # When it goes on, it leaps so many times as far as usually in one sample.
            if usual > 0 and step[b - 1] > 6.0 * usual:
                yield joint, a, b


# What is odd about the robot file, and about joints that say nothing: asked of any logs.


@check("bodies", Does.HINTS, always=True)
def find_bodies(logs: MeasuredLogs) -> list[Finding]:
    """Return the bodies of the file that cannot exist."""
    text = find_impossible_bodies(logs.robot)
    return [Finding("bodies", text)] if text else []


@check("assembly", Does.HINTS, always=True)
def find_assembly(logs: MeasuredLogs) -> list[Finding]:
    """Return how loops were closed that the file leaves open."""
    text = logs.robot.describe_assembly()
    return [Finding("assembly", text)] if text else []


@check("outside", Does.HINTS, always=True)
def find_outside(logs: MeasuredLogs) -> list[Finding]:
    """Return the bodies that were left out."""
    robot = logs.robot
    return [Finding("outside", robot.path.name, bodies=robot.outside)] if robot.outside else []


@check("still", Does.HINTS, always=True)
def find_still(logs: MeasuredLogs) -> list[Finding]:
    """Return the joints that stand still."""
    surveys = [s.survey for s in logs.samples]
    idle, rows = stands_still(surveys), np.sum([s.rows for s in surveys], axis=0)
    still = [j for j, r, s in zip(logs.joints, rows, idle, strict=True) if not r and s]
    if not (still and any(s.outputs for s in surveys)):
        return []
    at = dict(zip(logs.robot.joints, np.median(logs.motion.actuated_q, 0), strict=True))
    locks = " ".join(f"--lock {j}={at[j]:.4g}" for j in still if j in at)
    columns = tuple(f"{j}.tau" for j in still)
    locks = f" ({locks})" if locks else ""
    return [Finding("still", joints=still, locks=locks, rows="all", columns=columns)]


# Contacts of a robot that floats: does it stay up by those that are closed?


#: Fewest samples by which a base is compared with its contacts.
FEWEST = 32


@check("unheld", Does.MISREADS)
def find_unheld(logs: MeasuredLogs) -> list[Finding]:
    """Return what measured forces carry where no contact is closed; nothing if it is the robot."""
    robot, some = logs.robot, logs.motion
    fall = 0.0 if robot.base is None else float(np.linalg.norm(robot.base.gravity))
    if robot.base is None or not (fall and logs.weighs):
        return []
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    open_ = ~(closed > 0.5).any(1)
    held = open_ & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(FEWEST, open_.sum() / 2):
        return []
    needed = logs.predicted[held, :3]
    share = float((logs.torque[held, :3] * needed).sum() / (needed**2).sum())
    if share > 0.5:
        return []
    which = "wrenches" if robot.base.wrenches else "closed" if robot.base.contacts else "nothing"
    cause = phrase("unheld", "opposite" if share < -0.5 else "less")
    told = {"name": robot.name, "share": 100 * held.mean(), "held": 100 * share, "cause": cause}
    return [Finding("unheld", why=phrase("unheld", which, **told))]
