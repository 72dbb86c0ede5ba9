"""Models of a ladder beside each other: error, size, condition."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import COLOURS, INK, MUTED, SURFACE, drawn
from identifiability.report.figures.rows import log_scale, row_canvas, top_label
from identifiability.report.numbers import format_number

_ROW = 32


@drawn
def draw_errors(
    names: Sequence[str],
    first: Array,
    second: Array,
    spread: Array,
    selected: int,
    labels: tuple[str, str] = ("fitted motion", "unseen motion ± SE"),
) -> Figure:
    """Draw two relative torque errors of each model, such as in sample and held out.

    Parameters
    ----------
    names : sequence of str
    first, second, spread : (m,)
        Errors as fractions; `spread` is the standard error of the second.
    selected : int
    labels : (str, str)
        What the errors are.
    """
    figure, axes = row_canvas(names, _ROW)
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    first, second, spread = (np.where(np.isfinite(x), x, np.nan) for x in (first, second, spread))
    for row in rows:
        ends = [100 * first[row], 100 * second[row]]
        if np.isfinite(ends).all():
            axes.plot(ends, [row, row], color=MUTED, linewidth=1, zorder=1)
    axes.plot(100 * first, rows, "o", fillstyle="none", color=MUTED, markersize=7, label=labels[0])
    axes.errorbar(
        100 * second, rows, xerr=100 * np.maximum(np.nan_to_num(spread), 0.0), fmt="o",
        color=COLOURS["blue"], markersize=7.5, elinewidth=2.2, capsize=3.5, label=labels[1],
    )  # fmt: skip
    axes.margins(x=0.1)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.3, borderaxespad=0.2
    )
    axes.set_xlabel("relative torque error [%]")
    return figure


@drawn
def draw_sizes(
    names: Sequence[str], parameters: Sequence[int], identifiable: Sequence[int], selected: int
) -> Figure:
    """Draw how many parameters each model has and how many of them are identifiable."""
    figure, axes = row_canvas(names, _ROW, right=64)
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    axes.barh(
        rows, parameters, 0.5, facecolor=SURFACE, edgecolor=MUTED, linewidth=1, label="parameters"
    )
    axes.barh(rows, identifiable, 0.5, color=COLOURS["blue"], label="identifiable")
    for row, total, found in zip(rows, parameters, identifiable, strict=True):
        axes.annotate(
            f"{found} of {total}", (total, row), (6, 0), textcoords="offset points", va="center",
            color=INK, fontsize=10.5, annotation_clip=False,
        )  # fmt: skip
    axes.set_xlim(0, max(parameters, default=1) or 1)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.2, borderaxespad=0.2
    )
    axes.set_xlabel("number of parameters [–]")
    return figure


@drawn
def draw_conditions(names: Sequence[str], condition: Array, selected: int) -> Figure:
    """Draw the condition number of each model's column-scaled regressor on a log axis."""
    figure, axes = row_canvas(names, _ROW, right=60)
    _mark_selected(axes, selected)
    known = condition[np.isfinite(condition) & (condition > 0)]
    log_scale(axes, 1.0, max(float(known.max(initial=1.0)) * 2, 1000.0))
    for row, value in enumerate(condition):
        if not np.isfinite(value):
            continue
        axes.plot([1, value], [row, row], color=COLOURS["blue"], linewidth=1.4)
        axes.plot(value, row, "o", color=COLOURS["blue"], markersize=7)
        text = format_number(float(value), 3)
        axes.annotate(
            text, (value, row), (8, 0), textcoords="offset points", va="center", color=INK,
            fontsize=10.5, annotation_clip=False,
        )  # fmt: skip
    axes.axvline(100, color=MUTED, linewidth=1, linestyle=(0, (4, 3)))
    top_label(axes, 100, "errors magnified 100 ×", MUTED)
    axes.set_xlabel("condition number of the scaled regressor [–]")
    return figure


def _mark_selected(axes: Axes, selected: int) -> None:
    axes.axhspan(selected - 0.5, selected + 0.5, color=COLOURS["blue"], alpha=0.09, linewidth=0)
    labels = axes.get_yticklabels()
    if 0 <= selected < len(labels):
        labels[selected].set_fontweight("bold")
