"""What is believed after the data: intervals by every road, pairs, contraction, room of bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    INK,
    LINE,
    MUTED,
    VERMILION,
    canvas,
    dots,
    drawn,
    plain,
    strokes,
)
from identifiability.report.figures.axes import (
    DASHED,
    label_axes,
    legend_above,
    log_scale,
    row_canvas,
    row_lines,
    top_label,
)
from identifiability.report.figures.parameters import (
    MOST_SIGMA,
    draw_arrows,
    draw_marks,
    mark_style,
)
from identifiability.report.marks import mark_of
from identifiability.report.numbers import format_number

#: Look of the layers of a forest plot, in their order: colour and marker.
LAYERS = (
    (MUTED, "v"),
    (BLUE, "o"),
    (COLOURS["amber"], "s"),
    (COLOURS["green"], "^"),
    (COLOURS["purple"], "D"),
    (INK, "P"),
)

#: Margins below this are drawn at the edge.
LEAST_MARGIN = 1e-8

#: Points drawn in a pair.
POINTS = 400


@drawn
def draw_forest(
    names: Sequence[str], layers: Mapping[str, Array], stated: Array, origin: str
) -> Figure:
    """Draw 95 % intervals of each parameter by several roads, below each other in its row.

    Parameters
    ----------
    names : sequence of str
    layers : mapping of str to (k, 3)
        Centre, lower and upper end, as distances from the estimate in σ_robust; NaN for none. At
        most as many as `LAYERS`.
    stated : (k,)
        The same of a stated value; NaN where nothing is stated.
    origin : str
        Who states it, for the legend.
    """
    lines = -(-(len(layers) + 1) // 2)
    label = "distance from the estimate [σ robust]"
    figure, axes = row_canvas(names, 9 * len(layers) + 10, top=14 + 17 * lines, xlabel=label)
    axes.set_xlim(-MOST_SIGMA - 0.5, MOST_SIGMA + 0.5)
    axes.axvline(0, color=INK, linewidth=1)
    edges = np.arange(1, len(names)) - 0.5
    first, last = (np.stack([np.full(len(edges), x), edges], 1) for x in axes.get_xlim())
    strokes(axes, first, last, LINE, linewidth=0.8)
    rows, step = np.arange(len(names)), 0.8 / max(len(layers), 1)
    for k, (label, values) in enumerate(layers.items()):
        colour, marker = LAYERS[k]
        at = rows + (k - (len(layers) - 1) / 2) * step
        _intervals(axes, values, at, colour)
        x = values[:, 0]
        style: Any = {"markersize": 5, "zorder": 3}
        near = np.abs(x) <= MOST_SIGMA
        axes.plot(
            x[near], at[near], marker, color=colour, label=label, markeredgewidth=1.2, **style
        )
        draw_arrows(axes, x, at, 0.3, colour, **style)
    _stated(axes, stated, rows, plain(origin, 24))
    legend_above(axes, handletextpad=0.4, handlelength=1.4, columnspacing=1.2)
    return figure


def _intervals(axes: Axes, values: Array, rows: Array, colour: str) -> None:
    known = np.isfinite(values).all(1)
    low, high = axes.get_xlim()
    ends = np.clip(values[known, 1:], low, high)
    first, last = (np.stack([ends[:, i], rows[known]], 1) for i in (0, 1))
    strokes(axes, first, last, colour, linewidth=1.6)


def _stated(axes: Axes, stated: Array, rows: Array, label: str) -> None:
    """Draw stated values as bars through the height of their rows."""
    near = np.abs(stated) <= MOST_SIGMA
    x, at = stated[near], rows[near]
    strokes(axes, np.stack([x, at - 0.42], 1), np.stack([x, at + 0.42], 1), VERMILION, linewidth=2)
    draw_arrows(axes, stated, rows, 0.3, VERMILION, markersize=5, zorder=3)
    axes.add_line(Line2D([], [], color=VERMILION, linewidth=2, label=label))


@drawn
def draw_pair(
    draws: Array, labels: tuple[str, str], estimate: tuple[float, float], rho: float
) -> Figure:
    """Draw the draws of two parameters against each other.

    Parameters
    ----------
    draws : (D, 2)
    labels : (str, str)
        Name and unit of each.
    estimate : (float, float)
        Least squares, without prior or constraint.
    rho : float
        Their correlation.
    """
    figure, (axes,) = canvas(320, 280, (72, 14, 32, 46))
    known = draws[np.isfinite(draws).all(1)][:POINTS]
    dots(axes, known[:, 0], known[:, 1], COLOURS["purple"], 3.2, 0.55)
    axes.margins(0.08)
    (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    if low <= estimate[0] <= high and bottom <= estimate[1] <= top:
        axes.plot(*estimate, "+", color=INK, markersize=11, markeredgewidth=1.8)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter(FuncFormatter(lambda v, _: format_number(v, 4)))
    label_axes(axes, plain(labels[0], 40), plain(labels[1], 34))
    axes.set_title(f"correlation {rho:.2f}".replace("-", "−"))
    return figure


@drawn
def draw_contraction(
    names: Sequence[str], contraction: Array, sources: Sequence[str], limit: float
) -> Figure:
    """Draw how much narrower each parameter is after the data than before.

    Parameters
    ----------
    names : sequence of str
    contraction : (k,)
        ``1 - sd / prior sd``; what is negative is drawn at zero.
    sources : sequence of str
        What determines each: data, constraint, prior, structure.
    limit : float
        From here on a parameter has been learned.
    """
    figure, axes = row_canvas(names, top=72, xlabel="contraction from prior to posterior sd [–]")
    axes.set_xlim(0, 1.02)
    row_lines(axes, len(names))
    rows, x = np.arange(len(names)), np.clip(contraction, 0.0, 1.0)
    for kind in dict.fromkeys(sources):
        own = np.array([s == kind for s in sources]) & np.isfinite(x)
        tone = COLOURS[mark_of(kind).tone]
        ends = np.stack([x[own], rows[own]], 1)
        strokes(axes, ends * [0, 1], ends, tone, linewidth=1.2)
        draw_marks(axes, x[own], rows[own], kind)
    axes.axvline(limit, color=MUTED, **DASHED)
    top_label(axes, limit, "learned from here on", MUTED)
    keys = [Line2D([], [], label=plain(k), **mark_style(k)) for k in dict.fromkeys(sources)]
    legend_above(axes, handles=keys, handletextpad=0.2, borderaxespad=2.0, columnspacing=1.2)
    return figure


@drawn
def draw_margins(
    bodies: Sequence[str], nearest: Array, stated: Array, active: Sequence[bool], origin: str
) -> Figure:
    """Draw how far each body is from the edge of what can exist, on a log axis.

    Parameters
    ----------
    bodies : sequence of str
    nearest, stated : (nb,)
        Smallest dimensionless eigenvalue of the nearest real robot's bodies and of the stated ones.
    active : sequence of bool
        Whether the nearest real robot is held back by this body.
    origin : str
        Who states the latter.
    """
    label = "smallest scaled eigenvalue of the pseudo-inertia [–]"
    figure, axes = row_canvas(bodies, 24, top=48, xlabel=label)
    log_scale(axes, LEAST_MARGIN, 1.0)
    row_lines(axes, len(bodies))
    rows, held = np.arange(len(bodies)), np.array(active, bool)
    # What is below the axis moves to its edge; NaN stays.
    stated, nearest = (np.clip(x, LEAST_MARGIN, 1.0) for x in (stated, nearest))
    both = np.isfinite(nearest) & np.isfinite(stated)
    a, b = (np.stack([x[both], rows[both]], 1) for x in (stated, nearest))
    strokes(axes, a, b, MUTED, linewidth=1)
    hollow: Any = {"fillstyle": "none", "color": MUTED, "markersize": 7}
    axes.plot(stated, rows, "o", label=plain(origin, 24), **hollow)
    for own, marker, colour, name in (
        (~held, "o", BLUE, "nearest real robot"),
        (held, "X", VERMILION, "the same, held at the edge"),
    ):
        if own.any():
            axes.plot(nearest[own], rows[own], marker, color=colour, markersize=7, label=name)
    legend_above(axes, bbox_to_anchor=(-0.2, 1), handletextpad=0.2, columnspacing=1.0)
    return figure
