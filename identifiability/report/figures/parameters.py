"""How well each parameter is known, and how far it lies from what the robot file states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    GREY,
    INK,
    MUTED,
    SURFACE,
    drawn,
    plain,
    strokes,
)
from identifiability.report.figures.axes import DASHED, log_scale, row_canvas, row_lines, top_label
from identifiability.report.marks import mark_of

#: Relative standard deviations above this are drawn at the edge [%].
MOST_PERCENT = 1e4

#: Distances above this many σ are drawn at the edge.
MOST_SIGMA = 6.0


def precision_order(sigma: Array) -> np.ndarray:
    """Return the order of parameters from best to least known, (k,)."""
    return np.argsort(np.where(np.isnan(sigma), np.inf, sigma), kind="stable")


@drawn
def draw_precision(
    names: Sequence[str],
    white: Array,
    label: Array,
    verdicts: Sequence[str],
    limit: float,
    paper_limit: float,
) -> Figure:
    """Draw relative standard deviations on a log axis, best known first, with both limits.

    Parameters
    ----------
    names : sequence of str
    white, label : (k,) [%]
        σ under white noise, and σ from what the label says, relative to the value; infinite where
        not determined.
    verdicts : sequence of str
    limit, paper_limit : float [%]
        Of the verdicts (for `label`) and of the 10× rule (for `white`).
    """
    order = precision_order(label)
    title = "standard deviation relative to the value [%]"
    figure, axes = row_canvas([names[k] for k in order], top=48, xlabel=title)
    known = np.concatenate([white, label, [limit, paper_limit]])
    known = known[np.isfinite(known) & (known > 0)]
    low = max(min(float(known.min(initial=limit)) / 1.8, 0.8), 1e-6)
    high = float(np.clip(known.max(initial=limit) * 2.2, 10 * limit, MOST_PERCENT))
    log_scale(axes, low, high)
    axes.axvspan(low, limit, color=BLUE, alpha=0.06, linewidth=0)
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        rows = np.array([r for r, k in enumerate(order) if verdicts[k] == kind])
        _precision_rows(axes, rows, white[order[rows]], label[order[rows]], kind)
    axes.axvline(limit, color=INK, linewidth=1)
    top_label(axes, limit, f"limit {limit:g} % (label)", INK)
    if np.isfinite(paper_limit) and low < paper_limit < high:
        axes.axvline(paper_limit, color=MUTED, **DASHED)
        top_label(axes, paper_limit, "10 × least (white)", MUTED, level=1)
    return figure


def _precision_rows(axes: Axes, rows: np.ndarray, white: Array, label: Array, kind: str) -> None:
    colour = COLOURS[mark_of(kind).tone]
    low, high = axes.get_xlim()
    seen = label < high
    beyond = rows[~seen]
    axes.plot(np.full(len(beyond), high), beyond, ">", color=colour, markersize=6, clip_on=False)
    rows, white, label = rows[seen], np.maximum(white[seen], low), np.maximum(label[seen], low)
    strokes(axes, np.stack([white, rows], 1), np.stack([label, rows], 1), colour, linewidth=1.2)
    axes.plot(white, rows, "|", color=colour, markersize=8, markeredgewidth=1.2)
    draw_marks(axes, label, rows, kind)


def mark_style(kind: str) -> dict[str, Any]:
    """Return how the mark of a verdict looks."""
    mark = mark_of(kind)
    return {
        "marker": mark.marker,
        "fillstyle": mark.fill,
        "color": COLOURS[mark.tone],
        "markersize": 7,
        "linestyle": "none",
    }


def draw_marks(axes: Axes, x: Array, y: Array, kind: str) -> None:
    """Draw the mark of a verdict at some points."""
    style = mark_style(kind)
    edge = 1.6 if style["marker"] == "x" else 1.2
    axes.plot(x, y, markerfacecoloralt=SURFACE, zorder=3, markeredgewidth=edge, **style)


def draw_arrows(axes: Axes, x: Array, rows: Array, edge: float, colour: str, **style: Any) -> None:
    """Draw arrows at the edges of the axes for points more than `MOST_SIGMA` from zero."""
    for marker, beyond in ((">", x > MOST_SIGMA), ("<", x < -MOST_SIGMA)):
        at = np.copysign(np.full(int(beyond.sum()), MOST_SIGMA + edge), x[beyond])
        axes.plot(at, rows[beyond], marker, color=colour, clip_on=False, **style)


@drawn
def draw_pulls(
    names: Sequence[str], pulls: Array, sigma: Array, verdicts: Sequence[str], origin: str
) -> Figure:
    """Draw how many σ the estimate lies from a stated value, in the order of `draw_precision`.

    Parameters
    ----------
    names : sequence of str
    pulls : (k,)
        ``(estimate - stated) / σ_robust``; NaN where nothing is stated.
    sigma : (k,) [%]
        Decides the order.
    verdicts : sequence of str
    origin : str
        What stands at zero, for the label.
    """
    order = precision_order(sigma)
    label = "distance of the estimate [σ robust]"
    figure, axes = row_canvas([names[k] for k in order], top=48, xlabel=label)
    axes.set_xlim(-MOST_SIGMA - 0.5, MOST_SIGMA + 0.5)
    axes.axvspan(-REACH, REACH, color=GREY, alpha=0.1, linewidth=0)
    axes.axvline(0, color=INK, linewidth=1)
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        rows = np.array([r for r, k in enumerate(order) if verdicts[k] == kind])
        known = np.isfinite(pulls[order[rows]])
        _pull_rows(axes, rows[known], pulls[order[rows[known]]], kind)
    top_label(axes, 0, plain(origin, 40), INK)
    return figure


def _pull_rows(axes: Axes, rows: np.ndarray, pulls: Array, kind: str) -> None:
    colour = COLOURS[mark_of(kind).tone]
    draw_arrows(axes, pulls, rows, 0.25, colour, markersize=6)
    near = np.abs(pulls) <= MOST_SIGMA
    ends = np.stack([pulls[near], rows[near]], 1)
    strokes(axes, ends * [0, 1], ends, colour, linewidth=1.2)
    draw_marks(axes, pulls[near], rows[near], kind)
