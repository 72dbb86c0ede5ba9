"""Angles that were written within one turn: where they jump by a turn, the joint went on.

A column is unwrapped if each of its large jumps is a whole turn but for what the joint usually
moves in one sample, and if all of it lies within one turn; nothing else does so.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

TURN = 2 * np.pi

#: Jumps that a column may have, at most; a column of noise has more.
MOST = 100_000


@frozen
class Wraps:
    """Where a column jumps by a turn.

    Attributes
    ----------
    rows : (k,) int
        First row after each jump.
    turns : (k,) [rad]
        What is added from there on.
    """

    rows: np.ndarray
    turns: Array

    def undo(self, values: Array, start: int = 0) -> Array:
        """Return a stretch of the column, (N,) from row `start` on, without jumps."""
        total = np.concatenate([[0.0], np.cumsum(self.turns)])
        at = np.searchsorted(self.rows, start + np.arange(len(values)), side="right")
        whole: Array = values + total[at]
        return whole


class WrapFinder:
    """Looks for jumps by a turn in a column that comes piece by piece."""

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []
        self._steps: list[Array] = []
        self._count = self._jumps = 0
        self._last = np.empty(0)
        self._usual = 0.0
        self._low, self._high = np.inf, -np.inf

    def add(self, values: Array) -> None:
        """Take in the next values, (N,) [rad]."""
        start = self._count - len(self._last)
        x = np.concatenate([self._last, values])
        self._count, self._last = start + len(x), x[-1:]
        if not len(values) or self._jumps > MOST:
            return
        self._low = min(self._low, float(values.min()))
        self._high = max(self._high, float(values.max()))
        steps = np.diff(x)
        far = np.abs(steps) > np.pi
        self._usual = max(self._usual, float(np.abs(steps[~far]).max(initial=0.0)))
        self._jumps += int(far.sum())
        self._rows.append(start + 1 + np.flatnonzero(far))
        self._steps.append(steps[far])

    def finish(self) -> Wraps | None:
        """Return the jumps, or None if there are none or they are no turns."""
        if not 0 < self._jumps <= MOST or self._usual > np.pi / 4:
            return None
        if self._high - self._low > TURN + self._usual:
            return None
        steps = np.concatenate(self._steps)
        turns = -TURN * np.sign(steps)
        if (np.abs(steps + turns) > 1.5 * self._usual + 1e-9).any():
            return None
        return Wraps(np.concatenate(self._rows), turns)
