"""Torque that stops at an extreme value: what a drive was asked for beyond it is not in the log."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.logs.stale import smallest_change
from identifiability.workflows.oddities.evidence import Evidence

#: An extreme value is a flat top if the column stays there this often in all, and this long once.
SHARE, RUN = 0.005, 4

#: … and is met so many times as often as the next band of the same width.
CROWDED = 6.0

#: Width of the bands, of the column's range.
BAND = 0.01


def find_saturation(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on torque columns with flat tops, or none."""
    found: dict[str, tuple[float, float]] = {}
    for _, log in evidence.windows():
        moves = np.append(np.abs(np.diff(log.q, axis=0)).max(1, initial=0.0) > 0, True)
        for k, joint in enumerate(log.joints):
            column = log.tau[moves, k]
            for side in (1.0, -1.0):
                share = flat_share(side * column)
                if share > found.get(joint, (0.0, 0.0))[0]:
                    found[joint] = share, side * float((side * column).max())
    if not found:
        return ()
    said = [
        f"'{joint}.tau' stays at {value:.4g} in {100 * share:.2g} % of the samples"
        for joint, (share, value) in found.items()
    ]
    return (
        f"Torque stops at an extreme value ({listing(said, 4)}): a drive or sensor at its limit; "
        "what it should have been is not in the log, so leave these stretches out or move less "
        "fast.",
    )


def flat_share(x: Array) -> float:
    """Return which share of a column (N,) lies on a flat top, 0 if it has none."""
    if not len(x) or not np.ptp(x) > 0:
        return 0.0
    top, width = float(x.max()), float(np.ptp(x))
    step = float(smallest_change(x[:, None])[0])
    at = x >= top - 0.5 * min(step, BAND * width)
    share = float(at.mean())
    band = max(BAND * width, 1.5 * step)
    below = np.count_nonzero((x >= top - band) & ~at) / len(x)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
    longest = int((edges[1::2] - edges[::2]).max())
    flat = share >= SHARE and longest >= RUN and share > CROWDED * below
    return share if flat else 0.0
