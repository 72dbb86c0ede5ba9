"""What figures share: rows with names, scales, legends, labels, whiskers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    BLUE,
    INK,
    LINE,
    MARKED,
    canvas,
    label_width,
    plain,
    strokes,
)
from identifiability.report.numbers import superscript

WIDTH = 440
ROW = 19

#: Look of limits and of what is compared with.
DASHED: Any = {"linewidth": 1, "linestyle": (0, (4, 3))}


def row_canvas(
    names: Sequence[str], row: float = ROW, top: float = 40, right: float = 14, xlabel: str = ""
) -> tuple[Figure, Axes]:
    """Return axes with one labelled row for each name, the first on top."""
    count = max(len(names), 1)
    bottom = 38
    left = min(label_width(names), 0.45 * WIDTH)
    figure, (axes,) = canvas(WIDTH, top + bottom + row * count, (left, right, top, bottom))
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_yticks(range(len(names)), [plain(n) for n in names], color=INK)
    for label, name in zip(axes.get_yticklabels(), names, strict=True):
        label.set_gid(MARKED + quote(name, safe=""))  # it is not escaped in SVG
    axes.tick_params(axis="y", pad=6)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    axes.set_xlabel(xlabel)
    return figure, axes


def row_lines(axes: Axes, count: int) -> None:
    """Draw a faint line along each row, for the eye to follow."""
    low, high = axes.get_xlim()
    at = np.arange(count, dtype=float)
    first, last = (np.stack([np.full(count, x), at], 1) for x in (low, high))
    strokes(axes, first, last, LINE, linewidth=0.6, zorder=0)


def label_axes(
    axes: Axes, x: str, y: str, title: str = "", most: int = 44, pad: float | None = None
) -> None:
    """Write what the axes are, and a bold title of at most so many letters, `pad` above them."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(plain(title, most), pad=pad, color=INK, fontweight="bold")


def legend_above(axes: Axes, **style: Any) -> None:
    """Write a legend of two columns above the axes."""
    above: Any = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 2, "borderaxespad": 0.2}
    axes.legend(**above | style)


def write_near(
    axes: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **style: Any
) -> None:
    """Write a text some points beside a place, centred at its height."""
    usual: Any = {"color": INK, "fontsize": 10.5, "va": "center", "textcoords": "offset points"}
    axes.annotate(text, at, shift, **usual | style)


def write_beside(
    axes: Axes, texts: Sequence[str], x: Sequence[float] | Array, **style: Any
) -> None:
    """Write a text right of the end of each row's bar or mark."""
    for row, (text, end) in enumerate(zip(texts, x, strict=True)):
        write_near(axes, text, (end, row), (6, 0), **{"annotation_clip": False} | style)


def whiskers(axes: Axes, x: Array, y: Array, reach: Any, **style: Any) -> None:
    """Draw points with errors along x, by default large blue ones with caps."""
    large: Any = {"color": BLUE, "markersize": 7, "elinewidth": 2, "capsize": 3}
    axes.errorbar(x, y, xerr=reach, fmt="o", **large | style)


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Make x logarithmic from `low` to `high`, with plain numbers at (some) powers of ten."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    first, last = int(np.ceil(np.log10(low) - 1e-9)), int(np.floor(np.log10(high) + 1e-9))
    step = max(1, -(-(last - first) // 6))
    set_powers(axes.xaxis, range(first, last + 1, step))


def set_powers(axis: Axis, powers: Sequence[int]) -> None:
    """Let a logarithmic axis show some powers of ten and nothing between."""
    axis.set_major_locator(FixedLocator([10.0**k for k in powers]))
    axis.set_major_formatter(FuncFormatter(lambda x, _: power_of_ten(x)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def power_of_ten(x: float) -> str:
    """Return a power of ten as a plain number where that is short, else as 10ⁿ."""
    power = round(np.log10(x)) if x > 0 else 0
    if -3 <= power <= 4:
        return f"{10.0**power:.{max(0, -power)}f}"
    return "10" + superscript(power)


def top_label(axes: Axes, x: float, text: str, colour: str, level: int = 0) -> None:
    """Write above a vertical line, near enough to it and inside the axes' width."""
    low, high = axes.get_xlim()
    log = axes.get_xscale() == "log"
    share = (np.log(x / low) / np.log(high / low)) if log else (x - low) / (high - low)
    align = "right" if share > 0.8 else "left" if share < 0.2 else "center"
    place: Any = {"xycoords": ("data", "axes fraction"), "ha": align, "va": "bottom"}
    write_near(axes, text, (x, 1), (0, 5 + 14 * level), color=colour, **place)
