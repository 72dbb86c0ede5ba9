"""What is believed after the data: intervals by every road, pairs, contraction, room of bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    COLOURS,
    INK,
    LINE,
    MUTED,
    canvas,
    dots,
    drawn,
    plain,
    strokes,
)
from identifiability.report.figures.parameters import MOST_SIGMA, draw_marks
from identifiability.report.figures.rows import log_scale, row_canvas, row_lines, top_label
from identifiability.report.marks import mark_of
from identifiability.report.numbers import format_number

#: Look of the layers of a forest plot, in their order: colour and marker.
LAYERS = (
    (MUTED, "v"),
    (COLOURS["blue"], "o"),
    (COLOURS["amber"], "s"),
    (COLOURS["green"], "^"),
    (COLOURS["purple"], "D"),
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
    figure, axes = row_canvas(names, 9 * len(layers) + 10, top=14 + 17 * lines)
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
        _place(axes, values[:, 0], at, colour, marker, label)
    _stated(axes, stated, rows, plain(origin, 24))
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.4, borderaxespad=0.2,
        handlelength=1.4, columnspacing=1.2,
    )  # fmt: skip
    axes.set_xlabel("distance from the estimate [σ robust]")
    return figure


def _intervals(axes: Axes, values: Array, rows: Array, colour: str) -> None:
    known = np.isfinite(values).all(1)
    low, high = axes.get_xlim()
    ends = np.clip(values[known, 1:], low, high)
    first, last = (np.stack([ends[:, i], rows[known]], 1) for i in (0, 1))
    strokes(axes, first, last, colour, linewidth=1.6)


def _place(
    axes: Axes, x: Array, rows: Array, colour: str, marker: str, label: str, size: float = 5
) -> None:
    """Draw marks, those beyond the axis as arrows at its edge."""
    near = np.abs(x) <= MOST_SIGMA
    axes.plot(
        x[near], rows[near], marker, color=colour, markersize=size, label=label, zorder=3,
        markeredgewidth=1.2,
    )  # fmt: skip
    for arrow, beyond in ((">", x > MOST_SIGMA), ("<", x < -MOST_SIGMA)):
        edge = np.copysign(np.full(int(beyond.sum()), MOST_SIGMA + 0.3), x[beyond])
        axes.plot(edge, rows[beyond], arrow, color=colour, markersize=5, clip_on=False, zorder=3)


def _stated(axes: Axes, stated: Array, rows: Array, label: str) -> None:
    """Draw stated values as bars through the height of their rows."""
    colour = COLOURS["vermilion"]
    near = np.abs(stated) <= MOST_SIGMA
    x, at = stated[near], rows[near]
    strokes(axes, np.stack([x, at - 0.42], 1), np.stack([x, at + 0.42], 1), colour, linewidth=2)
    _place(axes, np.where(near, np.nan, stated), rows, colour, "|", "")
    axes.add_line(Line2D([], [], color=colour, linewidth=2, label=label))


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
    axes.set_xlabel(plain(labels[0], 40))
    axes.set_ylabel(plain(labels[1], 34))
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
    figure, axes = row_canvas(names, top=72)
    axes.set_xlim(0, 1.02)
    row_lines(axes, len(names))
    rows, x = np.arange(len(names)), np.clip(contraction, 0.0, 1.0)
    for kind in dict.fromkeys(sources):
        own = np.array([s == kind for s in sources]) & np.isfinite(x)
        tone = COLOURS[mark_of(kind).tone]
        ends = np.stack([x[own], rows[own]], 1)
        strokes(axes, ends * [0, 1], ends, tone, linewidth=1.2)
        draw_marks(axes, x[own], rows[own], kind)
    axes.axvline(limit, color=MUTED, linewidth=1, linestyle=(0, (4, 3)))
    top_label(axes, limit, "learned from here on", MUTED)
    axes.legend(
        handles=[_key(kind) for kind in dict.fromkeys(sources)], loc="lower left",
        bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.2, borderaxespad=2.0, columnspacing=1.2,
    )  # fmt: skip
    axes.set_xlabel("contraction from prior to posterior sd [–]")
    return figure


def _key(kind: str) -> Line2D:
    mark = mark_of(kind)
    return Line2D(
        [], [], marker=mark.marker, fillstyle=mark.fill, color=COLOURS[mark.tone], linestyle="none",
        markersize=7, label=plain(kind),
    )  # fmt: skip


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
    figure, axes = row_canvas(bodies, 24, top=48)
    log_scale(axes, LEAST_MARGIN, 1.0)
    row_lines(axes, len(bodies))
    rows, held = np.arange(len(bodies)), np.array(active, bool)
    both = np.isfinite(nearest) & np.isfinite(stated)
    a, b = (np.stack([_inside(x[both]), rows[both]], 1) for x in (stated, nearest))
    strokes(axes, a, b, MUTED, linewidth=1)
    axes.plot(
        _inside(stated), rows, "o", fillstyle="none", color=MUTED, markersize=7,
        label=plain(origin, 24),
    )  # fmt: skip
    for own, marker, tone, label in (
        (~held, "o", "blue", "nearest real robot"),
        (held, "X", "vermilion", "the same, held at the edge"),
    ):
        if not own.any():
            continue
        axes.plot(
            _inside(nearest[own]), rows[own], marker, color=COLOURS[tone], markersize=7, label=label
        )
    axes.legend(
        loc="lower left", bbox_to_anchor=(-0.2, 1), ncols=2, handletextpad=0.2, borderaxespad=0.2,
        columnspacing=1.0,
    )  # fmt: skip
    axes.set_xlabel("smallest scaled eigenvalue of the pseudo-inertia [–]")
    return figure


def _inside(x: Array) -> Array:
    """Return margins moved to the edge of the axis where they are below it; NaN stays."""
    inside: Array = np.clip(x, LEAST_MARGIN, 1.0)
    return inside
