"""Operating characteristics: coverage, wrong verdicts, and ranks of planted values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import BLUE, GREY, INK, MUTED, VERMILION, canvas, drawn, plain
from identifiability.report.figures.axes import label_axes, legend_above, row_canvas, whiskers

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
    figure, axes = row_canvas(labels, _ROW, xlabel="intervals that hold the truth [%]")
    rows = np.arange(len(labels))
    axes.axvline(95, color=INK, linewidth=1)
    axes.plot(100 * white, rows, "o", fillstyle="none", color=MUTED, markersize=7, label="white σ")
    whiskers(axes, 100 * robust, rows, 200 * np.nan_to_num(spread), label="robust σ")
    legend_above(axes, handletextpad=0.3, borderaxespad=None)
    axes.set_xlim(0, 102)
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
    figure, axes = row_canvas(labels, _ROW, xlabel="off by more than half [%]")
    rows = np.arange(len(labels))
    axes.plot(100 * paper, rows, "x", color=VERMILION, markersize=7, label="10× rule")
    reach = 100 * np.nan_to_num(np.maximum(high - ours, 0.0))
    whiskers(axes, 100 * ours, rows, [np.zeros(len(rows)), reach], label="identifiable")
    most = float(np.nanmax(np.concatenate([paper, ours, high, [0.0]])))
    axes.set_xlim(-2, max(10.0, 105 * most))
    legend_above(axes, handletextpad=0.3, borderaxespad=None)
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
    figure, axes = row_canvas(names, xlabel="intervals that hold the truth [%]")
    rows = np.arange(len(names))
    axes.axvline(95, color=INK, linewidth=1)
    bad = high < 0.95
    reach = 100 * np.maximum([share - low, high - share], 0.0)
    for own, colour in ((~bad, BLUE), (bad, VERMILION)):
        small: Any = {"color": colour, "markersize": 4, "elinewidth": 1.4, "capsize": 0}
        whiskers(axes, 100 * share[own], rows[own], reach[:, own], **small)
    axes.set_xlim(min(80.0, 100 * float(low.min()) - 2), 102)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
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
    edges, level = np.linspace(0, 1, counts.shape[1] + 1), float(np.mean(band))
    axes.axhspan(*band, color=GREY, alpha=0.12, linewidth=0)
    axes.axhline(level, color=INK, linewidth=1)
    for row in np.delete(counts, worst, axis=0):
        axes.stairs(row, edges, baseline=None, color=MUTED, alpha=0.35, linewidth=0.9)
    own: Any = {"color": VERMILION, "linewidth": 1.8, "label": f"smallest p: {plain(name)}"}
    axes.stairs(counts[worst], edges, baseline=None, **own)
    axes.stairs([], [0], baseline=None, color=MUTED, label="others")
    axes.set_xlim(0, 1)
    low, high = axes.get_ylim()
    spread = max(high - level, level - low)
    axes.set_ylim(level - 1.1 * spread, level + 1.1 * spread)
    legend_above(axes)
    label = "rank of the planted value among the draws [share]"
    label_axes(axes, label, "simulated experiments [–]")
    return figure
