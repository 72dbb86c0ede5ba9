"""Error of simulated stretches of motion, before and after the named effects."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import COLOURS, canvas, drawn


@drawn
def draw_forward(t: Array, before: Array, after: Array) -> Figure:
    """Draw the position error over the time since the start of a stretch.

    Parameters
    ----------
    t : (S,) [s]
    before, after : (K, S)
        Error as a share of the distance moved; nan counts as all of it.
    """
    figure, (axes,) = canvas(640, 260, (60, 20, 50, 38))
    for share, colour, label in ((before, "vermilion", "before"), (after, "blue", "after")):
        low, middle, high = 100 * np.quantile(share, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=COLOURS[colour], alpha=0.18, linewidth=0)
        axes.plot(t, middle, color=COLOURS[colour], linewidth=1.8, label=label)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlim(0, float(t[-1]))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time since the start of a stretch [s]")
    axes.set_ylabel("position error [%]")
    return figure
