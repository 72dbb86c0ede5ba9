"""What is odd about positions, about the robot file, and about joints that say nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.contradictions import looks_like_degrees
from identifiability.logs.gaps import NAMES, smallest_change
from identifiability.logs.prepare.dataset import stands_still
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.quality.registry import Does, MeasuredLogs, check

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


# Stretches in which a column repeats one value although the joint goes on: a reading that hung.


#: Shortest stretch that is said, in runs of repeats.
SHORTEST = 4


@check("stopped", Does.HINTS)
def find_hung(logs: MeasuredLogs) -> list[Finding]:
    """Return stretches in which columns hang."""
    found = [(s, x, log.name) for s, log in logs.windows() for x in find_stretches(log)]
    said = [
        phrase("stopped", "one", channel=NAMES[channel], joint=joint, first=start + a + 1,
               last=start + b, log=name)
        for start, (channel, joint, a, b), name in found
    ]  # fmt: skip
    columns = tuple(dict.fromkeys(f"{joint}.{kind}" for _, (kind, joint, *_), _ in found))
    rows = sum(b - a for _, (*_, a, b), _ in found)
    return [Finding("stopped", where=said, rows=rows, columns=columns)] if said else []


def find_stretches(log: Log) -> Iterator[tuple[str, str, int, int]]:
    """Yield channel, joint, first row and last (exclusive) of stretches in which a column hangs."""
    for channel in ("q", "tau"):
        values: Array = getattr(log, channel)
        resolution = smallest_change(values)
        moves = np.asarray((np.abs(np.diff(log.q, axis=0)) > 0).any(1))
        for k, joint in enumerate(log.joints):
            for a, b in _runs(values[:, k]):
                # Torque may rest with the robot, and jump when friction turns round.
                goes = channel == "q" or moves[a : b - 1].mean() > 0.5
                if goes and _jumps(values[:, k], a, b, float(resolution[k])):
                    yield channel, joint, a, b


def _runs(x: Array) -> list[tuple[int, int]]:
    """Return stretches [a, b) of equal values of x (N,) that are long enough."""
    edges = np.flatnonzero(np.concatenate([[True], np.diff(x) != 0, [True]]))
    long = np.flatnonzero(np.diff(edges) >= SHORTEST * LOG_RULES.repeats_longest)
    return [(int(edges[k]), int(edges[k + 1])) for k in long]


def _jumps(x: Array, a: int, b: int, resolution: float) -> bool:
    """Return whether x (N,) goes on after a stretch [a, b) as if it had moved meanwhile."""
    length = b - a
    if not resolution > 0 or length >= len(x) // 2:
        return False
    far = np.abs(x[length:] - x[:-length])
    near = np.abs(np.diff(x))
    usual = float(np.quantile(near, 0.9))
    # A stuck column usually changes by so many times its resolution over as many samples.
    if np.median(far) < 12.0 * resolution:
        return False
    leap = abs(x[b] - x[b - 1]) if b < len(x) else 0.0
    # When it goes on, it jumps so many times as far as usually in one sample.
    return bool(leap > 6.0 * max(usual, resolution))


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


@check("signs", Does.HINTS, always=True)
def find_turned_signs(logs: MeasuredLogs) -> list[Finding]:
    """Return where measured and smoothed velocity disagree in sign; nothing if noise is small."""
    turned = np.zeros(len(logs.joints))
    for s in logs.samples:
        motion = s.motion
        if motion.smooth_v is not None:
            apart = np.sign(motion.actuated_v) != np.sign(motion.smooth_v[:, 0])
            turned = np.maximum(turned, apart.mean(0))
    # Share of the samples at which noise turns the sign of a velocity that is said.
    at = [f"'{j}.dq'" for j, x in zip(logs.joints, turned, strict=True) if x > 0.01]
    return [Finding("signs", columns=at, share=float(turned.max()))] if at else []


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


@check("unheld", Does.MISREADS)
def find_unheld(logs: MeasuredLogs) -> list[Finding]:
    """Return what measured forces carry where no contact is closed; nothing if it is the robot."""
    robot, some = logs.robot, logs.motion
    fall = 0.0 if robot.base is None else float(np.linalg.norm(robot.base.gravity))
    if robot.base is None or not (fall and logs.weighs):
        return []
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    open_ = ~(closed > 0.5).any(1)
    # Fewest samples at which it is looked at whether the robot is held.
    held = open_ & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(32, open_.sum() / 2):
        return []
    needed = logs.predicted[held, :3]
    share = float((logs.torque[held, :3] * needed).sum() / (needed**2).sum())
    if share > 0.5:
        return []
    which = "wrenches" if robot.base.wrenches else "closed" if robot.base.contacts else "nothing"
    cause = phrase("unheld", "opposite" if share < -0.5 else "less")
    told = {"name": robot.name, "share": 100 * held.mean(), "held": 100 * share, "cause": cause}
    return [Finding("unheld", why=phrase("unheld", which, **told))]
