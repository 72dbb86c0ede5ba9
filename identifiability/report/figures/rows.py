"""What figures with one row a parameter or a model share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from identifiability.report.drawing import INK, LINE, canvas, label_width, plain, strokes

WIDTH = 440
ROW = 19


def row_canvas(
    names: Sequence[str], row: float = ROW, top: float = 40, right: float = 14
) -> tuple[Figure, Axes]:
    """Return axes with one labelled row for each name, the first on top."""
    count = max(len(names), 1)
    bottom = 38
    left = min(label_width(names), 0.45 * WIDTH)
    figure, (axes,) = canvas(WIDTH, top + bottom + row * count, (left, right, top, bottom))
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_yticks(range(len(names)), [plain(n) for n in names], color=INK)
    axes.tick_params(axis="y", pad=6)
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    return figure, axes


def row_lines(axes: Axes, count: int) -> None:
    """Draw a faint line along each row, for the eye to follow."""
    low, high = axes.get_xlim()
    at = np.arange(count, dtype=float)
    first, last = (np.stack([np.full(count, x), at], 1) for x in (low, high))
    strokes(axes, first, last, LINE, linewidth=0.6, zorder=0)


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Make x logarithmic from `low` to `high`, with plain numbers at (some) powers of ten."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    first, last = int(np.ceil(np.log10(low) - 1e-9)), int(np.floor(np.log10(high) + 1e-9))
    step = max(1, -(-(last - first) // 6))
    axes.xaxis.set_major_locator(FixedLocator([10.0**k for k in range(first, last + 1, step)]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: power_of_ten(x)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())


def power_of_ten(x: float) -> str:
    """Return a power of ten as a plain number where that is short, else as 10ⁿ."""
    power = round(np.log10(x)) if x > 0 else 0
    if -3 <= power <= 4:
        return f"{10.0**power:.{max(0, -power)}f}"
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def top_label(axes: Axes, x: float, text: str, colour: str, level: int = 0) -> None:
    """Write above a vertical line, near enough to it and inside the axes' width."""
    low, high = axes.get_xlim()
    log = axes.get_xscale() == "log"
    share = (np.log(x / low) / np.log(high / low)) if log else (x - low) / (high - low)
    align = "right" if share > 0.8 else "left" if share < 0.2 else "center"
    axes.annotate(
        text, (x, 1), (0, 5 + 14 * level), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha=align, va="bottom", color=colour, fontsize=10.5,
    )  # fmt: skip
