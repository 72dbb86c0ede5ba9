"""Missing samples: repeated because no new value had arrived, or lost.

Steps of a clock are classified as gaps. Short gaps are bridged, and long ones split a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import Fields, frozen

from . import signals
from .checks import Clock
from .log import Log
from .rules import RULES

# Repeated samples: no new value had arrived when a row was written.
#
# Robots and loggers have separate clocks, so some rows repeat the row before. Half a step of motion
# is then missing at one sample, and differences show a jump. Such values are recognised by the
# motion before and after, and interpolated.


#: Names of channels.
NAMES = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}


@frozen
class StaleRule:
    """Thresholds for repeated values, by channel.

    Attributes
    ----------
    steps : dict of str to (n,)
        Smallest change of every joint's value: the step of its encoder, or nearly zero.
    share : dict of str to float
        Share of the samples that repeat the previous one, if there are any.
    """

    steps: dict[str, Array]
    share: dict[str, float]

    @staticmethod
    def of(windows: Sequence[Log]) -> StaleRule:
        """Return the rule for a log, from windows of it."""
        steps = {}
        share = {}
        for channel in (c for c in windows[0].channels if c in NAMES):
            values = [np.asarray(getattr(w, channel)) for w in windows]
            steps[channel] = np.min([smallest_change(x) for x in values], axis=0)
            shares = [find_stale(x, steps[channel]).mean() for x in values]
            found = float(np.mean(shares))
            if found > 0:
                share[channel] = found
        return StaleRule(steps, share)

    def mend(self, log: Log) -> Log:
        """Return a log with repeated values interpolated."""
        changed: Fields = {}
        for channel in self.share:
            x = np.asarray(getattr(log, channel))
            changed[channel] = interpolate(x, find_stale(x, self.steps[channel]))
        return replace(log, **changed) if changed else log

    @property
    def note(self) -> str:
        """Return the report's note on repeated values; empty if there are none."""
        found = [
            phrase(
                "repeated",
                "part",
                name=NAMES[c],
                share=s,
            )
            for c, s in self.share.items()
        ]
        if found:
            return Finding("repeated", channels=", ".join(found))
        return ""


def smallest_change(x: Array) -> Array:
    """Return the smallest change between samples of x (N, n), (n,); 0 if nothing changes."""
    change = np.abs(np.diff(x, axis=0))
    found = np.where(change > 0, change, np.inf).min(0, initial=np.inf)
    return np.where(np.isfinite(found), found, 0.0)


def find_stale(x: Array, steps: Array) -> Array:
    """Return which samples of x (N, n) repeat the one before although a joint moves, (N,) bool.

    A joint moves if it went the same way before and after, by `repeats_steps` encoder steps or more
    across the repeated samples.
    """
    stale = np.zeros(len(x), bool)
    stands = (np.diff(x, axis=0) == 0).all(1)
    same = np.concatenate([[False], stands, [False]])
    edges = np.diff(same.astype(int))
    first = np.flatnonzero(edges == 1) + 1
    last = np.flatnonzero(edges == -1)
    for a, b in zip(first.tolist(), last.tolist(), strict=True):
        # Rows a … b repeat row a - 1.
        if b - a >= RULES.lost or a < 2 or b + 1 >= len(x):
            continue
        after = x[b + 1] - x[b]
        before = x[a - 1] - x[a - 2]
        # Least motion across a run of repeated values, in steps of the encoder; else rounding
        # explains the run.
        moved = (after * before > 0) & (np.abs(after) >= 4.0 * steps)
        stale[a : b + 1] = moved.any()
    return stale


def interpolate(x: Array, stale: Array) -> Array:
    """Return x (N, …) with stale samples (N,) bool on the cubic through their four neighbours."""
    good = np.flatnonzero(~stale)
    out = x.copy()
    at = np.flatnonzero(stale)
    if not len(at) or len(good) < 4:
        return out
    out[at] = signals.cubic(at, good, x[good])
    return out


# Lost samples: find gaps in the steps of a clock, bridge short ones, split the log at others.
#
# A filter and two differences need samples at even steps. Samples that are nowhere farther apart
# than half a period of the cut-off determine the filtered signal, so a cubic bridges such gaps.
# Nothing is computed across a longer gap: the log is split into stretches, each filtered and
# differentiated by itself.


