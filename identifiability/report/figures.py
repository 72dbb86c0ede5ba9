"""Figures as functions of arrays and labels, in the page's style.

What to use when: `identifiability.plot` draws those of a result. Here are what a model predicts
and leaves of torque, how well parameters are known, and models beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import mark_of
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    DASHED,
    INK,
    LINE,
    MUTED,
    SURFACE,
    VERMILION,
    canvas,
    dots,
    drawn,
    label_axes,
    label_width,
    legend_above,
    log_scale,
    plain,
    plot_line,
    row_canvas,
    row_lines,
    strokes,
    whiskers,
)

# Torque and motion along time.


#: Points of a scatter, and medians along it.
POINTS, BINS = 500, 24

#: Colour and name of the model as it was, and of the one with the named effects.
STATES = ((VERMILION, "before"), (BLUE, "after"))


@drawn
def draw_torque(
    t: Array,
    measured: Array,
    predicted: Array,
    title: str,
    unit: str,
    most: int = 1500,
    width: int = 400,
) -> Figure:
    """Draw measured and predicted torque of one joint, and what is left below.

    Parameters
    ----------
    t : (N,) [s]
    measured, predicted : (N,) [unit]
    title, unit : str
    most : int
        Points a line keeps.
    width : int [px]
    """
    figure, (above, below) = canvas(width, 330, (60, 10, 50, 38), (2.2, 1))
    plot_line(above, t, measured, most, color=MUTED, linewidth=3, alpha=0.45, label="measured")
    plot_line(above, t, predicted, most, color=BLUE, linewidth=1.3, label="predicted")
    label_axes(above, "", f"torque [{unit}]" if "m" in unit else f"force [{unit}]", title, pad=26)
    legend_above(above, handlelength=1.4)
    below.axhline(0, color=MUTED, linewidth=0.8)
    plot_line(below, t, measured - predicted, most, color=VERMILION, linewidth=0.9)
    label_axes(below, "time [s]", f"residual [{unit}]")
    if len(t) > 1 and t[-1] > t[0]:
        below.set_xlim(float(t[0]), float(t[-1]))
    above.locator_params(axis="y", nbins=5)
    below.locator_params(axis="y", nbins=3)
    figure.align_ylabels([above, below])
    return figure


@drawn
def draw_residual(
    x: Array, residuals: Mapping[str, Array], title: str, labels: tuple[str, str]
) -> Figure:
    """Draw what models leave of a joint's torque over a motion, with medians along it.

    Parameters
    ----------
    x : (N,)
        Motion.
    residuals : mapping of str to (N,)
        By model, at most two.
    title : str
    labels : (str, str)
        Of the axes.
    """
    figure, (axes,) = canvas(400, 250, (60, 10, 50, 38))
    axes.axhline(0, color=MUTED, linewidth=0.8)
    rows = spread_rows(len(x), POINTS)
    for (label, y), (colour, _) in zip(residuals.items(), STATES, strict=False):
        dots(axes, x[rows], y[rows], colour, 2.4, 0.35)
        axes.plot(*medians_along(x, y), color=colour, lw=1.8, label=label)
    legend_above(axes, handlelength=1.4)
    label_axes(axes, *labels, title, pad=26)
    return figure


def medians_along(x: Array, y: Array) -> tuple[Array, Array]:
    """Return medians of x (N,) and y (N,) in bins of as many rows each, along x."""
    count = max(1, min(BINS, len(x) // 8))
    parts = [p for p in np.array_split(np.argsort(x), count) if len(p)]
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])


def spread_rows(count: int, most: int) -> np.ndarray:
    """Return at most so many of the rows 0 … count - 1, evenly spread."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(most, count)).astype(int))


@drawn
def draw_curve(
    x: Array, learned: Array, spread: Array, data: Array, title: str, labels: tuple[str, str]
) -> Figure:
    """Draw what an effect was learned to be, with its 95 % interval, against the data.

    Parameters
    ----------
    x, learned, spread, data : (N,)
        Motion, torque of the effect, its standard error, and the residual that it should explain.
    title : str
    labels : (str, str)
        Of the axes.
    """
    figure, (axes,) = canvas(400, 260, (60, 10, 50, 38))
    rows = spread_rows(len(x), POINTS)
    dots(axes, x[rows], data[rows], MUTED, 3.0, 0.6)
    order = np.argsort(x)
    learned, spread = learned[order], spread[order]
    low, high = learned - REACH * spread, learned + REACH * spread
    band: Any = {"color": BLUE, "alpha": 0.2, "linewidth": 0, "label": "95 %"}
    axes.fill_between(x[order], low, high, **band)
    axes.plot(x[order], learned, color=BLUE, linewidth=1.2, label="learned")
    legend_above(axes, handlelength=1.4)
    label_axes(axes, *labels, title, pad=26)
    return figure


