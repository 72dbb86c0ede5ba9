"""`Survey`: what there is to know of a prepared log as a whole; parts of a log add up.

Here it is said once whether logs have anything to explain (`find_signal`, `explain_silence`):
ε_RA has no denominator where they have not, and nothing is fitted to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import is_constant, never_moves
from identifiability.robot import Motion

#: Rows of a log, from the first to the last (exclusive).
Rows = tuple[int, int]

#: Why torque has no weight.
DWELLS = (
    "torque of a joint that stands has no weight, as dry friction may be anything up to its level "
    "there"
)

#: Rows that a note lists.
LISTED = 5


@frozen
class Survey:
    """Counts, ranges and sums over a log.

    Attributes
    ----------
    kept, outputs : int
        Samples that were prepared, and left after decimation.
    dropped : int
        Samples at which the loops do not close.
    first_dropped : tuple of int
        The first of their rows.
    singular : int
        Samples near a singular configuration.
    first_singular : tuple of int
        The first of their rows, if any.
    condition : float
        Largest condition number of the closure (1 for an open chain).
    start, stop : float [s]
        Times of the first and the last sample; NaN without any.
    low, high : (3, n)
        Ranges of position, velocity and acceleration of the actuated joints.
    torque : (n,) [N·m or N]
        Sum of the measured torque over the outputs.
    torque_range : (2, n) [N·m or N]
        Its smallest and its largest value.
    lost : int
        Samples that were left out because they lie beside a gap.
    rows : (n,) int
        Outputs at which torque of each joint is data: it does not dwell there.
    """

    kept: int
    outputs: int
    dropped: int
    first_dropped: tuple[int, ...]
    singular: int
    first_singular: tuple[int, ...]
    condition: float
    start: float
    stop: float
    low: Array
    high: Array
    torque: Array
    torque_range: Array
    lost: int = 0
    rows: np.ndarray = field(default_factory=lambda: np.zeros(1, int))

    @staticmethod
    def of(motion: Motion, own: Rows | None, outputs: int, torque: Array, span: Array) -> Survey:
        """Return the survey of a motion, or of those of its rows that are its own."""
        inside = slice(None) if own is None else slice(*np.searchsorted(motion.kept, own))
        dropped, near = _inside(motion.dropped, own), _inside(motion.near_singular, own)
        t = motion.t[inside]
        parts = [x[inside] for x in (motion.actuated_q, motion.actuated_v, motion.actuated_a)]
        return Survey(
            kept=len(t),
            outputs=outputs,
            dropped=len(dropped),
            first_dropped=tuple(dropped[:LISTED].tolist()),
            singular=len(near),
            first_singular=tuple(near[:1].tolist()),
            condition=motion.condition,
            start=float(t[0]) if len(t) else np.nan,
            stop=float(t[-1]) if len(t) else np.nan,
            low=np.stack([x.min(0, initial=np.inf) for x in parts]),
            high=np.stack([x.max(0, initial=-np.inf) for x in parts]),
            torque=torque,
            torque_range=span,
            rows=np.full(len(torque), outputs),
        )

    def __add__(self, later: Survey) -> Survey:
        """Return the survey of both, this one first in time."""
        counts: dict[str, Any] = {
            name: getattr(self, name) + getattr(later, name)
            for name in ("kept", "outputs", "dropped", "singular", "torque", "lost", "rows")
        }
        (low, high), (later_low, later_high) = self.torque_range, later.torque_range
        return Survey(
            **counts,
            first_dropped=(*self.first_dropped, *later.first_dropped)[:LISTED],
            first_singular=(*self.first_singular, *later.first_singular)[:1],
            condition=max(self.condition, later.condition),
            start=later.start if np.isnan(self.start) else self.start,
            stop=self.stop if np.isnan(later.stop) else later.stop,
            low=np.minimum(self.low, later.low),
            high=np.maximum(self.high, later.high),
            torque_range=np.stack([np.minimum(low, later_low), np.maximum(high, later_high)]),
        )

    def notes(self, total: int) -> list[str]:
        """Return what happened to the samples of a log with `total` of them, for the report."""
        notes = []
        if self.dropped:
            first = ", ".join(str(k + 1) for k in self.first_dropped)
            more = " …" if self.dropped > LISTED else ""
            notes.append(
                f"{self.dropped} of {total} samples were dropped because the loops do not close "
                f"there (data rows {first}{more})"
            )
        if self.singular:
            notes.append(
                f"{self.singular} samples lie near a singular configuration (first in data row "
                f"{self.first_singular[0] + 1}, condition number up to {self.condition:.1e}); "
                "torques there are amplified errors"
            )
        if self.lost:
            notes.append(f"{self.lost} of {total} samples beside long gaps were left out")
        return notes

    def dwells(self, joints: Sequence[str]) -> list[str]:
        """Return at which joints how much torque has no weight, for the report."""
        shares = 1 - self.rows / max(self.outputs, 1)
        told = [f"{j} {100 * s:.3g} %" for j, s in zip(joints, shares, strict=True) if s > 0]
        return [f"{DWELLS}: {', '.join(told)} of the time"] if told else []


def stands_still(surveys: Sequence[Survey]) -> np.ndarray:
    """Return which actuated joints are at one place in these logs, (n,) bool."""
    low = np.min([s.low[0] for s in surveys], axis=0)
    high = np.max([s.high[0] for s in surveys], axis=0)
    return never_moves(low, high)


def robot_moves(surveys: Sequence[Survey]) -> bool:
    """Return whether any actuated joint is at two places in these logs."""
    return not stands_still(surveys).all()


def torque_varies(surveys: Sequence[Survey]) -> np.ndarray:
    """Return at which actuated joints the measured torque changes in these logs, (n,) bool."""
    low = np.min([s.torque_range[0] for s in surveys], axis=0)
    high = np.max([s.torque_range[1] for s in surveys], axis=0)
    return ~is_constant(low, high)


def find_signal(surveys: Sequence[Survey]) -> np.ndarray:
    """Return at which actuated joints logs have something to explain, (n,) bool.

    The robot moves, and the torque of that joint changes.
    """
    return torque_varies(surveys) & robot_moves(surveys)


def explain_silence(surveys: Sequence[Survey]) -> str:
    """Return why logs have nothing to explain, for after "because"; nothing if they have."""
    if not robot_moves(surveys):
        return "the robot does not move in these logs"
    if not torque_varies(surveys).any():
        return "the measured torque never changes in these logs"
    return ""


def _inside(rows: np.ndarray, own: Rows | None) -> np.ndarray:
    return rows if own is None else rows[(rows >= own[0]) & (rows < own[1])]
