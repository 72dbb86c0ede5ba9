"""Operating characteristics: coverage, wrong verdicts, and ranks of planted values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.names import Array
from identifiability.report.drawing import COLOURS, INK, MUTED, canvas, drawn, plain
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
    axes.set_xlabel("believed, but wrong by more than half [%]")
    return figure


@drawn
def draw_ranks(counts: Array, band: tuple[float, float], worst: int, name: str) -> Figure:
    """Draw how often planted values fall into each part of their posterior's draws.

    Parameters
    ----------
    counts : (p, b)
        For each parameter and each of b equal parts of the ranks.
    band : (float, float)
        Counts between which 99 % of them lie when ranks are uniform.
    worst : int
    name : str
        Of the worst parameter.
    """
    figure, (axes,) = canvas(440, 270, (58, 14, 34, 38))
    edges = np.linspace(0, 1, counts.shape[1] + 1)
    axes.axhspan(*band, color=COLOURS["grey"], alpha=0.12, linewidth=0)
    axes.axhline(float(np.mean(band)), color=INK, linewidth=1)
    for k, row in enumerate(counts):
        if k != worst:
            axes.stairs(row, edges, baseline=None, color=MUTED, alpha=0.35, linewidth=0.9)
    axes.stairs(
        counts[worst], edges, baseline=None, color=COLOURS["vermilion"], linewidth=1.8,
        label=f"smallest p: {plain(name)}",
    )  # fmt: skip
    axes.stairs([], [0], baseline=None, color=MUTED, label="others")
    axes.set_xlim(0, 1)
    low, high = axes.get_ylim()
    spread = max(high - float(np.mean(band)), float(np.mean(band)) - low)
    axes.set_ylim(float(np.mean(band)) - 1.1 * spread, float(np.mean(band)) + 1.1 * spread)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    axes.set_xlabel("rank of the planted value among the draws [share]")
    axes.set_ylabel("simulated experiments [–]")
    return figure
