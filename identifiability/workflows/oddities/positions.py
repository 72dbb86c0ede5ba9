"""What is odd about positions: beyond the limits of the robot file, or a reading that hung."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.gaps import NAMES, smallest_change
from identifiability.logs.mend import looks_like_degrees
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check

# Positions beyond the limits of the robot file: another unit, zero, sign or joint.


TURN = 2 * np.pi


@check(
    "beyond limits",
    Does.HINTS,
    21,
    says="Positions leave the limits of the robot file: …",
    means="The zero, the direction or the unit of a position is another one than the file's.",
    do="`--set angles=deg`, another zero (`[columns] elbow = {offset = 1.57}` in the sidecar), "
    "or better limits in the file.",
)
def find_beyond_limits(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on positions beyond the limits that no whole turn explains, or none."""
    robot, said = logs.robot, []
    for k, joint in enumerate(logs.joints):
        low, high = robot.limits[k]
        q = logs.motion.actuated_q[:, k]
        turns = not robot.is_prismatic(int(robot.actuated[k]))
        if not np.isfinite(high - low) or not _outside(q, low, high, turns=turns):
            continue
        why = ""
        if turns and robot.angles is None and looks_like_degrees(q, low, high):
            why = " (in degrees it would not)"
        elif not _outside(-q, low, high, turns=turns):
            why = " (with the other sign it would not)"
        said.append(
            f"'{joint}.q' spans {q.min():.4g} … {q.max():.4g}, beyond {low:.4g} … {high:.4g}{why}"
        )
    if not said:
        return ()
    return (
        f"Positions leave the limits of the robot file: {listing(said, 3)}. Check the zero, the "
        "direction and the unit of the column (--set angles=deg reads degrees), or the "
        "file's limits.",
    )


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


@check(
    "hung",
    Does.HINTS,
    22,
    says="A column repeats one value and then jumps, although the robot goes on (…)",
    means="A sensor or its bus stopped for a moment (a stuck sensor); the robot did not.",
    do="Cut these rows out and give the parts as two logs.",
)
def find_hung(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on stretches in which columns hang, or none."""
    said = [
        f"{NAMES[channel]} of {joint} in data rows {start + a + 1}–{start + b} of {log.name}"
        for start, log in logs.windows()
        for channel, joint, a, b in find_stretches(log)
    ]
    if not said:
        return ()
    return (
        f"A column repeats one value and then jumps, although the robot goes on ({listing(said, 4)}"
        "): the reading stood still; cut these rows out, splitting the log there.",
    )


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
