"""Single wrong samples of a column, found among their neighbours, and angles that wrap around."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np
import scipy

from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

from .rows import PIECE, divide_rows, find_range, forget
from .rules import RULES

# Single wrong samples of a column: compare each with its neighbours, before any filter.
#
# A filter spreads a wrong torque over all outputs that use it. Two differences turn a wrong
# position into many wrong accelerations. So the raw column is searched. A spike leaves the column
# and comes back within `spike_widest` samples. It is above the opening of the column, or below its
# closing [Serra 1982]; steps, ramps and plateaus are not. It is wrong if it is also
#
# - higher than any step of the column without spikes: reversing friction, a joint at full speed, a
#   repeated sample of it and a coarse encoder make steps;
# - higher than the spikes around it: noise, chatter and vibration make many;
# - far beyond the tail of the column's other spikes.


#: Most consecutive samples of a wrong value, and of its repetitions.
WIDEST = 3

#: Samples on each side that show how high spikes are here; the highest `ALLOWED` of both sides
#: may be wrong themselves.
NEAR, ALLOWED = 20, 3

#: The tail is one sample in TAIL_SHARE, at least TAIL_LEAST and at most TAIL_MOST samples; no more
#: are corrected.
TAIL_SHARE, TAIL_LEAST, TAIL_MOST = 2000, 20, 200

#: Samples on each side that a judgement draws on, and the filters.
REACH, FILTERS = NEAR + 3 * WIDEST, 2 * WIDEST


@frozen
class Spike:
    """An outlying sample.

    Attributes
    ----------
    row : int
        Row in the column.
    value, instead : float
        The measured value, and the interpolated one.
    """

    row: int
    value: float
    instead: float


def find_spikes(x: Array) -> list[Spike]:
    """Return the wrong samples of a column (N,) in their order; blocks of it are judged."""
    found = []
    # The last block has up to twice as many samples.
    last = len(x) - PIECE - REACH + 1
    stops = [*range(PIECE, last, PIECE), len(x)]
    for a, b in pairwise([0, *stops]):
        low = max(0, a - REACH)
        near = _find(
            x[low : b + REACH],
            first=a == 0,
            last=b == len(x),
        )
        found += [replace(s, row=low + s.row) for s in near if a <= low + s.row < b]
        forget()
    return found


def _find(x: Array, *, first: bool, last: bool) -> list[Spike]:
    """Return the wrong samples of a stretch of a column, (N,), which may be its first or last."""
    if len(x) <= 2 * FILTERS:
        return []
    before, after = (FILTERS if at else 0 for at in (first, last))
    inner = slice(before, before + len(x))
    wide = _extend(_extend(x, before)[::-1], after)[::-1]
    with np.errstate(invalid="ignore", over="ignore"):  # other values are refused later
        low = scipy.ndimage.grey_opening(wide, 1 + WIDEST)
        high = scipy.ndimage.grey_closing(wide, 1 + WIDEST)
        above = (wide - low)[inner]
        below = (high - wide)[inner]
        smooth = scipy.ndimage.grey_closing(low, 1 + WIDEST)[inner]
        rough = np.abs(np.diff(x))
        step = np.abs(np.diff(smooth)).max()
        span = float(np.ptp(smooth))
    height = np.maximum(above, below)
    size = int(np.clip(len(x) // TAIL_SHARE, TAIL_LEAST, TAIL_MOST))
    of_noise = RULES.spike * float(rough[rough > 0].min(initial=np.inf) if rough.any() else 0.0)
    of_height = RULES.spike * float(np.sort(height)[-1 - size] if len(x) > size else 0.0)
    least = max(
        RULES.gap * float(step),
        of_noise,
        of_height,
    )
    far = np.flatnonzero(height > least).tolist()
    found = [k for k in far if height[k] > RULES.spike * _usual(height, k)]
    # Consecutive samples on one side make one spike. Next to a high spike, a valid sample looks
    # like a hole, which its neighbours do not show.
    wrong = set()
    for _, group in groupby(enumerate(found), lambda e: (e[1] - e[0], above[e[1]] >= below[e[1]])):
        spike = [k for _, k in group]
        ends = (first and spike[0] == 0) or (last and spike[-1] == len(x) - 1)
        enough = max(least, span) if ends else least
        if any(abs(x[k] - _foretell(x, k, {*found})) > enough for k in spike):
            wrong |= {*spike}
    return [Spike(k, float(x[k]), _foretell(x, k, wrong)) for k in sorted(wrong)]


def _foretell(x: Array, k: int, wrong: set[int]) -> float:
    """Return the cubic interpolation at a sample, from two valid samples on each side.

    At an end of the column it is linear extrapolation from one side.
    """
    near = range(max(0, k - REACH), min(len(x), k + REACH + 1))
    right = [i - k for i in near if i not in wrong and np.isfinite(x[i])]
    before = [n for n in right if n < 0][-2:]
    after = [n for n in right if n > 0][:2]
    nodes = [*before, *after]
    weights = [np.prod([m / (m - n) for m in nodes if m != n]) for n in nodes]
    return float(np.dot(weights, x[[k + n for n in nodes]]))


def _extend(x: Array, count: int) -> Array:
    """Return x with `count` more samples at its start, reflected at a robust mean."""
    if not count:
        return x
    middle = float(np.median(x[: count + 1]))
    mirrored = 2 * middle - x[count + 1 : 2 * count + 1][::-1]
    return np.concatenate([mirrored, x])


def _usual(height: Array, k: int) -> float:
    """Return the usual height of spikes around a sample, without the highest few."""
    low = max(0, min(k - NEAR, len(height) - 2 * NEAR - 1))
    around = np.arange(low, min(low + 2 * NEAR + 1, len(height)))
    others = np.sort(height[around[np.abs(around - k) > WIDEST]])
    if len(others) > ALLOWED:
        return float(others[-1 - ALLOWED])
    return np.inf


def mend_column(values: Array, spikes: Iterable[Spike], start: int = 0) -> Array:
    """Return a stretch of a column, (N,) from row `start` on, with its wrong samples replaced."""
    inside = [s for s in spikes if start <= s.row < start + len(values)]
    if not inside:
        return values
    mended = values.copy()
    mended[[s.row - start for s in inside]] = [s.instead for s in inside]
    return mended


# Angles within one turn: a jump by a turn means that the joint moved on.
#
# A column is unwrapped if each of its large jumps is a full turn, up to the usual motion of the
# joint in one sample, and if all of it lies within one turn. No other column has these properties.


TURN = 2 * np.pi


@frozen
class Wraps:
    """The jumps of a column by full turns.

    Attributes
    ----------
    rows : (k,) int
        First row after each jump.
    turns : (k,) [rad]
        Angle that is added from there on.
    """

    rows: Array
    turns: Array

    def undo(self, values: Array, start: int = 0) -> Array:
        """Return a stretch of the column, (N,) from row `start` on, without jumps."""
        total = np.concatenate([[0.0], np.cumsum(self.turns)])
        at = np.searchsorted(self.rows, start + np.arange(len(values)), side="right")
        return values + total[at]


def find_wraps(x: Array) -> Wraps | None:
    """Return the jumps of a column (N,) [rad], if they are turns."""
    rows = []
    usual = 0.0
    for a, b in divide_rows(len(x) - 1):
        steps = np.abs(np.diff(x[a : b + 1]))
        rows.append(a + 1 + np.flatnonzero(steps > np.pi))
        within = steps[steps <= np.pi]
        usual = max(usual, float(within.max(initial=0.0)))
    at = np.concatenate(rows)
    low, high = find_range(x)
    # Positions are wrapped where they jump, and else change by at most this share of half a turn
    # from sample to sample.
    if not len(at) or usual > 0.25 * np.pi or high - low > TURN + usual:
        return None
    steps = x[at] - x[at - 1]
    turns = -TURN * np.sign(steps)
    if (np.abs(steps + turns) > RULES.gap * usual + ROUNDOFF).any():
        return None
    return Wraps(at, turns)