@frozen
class Gaps:
    """The steps of a log between which samples are missing.

    Attributes
    ----------
    name : str
        Name of the log.
    step : float [s]
        The usual step.
    usual : float
        95 % quantile of the deviation of steps without a gap, as a share of the usual step.
    jitter : float
        Largest deviation of steps without a gap, as a share of the usual step.
    rows : (m,) int
        Rows after which samples are missing.
    t : (m,) [s]
        Their times.
    length : (m,) [s]
        Length of the gap.
    drift : float
        Relative difference of the mean of the other steps from the usual step.
    """

    name: str
    step: float
    usual: float
    jitter: float
    rows: Array
    t: Array
    length: Array
    drift: float = 0.0

    @staticmethod
    def of(name: str, clock: Clock, windows: Sequence[Array]) -> Gaps:
        """Return the gaps of a log.

        Parameters
        ----------
        name : str
        clock : Clock
            Of the whole log.
        windows : sequence of (N,) [s]
            Times in windows of it, where the usual step and the usual jitter are measured.
        """
        steps = np.concatenate([np.diff(t) for t in windows])
        dt = float(np.median(steps))
        # How often the usual step is taken anew as the median of those near it.
        for _ in range(2):  # lost samples are no jitter, and move the median of all
            near = steps[np.abs(steps / dt - 1) < (RULES.gap - 1)]
            dt = float(np.median(near))
        usual = float(np.quantile(np.abs(near / dt - 1), 0.95))
        rows, t, then = clock.odd
        rows = rows.astype(int)
        ratio = (then - t) / dt
        # A gap is longer than the deviation of 95 % of nearer steps: four standard deviations.
        gap = ratio - 1 > max((RULES.gap - 1), 2.0 * usual)
        gap &= ~_late(rows, ratio)
        change = np.abs(ratio[~gap] - 1)
        jitter = float(change.max(initial=usual))
        length = (then - t)[gap]
        others = max(clock.rows - 1 - len(length), 1)
        apart = clock.last - clock.first - float(length.sum())
        drift = apart / others / dt - 1
        return Gaps(name, dt, usual, jitter, rows[gap], t[gap], length, drift)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.rows)

    @property
    def lost(self) -> Array:
        """How many samples are missing in each, (m,) int."""
        steps = np.rint(self.length / self.step).astype(int)
        return np.maximum(steps - 1, 1)

    def divide(self, longest: float, least: int = 1) -> Grid | None:
        """Return the grid of a log that bridges gaps up to `longest` [s]; None without gaps.

        Parameters
        ----------
        longest : float [s]
        least : int
            Fewest samples of a stretch that is used.

        Raises
        ------
        LogError
            If too many samples are missing to be lost ones.
        """
        if not len(self):
            return None
        split = self.length > longest * (1 + ROUNDOFF)
        return Grid(self.rows[split] + 1, self.rows[~split], self.lost[~split], least)

    def check(self, samples: int) -> None:
        """Refuse a clock that is too uneven to identify missing samples.

        Raises
        ------
        LogError
        """
        count = len(self)
        steps = self.length / self.step
        apart = np.abs(steps - np.rint(steps))
        # Whole up to this share of a step, which of uneven steps a quarter is: else no
        # clock.
        whole = count and float(np.median(apart)) < 0.125
        # Few gaps, however long, split a log into stretches: pauses, or windows of a long log.
        often = count > RULES.small * samples
        # More gaps are lost samples only where half of them are whole steps.
        many = count > 0.25 * samples
        if (often and self.lost.sum() > samples) or (many and not whole):
            raise LogError(
                f"{self.name} is sampled so unevenly (every {samples / count:.2g}th step is "
                f"longer than the usual {self.step:.3g} s, the first after t = {self.t[0]:.6g} s) "
                "that no velocity can be computed: give the times at which samples were measured, "
                "not those at which they arrived, or measured velocities and accelerations."
            )

    def tell(self, split: Array) -> str:
        """Return the gaps that are split, (m,) bool, in words."""
        at = np.flatnonzero(split)
        rows = [f"{self.length[k]:.3g} s after data row {self.rows[k] + 1}" for k in at]
        return listing(rows, 3)


@frozen
class Grid:
    """The times of the rows of a log with gaps.

    Attributes
    ----------
    breaks : (b,) int
        Rows before which the log is split.
    after : (m,) int
        Rows after which samples are bridged.
    lost : (m,) int
        Number of samples that are bridged after each.
    least : int
        Fewest samples of a stretch; shorter ones are left out.
    """

    breaks: Array
    after: Array
    lost: Array
    least: int

    def stretches(self, start: int, stop: int) -> list[tuple[int, int]]:
        """Return the stretches (first, last) of the rows [start, stop), counted from `start`."""
        inner = self.breaks[(self.breaks > start) & (self.breaks < stop)] - start
        return list(pairwise([0, *inner.tolist(), stop - start]))

    def places(self, start: int, stop: int) -> Array:
        """Return how many steps after `start` the rows [start, stop) of a stretch were sampled."""
        at = np.arange(stop - start)
        inside = (self.after >= start) & (self.after < stop - 1)
        for row, lost in zip(self.after[inside], self.lost[inside], strict=True):
            at[row + 1 - start :] += lost
        return at

    def left_out(self, start: int, stop: int) -> Array:
        """Return a mask of the rows [start, stop) that are left out, (stop - start,) bool.

        These are stretches that are too short for the filter. The first sample of every later
        stretch is also left out, so that the rows show the gap.
        """
        out = np.zeros(stop - start, bool)
        for a, b in self.stretches(start, stop):
            out[a:b] = b - a < self.least
        out[self.breaks[(self.breaks >= start) & (self.breaks < stop)] - start] = True
        return out


def fill(x: Array, at: Array) -> Array:
    """Return x (N, …), sampled at the steps `at` (N,) int, at every step, by cubics."""
    length = at[-1] + 1
    if length == len(at):
        return x
    wide = np.zeros((length, *x.shape[1:]))
    missing = np.ones(length, bool)
    wide[at] = x
    missing[at] = False
    return interpolate(wide, missing)


def _late(rows: Array, ratio: Array) -> Array:
    """Return the odd steps that neighbouring steps compensate, (m,) bool.

    No sample is missing there. The stamps are too late or too early.
    """
    if not len(rows):
        return np.zeros(0, bool)
    run = np.concatenate([[0], np.cumsum(np.diff(rows) != 1)])
    return np.bincount(run, ratio - 1)[run] < (RULES.gap - 1)
