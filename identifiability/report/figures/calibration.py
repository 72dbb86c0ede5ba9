"""Operating characteristics: coverage, wrong verdicts, and ranks of planted values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identifiability.foundation.names import Array
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
def draw_wrong(labels: Sequence[str], ours: Array, paper: Array, high: Array) -> Figure:
    """Draw the share of believed parameters that are off by more than half.

    Parameters
    ----------
    labels : sequence of str
        Simulated noise.
    ours, paper : (c,)
        Shares among the parameters called identifiable and those that pass the 10× rule.
    high : (c,)
        Upper ends of the intervals of `ours`.
    """
    figure, axes = row_canvas(labels, _ROW)
    rows = np.arange(len(labels))
    axes.plot(100 * paper, rows, "x", color=COLOURS["vermilion"], markersize=7, label="10× rule")
    reach = 100 * np.nan_to_num(np.maximum(high - ours, 0.0))
    axes.errorbar(
        100 * ours, rows, xerr=[np.zeros(len(rows)), reach], fmt="o", color=COLOURS["blue"],
        markersize=7, elinewidth=2, capsize=3, label="identifiable",
    )  # fmt: skip
    most = float(np.nanmax(np.concatenate([paper, ours, high, [0.0]])))
    axes.set_xlim(-2, max(10.0, 105 * most))
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.3)
    axes.set_xlabel("off by more than half [%]")
    return figure


@drawn
def draw_each(names: Sequence[str], share: Array, low: Array, high: Array) -> Figure:
    """Draw the coverage of every parameter's robust 95 % intervals, the worst on top.

    Parameters
    ----------
    names : sequence of str
    share, low, high : (k,)
        Shares of intervals that hold the truth, with Monte-Carlo intervals.
    """
    figure, axes = row_canvas(names)
    rows = np.arange(len(names))
    axes.axvline(95, color=INK, linewidth=1)
    bad = high < 0.95
    for chosen, colour in ((~bad, COLOURS["blue"]), (bad, COLOURS["vermilion"])):
        reach = [100 * (share - low)[chosen], 100 * (high - share)[chosen]]
        axes.errorbar(
            100 * share[chosen], rows[chosen], xerr=np.maximum(reach, 0.0), fmt="o", color=colour,
            markersize=4, elinewidth=1.4,
        )  # fmt: skip
    axes.set_xlim(min(80.0, 100 * float(low.min()) - 2), 102)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_xlabel("intervals that hold the truth [%]")
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
