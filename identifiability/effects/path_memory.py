"""What a joint remembers of its way since it turned: play and stop [Brokate & Sprekels 1996].

Both hang on the path alone, not on time. Where samples are missing, and at the first of a
stretch, the joint is taken to have come a long way in the direction that it moves in.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot import Motion


def split_runs(motion: Motion) -> list[np.ndarray]:
    """Return the samples (…,) of each stretch of a motion without missing samples."""
    gaps = np.flatnonzero(np.diff(motion.kept) != 1) + 1
    return [rows for rows in np.split(np.arange(len(motion)), gaps) if len(rows)]


def follow_with_play(x: Array, width: float, way: float) -> Array:
    """Return where a slider is that x drags along in a slot from ``-width`` to ``width``, (N,).

    Clips after clips are a clip, so that all of them are composed in log₂ N rounds, or in fewer:
    once each has met both ends of the slot, where it began no longer matters.

    Parameters
    ----------
    x : (N,) [rad or m]
    width : float [rad or m]
    way : float
        Sign of the direction in which x came to its first sample.
    """
    low, high = x - width, x + width
    step = 1
    while step < len(x) and not np.array_equal(low[step:], high[step:]):
        ends = [np.clip(end[:-step], low[step:], high[step:]) for end in (low, high)]
        low, high = (
            np.concatenate([end[:step], new]) for end, new in zip((low, high), ends, strict=True)
        )
        step *= 2
    slider: Array = np.clip(x[0] - width * way, low, high)
    return slider


def stretch_of_springs(motion: Motion, position: Array, speed: Array, width: float) -> Array:
    """Return how far a spring is stretched that slips beyond ``width``, (N,), −1 … 1.

    Parameters
    ----------
    motion : Motion
    position, speed : (N,)
        Of an axis along it.
    width : float [rad or m]
    """
    out = np.zeros(len(position))
    for rows in split_runs(motion):
        x, way = position[rows], np.sign(speed[rows])
        first = float(way[np.argmax(way != 0)])
        out[rows] = (x - follow_with_play(x, width, first)) / width
    return out
