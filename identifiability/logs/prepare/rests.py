"""When does a robot stand still? Friction may then be anything up to its Coulomb level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import WINDOW, bandwidth_of_windows, never_moves

#: A joint slower than this share of its largest speed stands still.
REST_SPEED = 0.01


@frozen
class RestRule:
    """When all joints stand still.

    Attributes
    ----------
    limit : (n,)
        Speed below which a joint stands still.
    least : float [samples]
        Only stops that last longer count; shorter ones are reversals.
    """

    limit: Array
    least: float

    @property
    def reach(self) -> int:
        """Samples on each side that decide whether a sample belongs to a rest."""
        return int(self.least) + 2

    def find(self, dq: Array) -> np.ndarray:
        """Return where all joints stand still, (N,) bool."""
        still: np.ndarray = np.all(np.abs(dq) <= self.limit, axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            still[start:stop] = stop - start > self.least
        return still


def choose_rest_rule(q: Sequence[Array], dq: Sequence[Array], dt: float) -> RestRule | None:
    """Return what counts as standing still; None where a motion never does, or always.

    A joint stands still below `REST_SPEED` times its largest speed. Only stops that last longer
    than half a period of the fastest motion count (and none that is longer than `WINDOW`).

    Parameters
    ----------
    q, dq : sequences of (N, n)
        Windows of equal length.
    dt : float [s]
    """
    high, low = np.max([x.max(0) for x in q], axis=0), np.min([x.min(0) for x in q], axis=0)
    speed = np.max([np.abs(x).max(0) for x in dq], axis=0)
    # A joint that never moves has no largest speed to compare with.
    limit = REST_SPEED * np.where(never_moves(low, high), np.inf, speed)
    still = [np.all(np.abs(x) <= limit, axis=1) for x in dq]
    if all(s.all() for s in still):
        return None
    least = 0.5 / max(bandwidth_of_windows(q, dt) * dt, 1e-300)
    return RestRule(limit, min(least, float(WINDOW)))