@drawn
def draw_forward(t: Array, before: Array, after: Array) -> Figure:
    """Draw the position error over the time since the start of a stretch.

    Parameters
    ----------
    t : (S,) [s]
    before, after : (K, S)
        Error as a share of the distance moved; nan counts as all of it.
    """
    figure, (axes,) = canvas(640, 260, (60, 20, 50, 38))
    for share, (colour, label) in zip((before, after), STATES, strict=True):
        low, middle, high = 100 * np.quantile(share, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(t, middle, color=colour, linewidth=1.8, label=label)
    legend_above(axes, handlelength=1.4)
    axes.set_xlim(0, float(t[-1]))
    axes.set_ylim(bottom=0)
    label_axes(axes, "time since the start of a stretch [s]", "position error [%]")
    return figure


@drawn
def draw_shrink(names: Sequence[str], errors: Array) -> Figure:
    """Draw the error on unseen motion as effects are added.

    Parameters
    ----------
    names : sequence of str
        The model as it was, then each effect.
    errors : (m,)
        ε_RA as fractions.
    """
    figure, axes = row_canvas(names, 28, top=14, right=60, xlabel="error on unseen motion [%]")
    shown = 100 * np.where(np.isfinite(errors), errors, np.nan)
    bars = axes.barh(np.arange(len(names)), shown, height=0.55, color=BLUE, alpha=0.75)
    axes.bar_label(bars, fmt="%.3g %%", padding=5)
    return figure


# Models beside each other.


@drawn
def draw_errors(
    names: Sequence[str], fitted: Array, unseen: Array, spread: Array, selected: int
) -> Figure:
    """Draw the relative torque errors of each model on fitted and on unseen motion.

    Parameters
    ----------
    names : sequence of str
    fitted, unseen, spread : (m,)
        Errors as fractions; `spread` is the standard error of the second.
    selected : int
    """
    figure, axes = row_canvas(names, 32, xlabel="relative torque error [%]")
    axes.axhspan(selected - 0.5, selected + 0.5, color=BLUE, alpha=0.09, linewidth=0)
    axes.texts[selected].set_fontweight("bold")
    rows = np.arange(len(names))
    fitted, unseen, spread = (
        100 * np.where(np.isfinite(x), x, np.nan) for x in (fitted, unseen, spread)
    )
    first, last = (np.stack([x, rows], 1) for x in (fitted, unseen))
    strokes(axes, first, last, MUTED, linewidth=1, zorder=1)
    axes.plot(fitted, rows, "o", fillstyle="none", color=MUTED, markersize=7, label="fitted motion")
    whiskers(axes, unseen, rows, np.nan_to_num(np.abs(spread)), label="unseen motion ± SE")
    axes.margins(x=0.1)
    legend_above(axes, handletextpad=0.3)
    return figure


@drawn
def draw_ladder(
    sizes: Array, fitted: Array, unseen: Array, spread: Array, selected: int, least: int
) -> Figure:
    """Draw the error of each model against its size, with the band of one standard error.

    Parameters
    ----------
    sizes : (m,)
        Numbers of parameters, descending.
    fitted, unseen : (m,)
        ε_RA as fractions.
    spread : (m,)
        Standard error of the difference of `unseen` to the selected model's.
    selected, least : int
        The model to use, and the one with the best predictive log density.
    """
    figure, (axes,) = canvas(720, 320, (62, 16, 40, 44))
    fitted, unseen, spread = (
        100 * np.where(np.isfinite(x), x, np.nan) for x in (fitted, unseen, spread)
    )
    band: Any = {"color": BLUE, "alpha": 0.16, "linewidth": 0, "label": "± SE"}
    half = np.nan_to_num(spread)
    axes.fill_between(sizes, unseen - half, unseen + half, **band)
    axes.plot(sizes, unseen, "o-", color=BLUE, markersize=5, label="unseen motion")
    hollow: Any = {"color": MUTED, "fillstyle": "none", "markersize": 4, "linewidth": 1}
    axes.plot(sizes, fitted, "o-", label="fitted motion", **hollow)
    chosen = float(sizes[selected])
    axes.axvline(chosen, color=BLUE, label=f"use {chosen:.0f}", **DASHED)
    if least != selected:
        ring: Any = {"color": COLOURS["amber"], "markersize": 9, "fillstyle": "none"}
        axes.plot(sizes[least], unseen[least], "o", label="best density", **ring)
    shown = np.concatenate([unseen[: selected + 1], fitted[: selected + 1]])
    shown = shown[np.isfinite(shown)]
    if len(shown) and shown.max() > 0:
        # Errors beyond this many times the largest up to the chosen model are cut off, to
        # show the choice.
        axes.set_ylim(0.8 * float(shown.min()), 1.4 * float(shown.max()))
    axes.set_xlim(float(sizes.max()) + 0.8, float(sizes.min()) - 0.8)
    legend_above(axes, loc="upper left", ncols=5, bbox_to_anchor=(0, 1.14), borderaxespad=0)
    label_axes(axes, "number of parameters [–]", "relative torque error [%]")
    return figure


# How well each parameter is known.


#: Side of a cell of the map, and the most parameters that it holds [px].
CELL, MOST = 17, 30

#: Parameters are correlated where the absolute correlation of their estimates is above this.
CONFUSED = 0.7


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
    order = np.argsort(np.nan_to_num(label, nan=np.inf), kind="stable")
    title = "standard deviation relative to the value [%]"
    figure, axes = row_canvas([names[k] for k in order], xlabel=title)
    known = np.concatenate([white, label, [limit, paper_limit]])
    known = known[np.isfinite(known) & (known > 0)]
    low = max(min(float(known.min(initial=limit)) / 1.8, 0.8), 1e-6)
    # Relative standard deviations above this are drawn at the edge [%].
    high = float(np.clip(known.max(initial=limit) * 2.2, 10 * limit, 1e4))
    log_scale(axes, low, high)
    axes.axvspan(low, limit, color=BLUE, alpha=0.06, linewidth=0)
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        mark = mark_of(kind)
        colour = COLOURS[mark.tone]
        rows = np.flatnonzero([verdicts[k] == kind for k in order])
        start, end = (
            np.clip(np.nan_to_num(x[order[rows]], nan=np.inf), low, high) for x in (white, label)
        )
        strokes(axes, np.stack([start, rows], 1), np.stack([end, rows], 1), colour, linewidth=1.2)
        axes.plot(start, rows, "|", color=colour, markersize=8, markeredgewidth=1.2)
        shape = {"fillstyle": mark.fill, "markerfacecoloralt": SURFACE}
        for own, marker in ((end < high, mark.marker), (end >= high, ">")):
            style: Any = {"marker": marker, "clip_on": False, **shape}
            axes.plot(end[own], rows[own], linestyle="none", color=colour, markersize=7, **style)
    axes.axvline(limit, color=INK, linewidth=1, label=f"limit {limit:g} % (label)")
    if low < paper_limit < high:
        axes.axvline(paper_limit, color=MUTED, label="10 × least (white)", **DASHED)
    legend_above(axes)
    return figure


def order_correlated(correlation: Array, most: int = MOST) -> np.ndarray:
    """Return parameters with a partner above `CONFUSED`, those of one group beside each other.

    Groups are connected by such pairs; if there are too many, the strongest groups are returned.

    Parameters
    ----------
    correlation : (k, k)
    most : int
    """
    size = np.abs(np.nan_to_num(correlation))
    np.fill_diagonal(size, 0.0)
    strong = size > CONFUSED
    _, group = scipy.sparse.csgraph.connected_components(strong, directed=False)
    best = [-size[np.ix_(group == g, group == g)].max() for g in group]
    order = np.lexsort((group, best))
    found: np.ndarray = order[strong[order].any(1)][:most]
    return found


@drawn
def draw_confusion(names: Sequence[str], correlation: Array) -> Figure:
    """Draw the correlation of estimates as squares: area is its size, colour its sign.

    Parameters
    ----------
    names : sequence of str
    correlation : (k, k)
    """
    k = len(names)
    left = label_width(names)
    side = CELL * k
    figure, (axes,) = canvas(left + side + 16, side + left + 24, (left, 16, 24, left))
    axes.set_xlim(-0.5, k - 0.5)
    axes.set_ylim(k - 0.5, -0.5)
    axes.set_xticks(range(k), [plain(n) for n in names], rotation=90, color=INK)
    axes.set_yticks(range(k), [plain(n) for n in names], color=INK)
    axes.grid(visible=False)
    for at in range(k):
        axes.axhline(at, color=LINE, linewidth=0.5, zorder=0)
        axes.axvline(at, color=LINE, linewidth=0.5, zorder=0)
    rows, columns = np.nonzero(~np.eye(k, dtype=bool))
    rho = np.nan_to_num(correlation[rows, columns])
    for sign, colour in ((1.0, BLUE), (-1.0, VERMILION)):
        own = (sign * rho) > 0.1
        size = (0.86 * CELL) ** 2 * np.abs(rho[own])
        axes.scatter(columns[own], rows[own], s=size, c=colour, marker="s", linewidths=0)
    return figure


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


@drawn
def draw_gain(names: Sequence[str], ratio: Array) -> Figure:
    """Draw standard deviations relative to those of the motion compared with.

    Parameters
    ----------
    names : sequence of str
    ratio : (k,)
    """
    figure, axes = row_canvas(names, top=14, xlabel="σ with this motion / σ compared with [–]")
    shown = np.where(np.isfinite(ratio) & (ratio > 0), ratio, 1.0)
    log_scale(axes, 0.8 * float(shown.min(initial=0.5)), 1.25 * float(shown.max(initial=2.0)))
    row_lines(axes, len(names))
    axes.axvline(1.0, color=INK, linewidth=1)
    colours = np.where(shown <= 1, BLUE, VERMILION)
    axes.scatter(shown, np.arange(len(names)), c=colours.tolist(), s=36, zorder=3)
    return figure
