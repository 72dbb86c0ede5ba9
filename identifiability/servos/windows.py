"""Windows: stretches of logs that are rolled out, each from its first measured state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals

from .positions import are_aside, encoder_noise, explicable

#: Total length of the windows that are rolled out [s]. Longer windows add little information.
LONG: Tolerance = 36.0

#: Length of each window of a log that is too long to be rolled out whole [s].
WINDOW: Tolerance = 3.0


@frozen
class Window:
    """A stretch of a log.

    Attributes
    ----------
    log : int
        Which log the window is of.
    rows : Log
    moves : (n,) bool
        Joints whose command moves. Other joints stand and give no information on their servo.
    source : Log
        The log, whose earlier rows determine integrals of servos.
    """

    log: int
    rows: Log
    moves: np.ndarray
    source: Log

    @cached_property
    def explicable(self) -> Array:
        """Explicable motion of the joints (rms), (n,) [rad or m]."""
        return explicable(self.rows)

    @cached_property
    def judged(self) -> np.ndarray:
        """Rows in which positions of a joint are compared, (N, n) bool."""
        start = self._start(self.source)
        aside = are_aside(self.source)[start : start + len(self.rows)]
        judged: np.ndarray = self.moves & ~aside
        return judged

    @staticmethod
    def of(k: int, log: Log, start: int, stop: int) -> Window:
        """Return the window of the rows [start, stop) of the log of a number."""
        rows = log.rows(start, stop)
        return Window(k, rows, moving_commands(rows), log)

    def delay(self, joint: int) -> Window:
        """Return the same stretch with the commands of one joint a row later."""
        late = {}
        for name in ("q_ref", "dq_ref", "tau_ff"):
            command = getattr(self.rows, name)
            if command is not None:
                late[name] = command.copy()
                late[name][1:, joint] = command[:-1, joint]
        return replace(self, rows=replace(self.rows, **late))

    def along(self, log: Log) -> Window:
        """Return the same stretch of another version of its log."""
        start = self._start(log)
        return Window.of(self.log, log, start, start + len(self.rows))

    def _start(self, log: Log) -> int:
        """Return the row at which this stretch begins in a version of its log."""
        return int(np.searchsorted(log.t, self.rows.t[0]))


def cut_windows(logs: Sequence[Log]) -> list[Window]:
    """Return windows of logs: each log whole, or equally spaced windows of a log that is longer."""
    budget = LONG / len(logs)
    windows = list[Window]()
    for k, log in enumerate(logs):
        step = signals.sampling_step(log.t)
        length = round(min(budget, WINDOW) / step)
        if len(log) <= round(budget / step):
            windows.append(Window.of(k, log, 0, len(log)))
            continue
        count = max(int(budget / WINDOW), 1)
        starts = place_windows(log, length, count)
        windows += [Window.of(k, log, start, start + length) for start in starts.tolist()]
    return windows


def split_windows(windows: Sequence[Window]) -> list[Window]:
    """Return windows whose logs are rolled out whole in stretches of the usual length."""
    stretches = list[Window]()
    for window in windows:
        rows = window.rows
        count = max(int(len(rows) * signals.sampling_step(rows.t) / WINDOW), 1)
        ends = np.linspace(0, len(rows), count + 1).astype(int).tolist()
        stretches += [Window.of(window.log, rows, *pair) for pair in pairwise(ends)]
    return stretches


def place_windows(log: Log, length: int, count: int) -> np.ndarray:
    """Return the rows at which windows of some rows begin, (count,) int.

    Windows are equally spaced. If they miss most of the way of a joint's command, they lie where
    commands move instead, and no two overlap.
    """
    last = len(log) - length
    even = np.linspace(0, last, count).astype(int)
    ways = np.concatenate([np.abs(np.diff(x, axis=0)) for x in _commands(log)], axis=1)
    ways = ways[:, np.ptp(ways, axis=0) > 0]
    shares = ways / ways.sum(0)
    inside = np.sum([shares[start : start + length].sum(0) for start in even], axis=0)
    if np.all(inside > 0.5 * count * length / len(log)):
        return even
    activity = shares.mean(1) + 1 / len(shares)
    done = np.cumsum(activity) / activity.sum()
    centres = np.searchsorted(done, (np.arange(count) + 0.5) / count)
    apart = length * np.arange(count)
    # Each window begins after the one before it ends, and leaves room for the others.
    after = np.maximum.accumulate(centres - length // 2 - apart)
    return np.clip(after, 0, len(log) - count * length) + apart


def thin_windows(windows: Sequence[Window]) -> list[Window]:
    """Return about half of the windows, or the middle third of a log that is rolled out whole.

    Logs often begin and end at rest.
    """
    chosen = list[Window]()
    for k in dict.fromkeys(window.log for window in windows):
        of_log = [window for window in windows if window.log == k]
        if len(of_log) > 1:
            chosen += of_log[1::2]
            continue
        rows = of_log[0].rows
        chosen.append(Window.of(k, rows, len(rows) // 3, 2 * len(rows) // 3))
    return chosen


def moving_commands(log: Log) -> np.ndarray:
    """Return which joints follow a command that moves by more than their noise, (n,) bool."""
    # The standard deviation of a constant is not zero by rounding, but that of zeros is.
    sizes = [np.std(x - x[0], axis=0) for x in _commands(log)]
    noise = encoder_noise(log)
    return (np.max(sizes, axis=0) > noise) & ~log.is_unmeasured


def _commands(log: Log) -> list[Array]:
    """Return the commands of a log, (N, n) each."""
    return [x for x in (log.q_ref, log.dq_ref, log.tau_ff) if x is not None]
