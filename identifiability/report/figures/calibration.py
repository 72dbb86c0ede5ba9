"""Operating characteristics: coverage of intervals and wrong verdicts, by simulated noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.names import Array
from identifiability.report.drawing import COLOURS, INK, MUTED, drawn
from identifiability.report.figures.rows import row_canvas

_ROW = 30


@drawn
def draw_coverage(labels: Sequence[str], white: Array, robust: Array, spread: Array) -> Figure:
    """Draw the coverage of white-noise and of robust 95 % intervals.

    Parameters
    ----------
    labels : sequence of str
        Simulated noise.
    white, robust : (c,)
        Shares of intervals that hold the truth.
    spread : (c,)
        Monte-Carlo standard error of `robust`.
    """
    figure, axes = row_canvas(labels, _ROW)
    rows = np.arange(len(labels))
    axes.axvline(95, color=INK, linewidth=1)
    axes.plot(100 * white, rows, "o", fillstyle="none", color=MUTED, markersize=7, label="white σ")
    axes.errorbar(
        100 * robust, rows, xerr=200 * np.nan_to_num(spread), fmt="o", color=COLOURS["blue"],
        markersize=7, elinewidth=2, capsize=3, label="robust σ",
    )  # fmt: skip
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.3)
    axes.set_xlim(0, 102)
    axes.set_xlabel("intervals that hold the truth [%]")
    return figure


@drawn
def draw_wrong(labels: Sequence[str], ours: Array, paper: Array) -> Figure:
    """Draw the share of believed parameters that are off by more than half.

    Parameters
    ----------
    labels : sequence of str
        Simulated noise.
    ours, paper : (c,)
        Shares among the parameters called identifiable and those that pass the 10× rule.
    """
    figure, axes = row_canvas(labels, _ROW)
    rows = np.arange(len(labels))
    axes.plot(100 * paper, rows, "x", color=COLOURS["vermilion"], markersize=7, label="10× rule")
    axes.plot(100 * ours, rows, "o", color=COLOURS["blue"], markersize=7, label="identifiable")
    axes.set_xlim(-2, max(10.0, 105 * float(np.max(np.append(paper, ours), initial=0.0))))
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.3)
    axes.set_xlabel("believed parameters that are wrong by more than half [%]")
    return figure
