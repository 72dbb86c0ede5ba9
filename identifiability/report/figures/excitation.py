"""An exciting motion: each joint within its limits, the search, and what it gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    VERMILION,
    canvas,
    drawn,
    plain,
)
from identifiability.report.figures.axes import (
    DASHED,
    label_axes,
    legend_above,
    log_scale,
    row_canvas,
    row_lines,
)
from identifiability.report.numbers import format_number


@drawn
def draw_joint(
    t: Array, parts: Sequence[Array], bounds: tuple[Array, Array], title: str, unit: str
) -> Figure:
    """Draw position, velocity and acceleration of a joint between their limits.

    Parameters
    ----------
    t : (N,) [s]
    parts : three of (N,) [unit, unit/s, unit/s²]
    bounds : (3,), (3,)
        Least and largest of each.
    title, unit : str
    """
    figure, axes = canvas(400, 330, (66, 10, 34, 38), (1, 1, 1))
    labels = (f"q [{unit}]", f"q̇ [{unit}/s]", f"q̈ [{unit}/s²]")
    for ax, y, low, high, label in zip(axes, parts, *bounds, labels, strict=True):
        for bound in (low, high):
            ax.axhline(bound, color=VERMILION, **DASHED)
        ax.plot(t, y, color=BLUE, linewidth=1.4)
        room = 0.08 * (high - low)
        ax.set_ylim(low - room, high + room)
        label_axes(ax, "time [s]" if ax is axes[-1] else "", label, title if ax is axes[0] else "")
        ax.locator_params(axis="y", nbins=4)
    axes[-1].set_xlim(float(t[0]), float(t[-1]))
    figure.align_ylabels(axes)
    return figure


@drawn
def draw_search(
    starts: Sequence[Array], before: float, label: str, *, logarithmic: bool = True
) -> Figure:
    """Draw the figure of merit by iteration, one line a start.

    Parameters
    ----------
    starts : sequence of (i,)
        The figure after each iteration.
    before : float
        What it is compared with.
    label : str
        Name of the figure.
    logarithmic : bool
    """
    figure, (axes,) = canvas(720, 260, (70, 16, 30, 40))
    colours = ("blue", "green", "purple", "amber", "sky")
    for k, y in enumerate(starts):
        colour = COLOURS[colours[k % len(colours)]]
        axes.plot(np.arange(1, len(y) + 1), y, color=colour, label=f"start {k + 1}")
    axes.axhline(before, color=MUTED, label="compared with", **DASHED)
    if logarithmic:
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.set_ylim(low, high)
        _plain_ticks(axes.yaxis, low, high)
    label_axes(axes, "iteration", plain(label, 40))
    legend_above(axes, ncols=4, handlelength=1.4, borderaxespad=None)
    return figure


@drawn
def draw_gain(names: Sequence[str], ratio: Array) -> Figure:
    """Draw standard deviations relative to those of the motion compared with.

    Parameters
    ----------
    names : sequence of str
    ratio : (k,)
    """
    figure, axes = row_canvas(names, xlabel="σ with this motion / σ compared with")
    shown = np.where(np.isfinite(ratio) & (ratio > 0), ratio, 1.0)
    log_scale(axes, 0.8 * float(shown.min(initial=0.5)), 1.25 * float(shown.max(initial=2.0)))
    _plain_ticks(axes.xaxis, *axes.get_xlim())
    row_lines(axes, len(names))
    axes.axvline(1.0, color=INK, linewidth=1)
    colours = np.where(shown <= 1, BLUE, VERMILION)
    axes.scatter(shown, np.arange(len(names)), c=colours.tolist(), s=36, zorder=3)
    return figure


def _plain_ticks(axis: Axis, low: float, high: float) -> None:
    """Write plain numbers 1, 2, 5, 10 … along a logarithmic axis, fewer where it is long."""
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    leading = (1, 2, 5) if np.log10(high / low) < 2.5 else (1,)
    ticks = [lead * 10.0**k for k in decades for lead in leading]
    axis.set_major_locator(FixedLocator([x for x in ticks if low <= x <= high]))
    axis.set_major_formatter(FuncFormatter(lambda x, _: format_number(x, 2)))
    axis.set_minor_locator(NullLocator())
