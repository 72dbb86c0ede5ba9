"""Single wrong samples of a column, found among their neighbours, and angles that wrap around."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby

import numpy as np
from scipy.ndimage import grey_closing, grey_opening

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES

# Single wrong samples of a column: found among their neighbours, before anything is filtered.
#
# A filter smears a wrong torque over every output that draws on it, and two differences turn a
# wrong position into many wrong accelerations; so they are looked for in the raw column. A spike
# leaves the column and comes back within `spike_widest` samples. It stands above the opening of the
# column, or below its closing [Serra 1982], which steps, ramps and plateaus do not. It is wrong if
# it is also
#
# - higher than any step of the column where spikes are taken off: friction that reverses, a joint
#   at full speed, a repeated sample of it and a coarse encoder make steps;
# - higher than the spikes around it, of which noise, chatter and vibration make many;
# - far beyond the tail of the column's other spikes.


#: A wrong value, and the same repeated, lasts at most so many samples.
WIDEST = 3

#: Samples on each side that show how high spikes are here; the highest `ALLOWED` of both sides
#: may be wrong themselves.
NEAR, ALLOWED = 20, 3

#: The tail is one sample in so many, at least and at most so many samples; no more are mended.
TAIL_SHARE, TAIL_LEAST, TAIL_MOST = 2000, 20, 200

#: Samples that are judged by each other; the last so many and up to as many more together.
BLOCK = 65_536

#: Samples on each side that a judgement draws on, and the filters.
REACH, FILTERS = NEAR + 3 * WIDEST, 2 * WIDEST


@frozen
class Spike:
    """A wrong sample.

    Attributes
    ----------
    row : int
        Of the column.
    value, instead : float
        What it says, and what its neighbours say.
    """

    row: int
    value: float
    instead: float


class SpikeFinder:
    """Looks for wrong samples in a column that comes piece by piece; memory is bounded.

    Blocks of fixed rows are judged, so that what is found does not depend on the pieces.
    """

    def __init__(self) -> None:
        self._held, self._start = np.empty(0), 0  # what is not judged, with what is beside it
        self._judged = 0
        self._found: list[Spike] = []

    def add(self, values: Array) -> None:
        """Take in the next values, (N,)."""
        self._held = np.concatenate([self._held, values])
        while self._start + len(self._held) >= self._judged + 2 * BLOCK + REACH:
            self._judge(self._judged + BLOCK)

    def finish(self) -> list[Spike]:
        """Return the wrong samples in their order."""
        self._judge(None)
        return self._found

    def _judge(self, stop: int | None) -> None:
        """Judge the rows up to one, or all that are left."""
        last = None if stop is None else stop - self._start + REACH
        x = self._held[:last]
        for spike in _find(x, first=self._start == 0, last=stop is None):
            row = self._start + spike.row
            if row >= self._judged and (stop is None or row < stop):
                self._found.append(replace(spike, row=row))
        if stop is not None:
            drop = stop - REACH - self._start
            self._held, self._start, self._judged = self._held[drop:], self._start + drop, stop


def _find(x: Array, *, first: bool, last: bool) -> list[Spike]:
    """Return the wrong samples of a stretch of a column, (N,), which may be its first or last."""
    if len(x) <= 2 * FILTERS:
        return []
    before, after = (FILTERS if at else 0 for at in (first, last))
    inner = slice(before, before + len(x))
    wide = _extend(_extend(x, before)[::-1], after)[::-1]
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused later
        low, high = grey_opening(wide, 1 + WIDEST), grey_closing(wide, 1 + WIDEST)
        above, below = (wide - low)[inner], (high - wide)[inner]
        smooth = grey_closing(low, 1 + WIDEST)[inner]
        rough = np.abs(np.diff(x))
        step, span = np.abs(np.diff(smooth)).max(), float(np.ptp(smooth))
    height = np.maximum(above, below)
    size = int(np.clip(len(x) // TAIL_SHARE, TAIL_LEAST, TAIL_MOST))
    least = max(
        RULES.gap * float(step),
        RULES.spike * float(rough[rough > 0].min(initial=np.inf) if rough.any() else 0.0),
        RULES.spike * float(np.sort(height)[-1 - size] if len(x) > size else 0.0),
    )
    far = np.flatnonzero(height > least).tolist()
    found = [k for k in far if height[k] > RULES.spike * _usual(height, k)]
    # Consecutive samples on one side make one spike. Beside a high one, a right sample stands in a
    # hole that its neighbours do not show.
    wrong: set[int] = set()
    for _, group in groupby(enumerate(found), lambda e: (e[1] - e[0], above[e[1]] >= below[e[1]])):
        spike = [k for _, k in group]
        ends = (first and spike[0] == 0) or (last and spike[-1] == len(x) - 1)
        enough = max(least, span) if ends else least
        if any(abs(x[k] - _foretell(x, k, {*found})) > enough for k in spike):
            wrong |= {*spike}
    return [Spike(k, float(x[k]), _foretell(x, k, wrong)) for k in sorted(wrong)]


def _foretell(x: Array, k: int, wrong: set[int]) -> float:
    """Return the cubic through the nearest two right samples on each side, at a sample.

    At an end of the column it is the line through those on one side.
    """
    near = range(max(0, k - REACH), min(len(x), k + REACH + 1))
    right = [i - k for i in near if i not in wrong and np.isfinite(x[i])]
    nodes = [*[n for n in right if n < 0][-2:], *[n for n in right if n > 0][:2]]
    weights = [np.prod([m / (m - n) for m in nodes if m != n]) for n in nodes]
    return float(np.dot(weights, x[[k + n for n in nodes]]))


def _extend(x: Array, count: int) -> Array:
    """Return x with so many samples before it: the same ones turned around a robust mean."""
    if not count:
        return x
    middle = float(np.median(x[: count + 1]))
    return np.concatenate([2 * middle - x[count + 1 : 2 * count + 1][::-1], x])


def _usual(height: Array, k: int) -> float:
    """Return how high spikes are around a sample, without its own and the highest few."""
    low = max(0, min(k - NEAR, len(height) - 2 * NEAR - 1))
    around = np.arange(low, min(low + 2 * NEAR + 1, len(height)))
    others = np.sort(height[around[np.abs(around - k) > WIDEST]])
    return float(others[-1 - ALLOWED]) if len(others) > ALLOWED else np.inf


def find_spikes(values: Array) -> list[Spike]:
    """Return the wrong samples of a column (N,)."""
    finder = SpikeFinder()
    finder.add(values)
    return finder.finish()


def mend_column(values: Array, spikes: Iterable[Spike], start: int = 0) -> Array:
    """Return a stretch of a column, (N,) from row `start` on, with its wrong samples replaced."""
    inside = [s for s in spikes if start <= s.row < start + len(values)]
    if not inside:
        return values
    mended = values.copy()
    mended[[s.row - start for s in inside]] = [s.instead for s in inside]
    return mended


# Angles that were written within one turn: where they jump by a turn, the joint went on.
#
# A column is unwrapped if each of its large jumps is a whole turn but for what the joint usually
# moves in one sample, and if all of it lies within one turn; nothing else does so.


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
        # Positions are wrapped where they jump, and else change by at most this share of
        # half a turn from sample to sample.
        if not 0 < self._jumps <= MOST or self._usual > 0.25 * np.pi:
            return None
        if self._high - self._low > TURN + self._usual:
            return None
        steps = np.concatenate(self._steps)
        turns = -TURN * np.sign(steps)
        if (np.abs(steps + turns) > RULES.gap * self._usual + ROUNDOFF).any():
            return None
        return Wraps(np.concatenate(self._rows), turns)


def find_wraps(values: Array) -> Wraps | None:
    """Return the jumps of a column (N,) [rad], if they are turns."""
    finder = WrapFinder()
    finder.add(values)
    return finder.finish()
