"""Samples that repeat the one before, because nothing new had arrived when they were written.

Robots and loggers have clocks of their own: every so often a row holds what the row before held.
Half a step of motion is then missing at one sample, which differences take for a blow. Such values
are recognised by what the joint did before and after, and interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.log import Log

#: Longest run of values that repeat the one before [samples]; what lasts longer is a rest or a gap.
LONGEST = 5

#: Across a run of repeated values a joint moves by at least so many steps of its encoder, else
#: rounding explains that nothing changed.
STEPS = 4.0

#: Changes are whole steps of an encoder if `ALL` of them are, to this share of a step; and a step
#: that is this share of the usual change from sample to sample is worth a note.
EXACT, ALL, COARSE = 0.02, 0.95, 0.25

#: What channels are called.
NAMES = {"q": "position", "dq": "velocity", "ddq": "acceleration", "tau": "torque"}


@frozen
class StaleRule:
    """What counts as a repeated value, by channel.

    Attributes
    ----------
    steps : dict of str to (n,)
        Smallest change of every joint's value: the step of its encoder, or next to nothing.
    share : dict of str to float
        Share of the samples that repeat the one before, where there are any.
    """

    steps: dict[str, Array]
    share: dict[str, float]

    @staticmethod
    def of(windows: Sequence[Log]) -> StaleRule:
        """Return the rule for a log, from windows of it."""
        steps, share = {}, {}
        for channel in (c for c in windows[0].channels if c in NAMES):
            values = [np.asarray(getattr(w, channel)) for w in windows]
            steps[channel] = np.min([smallest_change(x) for x in values], axis=0)
            found = float(np.mean([find_stale(x, steps[channel]).mean() for x in values]))
            if found > 0:
                share[channel] = found
        return StaleRule(steps, share)

    def mend(self, log: Log) -> Log:
        """Return a log with repeated values interpolated."""
        changed: dict[str, Any] = {}
        for channel in self.share:
            x = np.asarray(getattr(log, channel))
            changed[channel] = interpolate(x, find_stale(x, self.steps[channel]))
        return replace(log, **changed) if changed else log

    @property
    def note(self) -> str:
        """What was found and done, for the report; nothing if nothing was."""
        found = [f"{NAMES[c]} in {100 * s:.2g} %" for c, s in self.share.items()]
        if not found:
            return ""
        return (
            f"values of all joints that repeat the sample before although the joints move "
            f"({', '.join(found)} of the samples) were interpolated"
        )


def tell_steps(windows: Sequence[Log], steps: Array) -> str:
    """Return a note on an encoder that is coarse for how fast samples follow; or nothing.

    Parameters
    ----------
    windows : sequence of Log
    steps : (n,) [rad or m]
        Smallest change of every joint's position.
    """
    change = np.abs(np.concatenate([np.diff(w.q, axis=0) for w in windows]))
    whole = change / np.where(steps > 0, steps, np.inf)
    is_step = (np.abs(whole - np.round(whole)) < EXACT).mean(0) > ALL
    usual = np.array([np.median(c[c > 0]) if (c > 0).any() else np.inf for c in change.T])
    coarse = np.flatnonzero(is_step & (steps > COARSE * usual))
    if not len(coarse):
        return ""
    worst = coarse[np.argmax(steps[coarse] / usual[coarse])]
    return (
        f"positions come in steps, of {steps[worst]:.3g} at '{windows[0].joints[worst]}', where "
        f"{usual[worst]:.2g} is the usual change from sample to sample"
    )


def smallest_change(x: Array) -> Array:
    """Return the smallest change from sample to sample of x (N, n), (n,); 0 where there is none."""
    change = np.abs(np.diff(x, axis=0))
    found: Array = np.where(change > 0, change, np.inf).min(0, initial=np.inf)
    return np.where(np.isfinite(found), found, 0.0)


def find_stale(x: Array, steps: Array) -> np.ndarray:
    """Return which samples of x (N, n) repeat the one before although a joint moves, (N,) bool.

    A joint moves if it went the same way before and after, by `STEPS` encoder steps or more across
    the repeated samples.
    """
    stale = np.zeros(len(x), bool)
    same = np.concatenate([[False], (np.diff(x, axis=0) == 0).all(1), [False]])
    edges = np.diff(same.astype(int))
    first, last = np.flatnonzero(edges == 1) + 1, np.flatnonzero(edges == -1)
    for a, b in zip(first.tolist(), last.tolist(), strict=True):
        # Rows a … b hold what row a - 1 holds.
        if b - a >= LONGEST or a < 2 or b + 1 >= len(x):
            continue
        after, before = x[b + 1] - x[b], x[a - 1] - x[a - 2]
        moved = (after * before > 0) & (np.abs(after) >= STEPS * steps)
        stale[a : b + 1] = moved.any()
    return stale


def interpolate(x: Array, stale: np.ndarray) -> Array:
    """Return x (N, n) with stale samples (N,) bool on the cubic through their four neighbours."""
    good, out = np.flatnonzero(~stale), x.copy()
    at = np.flatnonzero(stale)
    if not len(at) or len(good) < 4:
        return out
    start = np.clip(np.searchsorted(good, at) - 2, 0, len(good) - 4)
    nodes = good[start[:, None] + np.arange(4)]
    value = np.zeros((len(at), x.shape[1]))
    for k in range(4):
        others = np.delete(nodes, k, axis=1)
        weight = np.prod((at[:, None] - others) / (nodes[:, [k]] - others), axis=1)
        value += weight[:, None] * x[nodes[:, k]]
    out[at] = value
    return out
