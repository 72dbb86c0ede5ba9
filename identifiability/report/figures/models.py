"""Models beside each other: error, size, condition; the way down to few parameters; the rank."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    INK,
    LINE,
    MUTED,
    SURFACE,
    VERMILION,
    canvas,
    drawn,
)
from identifiability.report.figures.axes import (
    DASHED,
    label_axes,
    legend_above,
    log_scale,
    row_canvas,
    set_powers,
    top_label,
    whiskers,
    write_beside,
    write_near,
)
from identifiability.report.numbers import format_number, whole_percent

_ROW = 32

#: Errors beyond this many times the largest up to the chosen rung are cut off, to show the choice.
BEYOND = 1.4

#: Relative singular values are drawn down to this.
FLOOR = 1e-18


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
    figure, axes = row_canvas(names, _ROW, xlabel="relative torque error [%]")
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    first, second, spread = (
        100 * np.where(np.isfinite(x), x, np.nan) for x in (first, second, spread)
    )
    for row in np.flatnonzero(np.isfinite(first + second)):
        axes.plot([first[row], second[row]], [row, row], color=MUTED, linewidth=1, zorder=1)
    axes.plot(first, rows, "o", fillstyle="none", color=MUTED, markersize=7, label=labels[0])
    reach = np.maximum(np.nan_to_num(spread), 0.0)
    large: Any = {"markersize": 7.5, "elinewidth": 2.2, "capsize": 3.5}
    whiskers(axes, second, rows, reach, label=labels[1], **large)
    axes.margins(x=0.1)
    legend_above(axes, handletextpad=0.3)
    return figure


@drawn
def draw_sizes(
    names: Sequence[str], parameters: Sequence[int], identifiable: Sequence[int], selected: int
) -> Figure:
    """Draw how many parameters each model has and how many of them are identifiable."""
    figure, axes = row_canvas(names, _ROW, right=64, xlabel="number of parameters [–]")
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    frame: Any = {"facecolor": SURFACE, "edgecolor": MUTED, "linewidth": 1}
    axes.barh(rows, parameters, 0.5, label="parameters", **frame)
    axes.barh(rows, identifiable, 0.5, color=BLUE, label="identifiable")
    texts = [f"{k} of {n}" for n, k in zip(parameters, identifiable, strict=True)]
    write_beside(axes, texts, parameters)
    axes.set_xlim(0, max(parameters, default=1) or 1)
    legend_above(axes, handlelength=1.2)
    return figure


@drawn
def draw_conditions(names: Sequence[str], condition: Array, selected: int) -> Figure:
    """Draw the condition number of each model's column-scaled regressor on a log axis."""
    label = "condition number of the scaled regressor [–]"
    figure, axes = row_canvas(names, _ROW, right=60, xlabel=label)
    _mark_selected(axes, selected)
    known = condition[np.isfinite(condition) & (condition > 0)]
    log_scale(axes, 1.0, max(float(known.max(initial=1.0)) * 2, 1000.0))
    for row in np.flatnonzero(np.isfinite(condition)):
        value = float(condition[row])
        axes.plot([1, value], [row, row], color=BLUE, linewidth=1.4)
        axes.plot(value, row, "o", color=BLUE, markersize=7)
        write_near(
            axes, format_number(value, 3), (value, float(row)), (8, 0), annotation_clip=False
        )
    axes.axvline(100, color=MUTED, **DASHED)
    top_label(axes, 100, "errors magnified 100 ×", MUTED)
    return figure


