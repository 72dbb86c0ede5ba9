"""Single wrong samples of a column, found among their neighbours, and angles that wrap around."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby

import numpy as np

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

#: Samples that are looked at together.
PIECE = 16_384

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


@frozen
class Candidate:
    """A spike that stands out from those around it.

    Attributes
    ----------
    row : int
    height : float
        Above the opening of the column; negative below its closing.
    around : (2 REACH + 1,)
        The column around it; NaN beyond its ends.
    """

    row: int
    height: float
    around: Array

    def predict(self, wrong: set[int]) -> float:
        """Return the cubic through the nearest two right samples on each side, at this one.

        At an end of the column it is the line through those on one side.
        """
        offset = np.arange(-REACH, REACH + 1)
        right = np.isfinite(self.around) & [self.row + k not in wrong for k in offset]
        nodes = np.array([*offset[right & (offset < 0)][-2:], *offset[right & (offset > 0)][:2]])
        weights = [np.prod([m / (m - n) for m in nodes if m != n]) for n in nodes]
        return float(np.dot(weights, self.around[nodes + REACH]))


class SpikeFinder:
    """Looks for wrong samples in a column that comes piece by piece; memory is bounded.

    What is found does not depend on the pieces.
    """

    def __init__(self) -> None:
        self._held: list[Array] = []
        self._waiting = 0
        self._start = self._judged = 0  # row of the first that is held, and is to be judged
        self._step, self._finest = 0.0, np.inf
        self._low, self._high = np.inf, -np.inf
        self._tail = np.zeros(TAIL_MOST + 1)
        self._found: list[Candidate] = []

    def add(self, values: Array) -> None:
        """Take in the next values, (N,)."""
        self._held.append(values)
        self._waiting += len(values)
        if self._waiting >= PIECE:
            self._judge(last=False)

    def finish(self) -> list[Spike]:
        """Return the wrong samples in their order."""
        if self._waiting + self._start > FILTERS:
            self._judge(last=True)
        size = int(np.clip(self._judged // TAIL_SHARE, TAIL_LEAST, TAIL_MOST))
        finest = self._finest if self._finest < np.inf else 0.0
        least = max(
            self._least,
            RULES.spike_around * finest,
            RULES.spike_tail * float(self._tail[-1 - size]),
        )
        found = sorted((c for c in self._found if abs(c.height) > least), key=lambda c: c.row)
        # Consecutive samples on one side make one spike. Beside a high one, a right sample stands
        # in a hole that its neighbours do not show.
        every = {c.row for c in found}
        wrong: dict[int, Candidate] = {}
        for _, group in groupby(enumerate(found), lambda e: (e[1].row - e[0], e[1].height > 0)):
            spike = [c for _, c in group]
            returns = spike[0].row > 0 and spike[-1].row < self._judged - 1
            enough = least if returns else max(least, self._high - self._low)
            if any(abs(c.around[REACH] - c.predict(every)) > enough for c in spike):
                wrong |= {c.row: c for c in spike}
        return [Spike(row, float(c.around[REACH]), c.predict({*wrong})) for row, c in wrong.items()]

    @property
    def _least(self) -> float:
        """Height that none but wrong spikes reach, by what is known so far."""
        return max(RULES.spike_steps * self._step, RULES.spike_tail * float(self._tail[0]))

    def _judge(self, *, last: bool) -> None:
        x = np.concatenate(self._held)
        first = self._start == 0
        ready = self._start + len(x) - (0 if last else REACH)
        before, after = (FILTERS if at else 0 for at in (first, last))
        inner = slice(before, before + len(x))
        wide = _extend(_extend(x, before)[::-1], after)[::-1]
        with np.errstate(invalid="ignore", over="ignore"):  # what is no number is refused later
            low, high = _open(wide), _close(wide)
            above, below = (wide - low)[inner], (high - wide)[inner]
            smooth = _close(low)[inner]
            steps = np.abs(np.diff(smooth))
            rough = np.abs(np.diff(x))
        rough[~(rough > 0)] = np.inf
        height = np.maximum(above, below)
        own = slice(self._judged - self._start, ready - self._start)
        # The step before the first own sample was counted with the piece before, if there is one.
        counted = slice(max(own.start - 1, 0), own.stop - 1)
        self._step = max(self._step, float(steps[counted].max(initial=0.0)))
        self._low = min(self._low, float(smooth[own].min(initial=np.inf)))
        self._high = max(self._high, float(smooth[own].max(initial=-np.inf)))
        self._finest = min(self._finest, float(rough.min(initial=np.inf)))
        higher = height[own][~(height[own] <= self._tail[0])]  # soon few
        self._tail = np.sort(np.concatenate([self._tail, higher]))[-TAIL_MOST - 1 :]
        for k in own.start + np.flatnonzero(height[own] > self._least):
            if height[k] > RULES.spike_around * _usual(height, int(k)):
                sign = 1.0 if above[k] >= below[k] else -1.0
                self._keep(x, int(k), sign * float(height[k]))
        self._judged = ready
        if not last:
            drop = max(0, ready - REACH - self._start)
            self._start, self._held, self._waiting = self._start + drop, [x[drop:]], 0

    def _keep(self, x: Array, k: int, height: float) -> None:
        around = np.full(2 * REACH + 1, np.nan)
        low, high = max(0, k - REACH), min(len(x), k + REACH + 1)
        around[low - k + REACH : high - k + REACH] = x[low:high]
        self._found.append(Candidate(self._start + k, height, around))
        if len(self._found) > 2 * TAIL_MOST:
            self._found = sorted(self._found, key=lambda c: (-abs(c.height), c.row))[:TAIL_MOST]


def _extend(x: Array, count: int) -> Array:
    """Return x with so many samples before it: the same ones turned around a robust mean."""
    if not count:
        return x
    middle = float(np.median(x[: count + 1]))
    return np.concatenate([2 * middle - x[count + 1 : 2 * count + 1][::-1], x])


def _open(x: Array) -> Array:
    """Return x (N,) without what rises for up to `spike_widest` samples."""
    return _spread(_spread(x, np.minimum), np.maximum, back=True)


def _close(x: Array) -> Array:
    """Return x (N,) without what falls for up to `spike_widest` samples."""
    return _spread(_spread(x, np.maximum), np.minimum, back=True)


def _spread(x: Array, extreme: np.ufunc, *, back: bool = False) -> Array:
    """Return the extreme of each sample and the `spike_widest` after it, or before it."""
    seen = 1
    while seen <= WIDEST:  # the extreme of two such extremes is that of up to twice as many
        k = min(seen, WIDEST + 1 - seen)
        out, inner = np.empty_like(x), slice(k, None) if back else slice(-k)
        extreme(x[k:], x[:-k], out=out[inner])
        ends = slice(k) if back else slice(-k, None)
        out[ends] = x[ends]
        x, seen = out, seen + k
    return x


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
        if (np.abs(steps + turns) > RULES.spike_steps * self._usual + ROUNDOFF).any():
            return None
        return Wraps(np.concatenate(self._rows), turns)
