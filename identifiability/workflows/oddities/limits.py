"""Positions beyond the limits of the robot file: another unit, zero, sign or joint."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.logs.units import looks_like_degrees
from identifiability.workflows.oddities.evidence import Evidence

#: Share of the samples that must lie outside, by this share of the allowed range.
OUTSIDE, MARGIN = 0.2, 0.05

TURN = 2 * np.pi


def find_beyond_limits(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on positions beyond the limits that no whole turn explains, or none."""
    robot, said = evidence.robot, []
    for k, joint in enumerate(evidence.joints):
        low, high = robot.limits[k]
        q = evidence.motion.actuated_q[:, k]
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
        "direction and the unit of the column (--angles deg reads degrees), or the file's limits.",
    )


def _outside(q: Array, low: float, high: float, *, turns: bool) -> bool:
    """Return whether positions (N,) lie outside of limits, whole turns aside."""
    if turns:
        q = q - TURN * round((float(np.median(q)) - 0.5 * (low + high)) / TURN)
    margin = MARGIN * (high - low)
    return bool(np.mean((q < low - margin) | (q > high + margin)) > OUTSIDE)
