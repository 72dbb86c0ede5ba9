"""Which samples of logs are looked at one by one: all of short logs, windows of long ones.

Whatever is a sum over samples is taken from `Information`, over every sample. What is not (sizes of
errors, their memory, pictures) takes rows of the regressor, and 50,000 of them say it to a percent
or two.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

#: Samples of all logs that are looked at one by one; of more only so many windows of so many
#: samples are, one in each of as many parts of equal length, and one of each log at least.
EXCERPT, WINDOWS, WINDOW = 100_000, 20, 2_500

#: Each window lies this share of what is left of its part later than the one before, or as much
#: earlier as it would leave the part: no period of a motion is met at the same phase each time.
LATER = (5**0.5 - 1) / 2


def choose_windows(
    counts: Sequence[int], sizes: tuple[int, int, int] | None = None
) -> tuple[np.ndarray, ...]:
    """Return the samples [start, stop) of each log that are looked at one by one, (w, 2) each.

    Parameters
    ----------
    counts : sequence of int
        Samples of each log.
    sizes : (excerpt, windows, size) int, optional
        Up to so many samples of all logs all are looked at, of more so many windows of so many
        samples; `EXCERPT`, `WINDOWS` and `WINDOW` by default.
    """
    excerpt, windows, size = sizes or (EXCERPT, WINDOWS, WINDOW)
    total = sum(counts)
    if total <= excerpt:
        return tuple(np.array([[0, c]]) for c in counts)
    out = []
    for count in counts:
        k = np.arange(max(1, round(windows * count / total)))
        own, part = min(size, count), count / len(k)
        starts = (k * part + (LATER * k) % 1.0 * (part - own)).astype(int)
        out.append(np.stack([starts, starts + own], 1))
    return tuple(out)


def choose_within(
    windows: Sequence[np.ndarray], sizes: tuple[int, int, int]
) -> tuple[np.ndarray, ...]:
    """Return fewer of the samples that windows (w, 2) of each log show, as `choose_windows` does.

    What is chosen across the border of two windows becomes a window in either.
    """
    out = []
    counts = [int(np.diff(own).sum()) for own in windows]
    for own, chosen in zip(windows, choose_windows(counts, sizes), strict=True):
        before = np.cumsum([0, *np.diff(own)[:-1, 0]])
        low = np.maximum(chosen[:, None, 0], before)
        high = np.minimum(chosen[:, None, 1], before + np.diff(own)[:, 0])
        found = np.stack([low, high], 2) + (own[:, 0] - before)[:, None]
        out.append(found[low < high])
    return tuple(out)


def inside(windows: np.ndarray, start: int, stop: int) -> list[tuple[int, slice]]:
    """Return which of the samples [start, stop) lie in windows (w, 2), by number of the window."""
    low, high = np.maximum(windows[:, 0], start), np.minimum(windows[:, 1], stop)
    found = np.flatnonzero(low < high).tolist()
    return [(k, slice(int(low[k]) - start, int(high[k]) - start)) for k in found]
