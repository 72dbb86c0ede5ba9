"""Singular values, and the gap between what has an effect and what has none."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import COLOURS, INK, LINE, MUTED, canvas, drawn
from identifiability.report.figures.rows import power_of_ten

#: Relative singular values are drawn down to this.
FLOOR = 1e-18


@drawn
def draw_spectrum(values: Array, rank: int, tolerance: float) -> Figure:
    """Draw singular values relative to the largest: those kept, the gap, those that are zero.

    Parameters
    ----------
    values : (k,)
        Descending.
    rank : int
        How many are kept.
    tolerance : float
        Share of the largest below which a singular value is zero.
    """
    figure, (axes,) = canvas(440, 300, (58, 14, 34, 38))
    top = float(values[0]) if len(values) and values[0] > 0 else 1.0
    share = np.maximum(values / top, FLOOR)
    index = np.arange(1, len(values) + 1)
    axes.set_yscale("log")
    axes.set_ylim(FLOOR / 10, 10)
    axes.yaxis.set_major_locator(FixedLocator([10.0**k for k in range(-18, 1, 3)]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: power_of_ten(y)))
    axes.yaxis.set_minor_locator(NullLocator())
    _draw_limit(axes, tolerance)
    axes.plot(
        index[:rank], share[:rank], "o", color=COLOURS["blue"], markersize=5,
        label=f"independent: {rank}",
    )  # fmt: skip
    axes.plot(
        index[rank:], share[rank:], "x", color=COLOURS["vermilion"], markersize=5,
        label=f"zero: {len(values) - rank}",
    )  # fmt: skip
    if 0 < rank < len(values):
        axes.axvspan(rank + 0.3, rank + 0.7, color=LINE, linewidth=0)
        axes.plot([rank + 0.5] * 2, share[rank - 1 : rank + 1], color=INK, linewidth=1)
    axes.set_xlim(0, len(values) + 1)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.1, borderaxespad=0.2
    )
    axes.set_xlabel("number of the singular value [–]")
    axes.set_ylabel("relative to the largest [–]")
    return figure


def _draw_limit(axes: Axes, tolerance: float) -> None:
    axes.axhline(tolerance, color=MUTED, linewidth=1, linestyle=(0, (4, 3)))
    axes.annotate(
        "zero below this", (0, tolerance), (5, -4), xycoords=("axes fraction", "data"),
        textcoords="offset points", ha="left", va="top", color=MUTED, fontsize=10.5,
    )  # fmt: skip