def _mark_selected(axes: Axes, selected: int) -> None:
    axes.axhspan(selected - 0.5, selected + 0.5, color=BLUE, alpha=0.09, linewidth=0)
    labels = axes.get_yticklabels()
    if 0 <= selected < len(labels):
        labels[selected].set_fontweight("bold")


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
    set_powers(axes.yaxis, range(-18, 1, 3))
    axes.axhline(tolerance, color=MUTED, **DASHED)
    corner: Any = {"xycoords": ("axes fraction", "data"), "ha": "left", "va": "top", "color": MUTED}
    write_near(axes, "zero below this", (0, tolerance), (5, -4), **corner)
    for part, marker, colour, label in (
        (slice(rank), "o", BLUE, f"independent: {rank}"),
        (slice(rank, None), "x", VERMILION, f"zero: {len(values) - rank}"),
    ):
        axes.plot(index[part], share[part], marker, color=colour, markersize=5, label=label)
    if 0 < rank < len(values):
        axes.axvspan(rank + 0.3, rank + 0.7, color=LINE, linewidth=0)
        axes.plot([rank + 0.5] * 2, share[rank - 1 : rank + 1], color=INK, linewidth=1)
    axes.set_xlim(0, len(values) + 1)
    legend_above(axes, handletextpad=0.1)
    label_axes(axes, "number of the singular value [–]", "relative to the largest [–]")
    return figure


@drawn
def draw_ladder(
    sizes: Array, fitted: Array, unseen: Array, spread: Array, selected: int, least: int
) -> Figure:
    """Draw the error of each rung against its size, with the band of one standard error.

    Parameters
    ----------
    sizes : (m,)
        Numbers of parameters, descending.
    fitted, unseen : (m,)
        ε_RA as fractions.
    spread : (m,)
        Standard error of the difference of `unseen` to the selected rung's.
    selected, least : int
        The rung to use, and the one with the best predictive log density.
    """
    figure, (axes,) = canvas(720, 320, (62, 16, 40, 44))
    fitted, unseen, spread = 100 * fitted, 100 * unseen, 100 * np.nan_to_num(spread)
    band: Any = {"color": BLUE, "alpha": 0.16, "linewidth": 0, "label": "± SE"}
    axes.fill_between(sizes, unseen - spread, unseen + spread, **band)
    axes.plot(sizes, unseen, "o-", color=BLUE, markersize=5, label="unseen motion")
    hollow: Any = {"color": MUTED, "fillstyle": "none", "markersize": 4, "linewidth": 1}
    axes.plot(sizes, fitted, "o-", label="fitted motion", **hollow)
    chosen = float(sizes[selected])
    axes.axvline(chosen, color=BLUE, **DASHED)
    above: Any = {
        "xycoords": ("data", "axes fraction"),
        "ha": "left",
        "va": "bottom",
        "fontsize": 11,
    }
    write_near(axes, f"use {chosen:.0f}", (chosen, 1.0), (4, 4), fontweight="bold", **above)
    if least != selected:
        ring: Any = {"color": COLOURS["amber"], "markersize": 9, "fillstyle": "none"}
        axes.plot(sizes[least], unseen[least], "o", label="best density", **ring)
    shown = np.concatenate([unseen[: selected + 1], fitted[: selected + 1]])
    shown = shown[np.isfinite(shown)]
    if len(shown) and shown.max() > 0:
        axes.set_ylim(0.8 * float(shown.min()), BEYOND * float(shown.max()))
    axes.set_xlim(float(sizes.max()) + 0.8, float(sizes.min()) - 0.8)
    legend_above(axes, loc="upper left", ncols=4, bbox_to_anchor=(0, 1.14), borderaxespad=0)
    label_axes(axes, "number of parameters [–]", "relative torque error [%]")
    return figure


@drawn
def draw_survival(names: Sequence[str], share: Array, chosen: np.ndarray) -> Figure:
    """Draw how often each parameter survives when pruning is repeated on resampled logs.

    Parameters
    ----------
    names : sequence of str
    share : (k,)
        As fractions.
    chosen : (k,) bool
        Whether the logs themselves keep it.
    """
    figure, axes = row_canvas(names, 22, right=58, xlabel="survives in [% of resampled logs]")
    for kept, colour, label in ((True, "blue", "in the chosen model"), (False, "grey", "pruned")):
        rows = np.flatnonzero(chosen == kept)
        if len(rows):
            axes.barh(rows, 100 * share[rows], 0.62, color=COLOURS[colour], label=label)
    write_beside(axes, [whole_percent(x) for x in share], 100 * share, fontsize=10)
    axes.set_xlim(0, 100)
    legend_above(axes)
    return figure
