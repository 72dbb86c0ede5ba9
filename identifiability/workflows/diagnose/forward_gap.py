"""`ForwardGap`: how far simulated motion is from measured motion, before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Length of a simulated stretch [s].
HORIZON = 0.25


@frozen
class ForwardGap:
    """Position errors of simulated stretches of motion that was not fitted.

    Attributes
    ----------
    horizon : float [s]
    t : (S,) [s]
        Time since the start of a stretch.
    moved : (n,) [rad or m]
        Mean distance that each joint moved in a stretch.
    before, after : (K, S, n) [rad or m]
        Simulated less measured position; nan once a stretch has diverged.
    interval : (float, float)
        95 % of the change of the error, stretches drawn again and again.
    note : str
        Why there is nothing, where there is nothing.
    """

    horizon: float
    t: Array
    moved: Array
    before: Array
    after: Array
    interval: tuple[float, float] = (np.nan, np.nan)
    note: str = ""

    @staticmethod
    def none(note: str) -> ForwardGap:
        """Return the gap that was not measured, and why."""
        empty = np.empty((0, 0, 0))
        return ForwardGap(HORIZON, np.empty(0), np.empty(0), empty, empty, note=note)

    @property
    def measured(self) -> bool:
        """Whether there is a gap at all."""
        return len(self.before) > 0

    def shares(self) -> tuple[Array, Array]:
        """Return errors as a share of the distance moved, mean over joints, each (K, S).

        A stretch that has diverged counts as wrong by all of the distance.
        """
        before, after = (self._share(x).mean(2) for x in (self.before, self.after))
        return before, after

    def joint_shares(self) -> tuple[Array, Array]:
        """Return mean errors of each joint at the end of a stretch, each (n,)."""
        before, after = (self._share(x)[:, -1].mean(0) for x in (self.before, self.after))
        return before, after

    def _share(self, error: Array) -> Array:
        share: Array = np.nan_to_num(np.minimum(np.abs(error) / self.moved, 1.0), nan=1.0)
        return share

    @property
    def error_before(self) -> float:
        """Mean share at the end of a stretch, base model."""
        return float(self.shares()[0][:, -1].mean()) if self.measured else float("nan")

    @property
    def error_after(self) -> float:
        """The same with the named effects."""
        return float(self.shares()[1][:, -1].mean()) if self.measured else float("nan")

    @property
    def statement(self) -> str:
        """The gap in words."""
        if not self.measured:
            return ""
        before, after = 100 * self.error_before, 100 * self.error_after
        low, high = (100 * x for x in self.interval)
        return (
            f"Simulated forward for {self.horizon:.2g} s from measured states, positions are wrong "
            f"by {before:.2g} % of the distance moved before and {after:.2g} % after (95 %: "
            f"{low:+.2g} … {high:+.2g} points)."
        ).replace("-", "−")

    def to_dict(self) -> dict[str, Any]:
        """Return the gap for JSON."""
        return {
            "horizon": self.horizon,
            "stretches": len(self.before),
            "error_before": self.error_before,
            "error_after": self.error_after,
            "change_interval95": list(self.interval),
            "note": self.note,
        }
