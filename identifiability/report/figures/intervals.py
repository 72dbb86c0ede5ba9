"""Values of several things with their intervals, a row each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import INK, drawn
from identifiability.report.figures.axes import DASHED, row_canvas, row_lines, whiskers


@drawn
def draw_intervals(
    names: Sequence[str], values: Array, halves: Array, xlabel: str, line: float = 0.0
) -> Figure:
    """Draw values with half widths of intervals along x, and a line to compare them with.

    Parameters
    ----------
    names : sequence of str
    values, halves : (k,)
    xlabel : str
    line : float
    """
    figure, axes = row_canvas(names, row=26, top=14, xlabel=xlabel)
    whiskers(axes, values, np.arange(len(names), dtype=float), halves)
    axes.axvline(line, color=INK, **DASHED)
    row_lines(axes, len(names))
    return figure
