"""Lost samples: which steps of a clock are gaps, which of them are bridged, where a log is split.

A filter and two differences need samples at even steps. Samples that are nowhere farther apart than
half a period of the cut-off determine what the filter lets through: such gaps are bridged by a
cubic. Across a longer one nothing is computed: the log falls into stretches, each filtered and
differentiated by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.checks import Clock
from identifiability.logs.stale import interpolate

#: A step is a gap if it is longer than the usual one by this share of it, or by `JITTER` times what
#: 95 % of the steps nearer than that deviate by, where that is more: four standard deviations.
LOST, JITTER = 0.5, 2.0

#: How often the usual step is taken anew as the median of those near it.
CENTRED = 2

#: A gap is bridged up to this share of the period of the cut-off [Nyquist 1928].
BRIDGED = 0.5

#: More gaps than this share of the samples are lost samples only where half of them are whole steps
#: up to `WHOLE` of one, which of uneven steps a quarter is: else the clock is no clock.
MOST, WHOLE = 0.25, 0.125

#: Gaps that a note lists.
LISTED = 3


@frozen
class Gaps:
    """The steps of a log between which samples are missing.

    Attributes
    ----------
    name : str
        Of the log.
    step : float [s]
        The usual step.
    usual : float
        What 95 % of the steps without a gap deviate by, as a share of the usual one.
    jitter : float
        The largest deviation of any step that is no gap, as a share of the usual one.
    rows : (m,) int
        Rows after which samples are missing.
    t : (m,) [s]
        Their times.
    length : (m,) [s]
        From there to the next sample.
    drift : float
        By how much the mean of the other steps differs from the usual one, as a share of it.
    """

    name: str
    step: float
    usual: float
    jitter: float
    rows: np.ndarray
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
        for _ in range(CENTRED):  # lost samples are no jitter, and move the median of all
            near = steps[np.abs(steps / dt - 1) < LOST]
            dt = float(np.median(near))
        usual = float(np.quantile(np.abs(near / dt - 1), 0.95))
        rows, t, then = clock.odd
        ratio = (then - t) / dt
        gap = ratio - 1 > max(LOST, JITTER * usual)
        gap &= ~_late(rows, ratio)
        worst = max(clock.longest.length, clock.shortest.length, key=lambda s: abs(s / dt - 1))
        odd = np.abs(ratio[~gap] - 1)
        jitter = float(odd.max(initial=0.0)) if len(rows) else abs(worst / dt - 1)
        length = (then - t)[gap]
        others = max(clock.rows - 1 - len(length), 1)
        drift = (clock.last - clock.first - float(length.sum())) / others / dt - 1
        return Gaps(name, dt, usual, jitter, rows[gap], t[gap], length, drift)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.rows)

    @property
    def lost(self) -> np.ndarray:
        """How many samples are missing in each, (m,) int."""
        count: np.ndarray = np.maximum(np.rint(self.length / self.step).astype(int) - 1, 1)
        return count

    def divide(self, longest: float, least: int = 1) -> Grid | None:
        """Return where a log is split, if gaps up to `longest` [s] are bridged; None without gaps.

        Parameters
        ----------
        longest : float [s]
        least : int
            Fewest samples of a stretch that is used.

        Raises
        ------
        LogError
            If so many samples are missing that they cannot be lost ones.
        """
        if not len(self):
            return None
        split = self.length > longest * (1 + 1e-9)
        return Grid(self.rows[split] + 1, self.rows[~split], self.lost[~split], least)

    def check(self, samples: int) -> None:
        """Refuse a clock that is so uneven that nobody knows which samples are missing.

        Raises
        ------
        LogError
        """
        steps = self.length / self.step
        whole = len(self) and float(np.median(np.abs(steps - np.rint(steps)))) < WHOLE
        if self.lost.sum() > samples or (len(self) > MOST * samples and not whole):
            raise LogError(
                f"{self.name} is sampled so unevenly (every {samples / len(self):.2g}th step is "
                f"longer than the usual {self.step:.3g} s, the first after t = {self.t[0]:.6g} s) "
                "that no velocity can be computed: give the times at which samples were measured, "
                "not those at which they arrived, or measured velocities and accelerations."
            )

    def tell(self, split: np.ndarray) -> str:
        """Return the gaps that are split, (m,) bool, in words."""
        at = np.flatnonzero(split)
        shown = [
            f"{self.length[k]:.3g} s after t = {self.t[k]:.6g} s (data row {self.rows[k] + 1})"
            for k in at[:LISTED]
        ]
        more = f" and {len(at) - LISTED} more" if len(at) > LISTED else ""
        return ", ".join(shown) + more


@frozen
class Grid:
    """How the rows of a log with gaps lie in time.

    Attributes
    ----------
    breaks : (b,) int
        Rows before which the log is split.
    after : (m,) int
        Rows after which samples are bridged.
    lost : (m,) int
        How many.
    least : int
        Fewest samples of a stretch; shorter ones are left out.
    """

    breaks: np.ndarray
    after: np.ndarray
    lost: np.ndarray
    least: int

    def stretches(self, start: int, stop: int) -> list[tuple[int, int]]:
        """Return the stretches (first, last) of the rows [start, stop), counted from `start`."""
        inner = self.breaks[(self.breaks > start) & (self.breaks < stop)] - start
        return list(pairwise([0, *inner.tolist(), stop - start]))

    def places(self, start: int, stop: int) -> np.ndarray:
        """Return how many steps after `start` the rows [start, stop) of a stretch were sampled."""
        at = np.arange(stop - start)
        inside = (self.after >= start) & (self.after < stop - 1)
        for row, lost in zip(self.after[inside], self.lost[inside], strict=True):
            at[row + 1 - start :] += lost
        return at

    def left_out(self, start: int, stop: int) -> np.ndarray:
        """Return which of the rows [start, stop) are left out, (stop - start,) bool.

        They are the first sample of every stretch but the first, so that rows tell of the gap, and
        stretches that are too short for the filter.
        """
        out = np.zeros(stop - start, bool)
        for a, b in self.stretches(start, stop):
            out[a:b] = b - a < self.least
        out[self.breaks[(self.breaks >= start) & (self.breaks < stop)] - start] = True
        return out


def fill(x: Array, at: np.ndarray) -> Array:
    """Return x (N, …), sampled at the steps `at` (N,) int, at every step, by cubics."""
    if at[-1] + 1 == len(at):
        return x
    wide, missing = np.zeros((at[-1] + 1, *x.shape[1:])), np.ones(at[-1] + 1, bool)
    wide[at], missing[at] = x, False
    filled = interpolate(wide.reshape(len(wide), -1), missing)
    return filled.reshape(wide.shape)


def _late(rows: np.ndarray, ratio: Array) -> np.ndarray:
    """Return which odd steps stand beside others that make up for them, (m,) bool.

    Nothing is missing there: samples were stamped too late or too early.
    """
    if not len(rows):
        return np.zeros(0, bool)
    run = np.concatenate([[0], np.cumsum(np.diff(rows) != 1)])
    late: np.ndarray = np.bincount(run, ratio - 1)[run] < LOST
    return late
