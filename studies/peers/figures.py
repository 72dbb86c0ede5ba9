"""Figures of benchmarks: time and memory against samples, and the phases of the time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from identifiability.foundation.rounding import format_number
from identifiability.report.figures import (
    COLOURS,
    INK,
    MUTED,
    canvas,
    drawn,
    for_svg,
    log_scale,
    row_canvas,
)

Array = Any

#: Colour and marker of the first, second … contender.
LOOKS = (
    ("blue", "o"), ("grey", "s"), ("vermilion", "^"), ("amber", "v"), ("purple", "D"),
)  # fmt: skip

#: Colours of phases, in their order.
PHASES = ("grey", "sky", "amber", "green", "purple", "vermilion")


@drawn
def draw_growth(
    lines: Mapping[str, tuple[Array, Array]], unit: str, bound: tuple[float, str] | None = None
) -> Figure:
    """Draw a quantity against the number of samples, both logarithmic.

    Parameters
    ----------
    lines : mapping of name to (samples, values), (k,) each
    unit : str
        What the values are, for the axis.
    bound : (float, str), optional
        A level and its name.
    """
    top = 20 + 17 * -(-len(lines) // 2)
    figure, (axes,) = canvas(440, 260 + top, (62, 20, top, 40))
    for (name, (n, y)), (colour, marker) in zip(lines.items(), LOOKS, strict=False):
        axes.plot(n, y, marker, color=COLOURS[colour], linestyle="-", markersize=6, label=name)
    if bound is not None:
        axes.axhline(bound[0], color=INK, linewidth=1, linestyle=(0, (4, 3)))
        axes.annotate(
            bound[1], (1, bound[0]), (-2, 3), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right", color=INK, fontsize=10.5,
        )  # fmt: skip
    samples = np.concatenate([n for n, _ in lines.values()])
    values = np.concatenate([y for _, y in lines.values()])
    log_scale(axes, 0.7 * samples.min(), 1.4 * samples.max())
    _log_y(axes, values if bound is None else np.append(values, bound[0]))
    axes.set_xlabel("samples [–]")
    axes.set_ylabel(unit)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.02, 1), ncols=2, handletextpad=0.4)
    return figure


def _log_y(axes: Axes, values: Array) -> None:
    low, high = 0.7 * float(np.min(values)), 1.5 * float(np.max(values))
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    between = [1.0, 2.0, 5.0] if high < 100 * low else [1.0]  # few powers of ten are few marks
    axes.yaxis.set_major_locator(FixedLocator([f * p for p in powers for f in between]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: mark(y)))
    axes.yaxis.set_minor_locator(NullLocator())


def mark(y: float) -> str:
    """Return a number at an axis."""
    return format_number(y, 2)


def times_faster(ratio: float) -> str:
    """Return a ratio with its significant digits."""
    return f"{ratio:.1f}" if ratio < 20 else f"{ratio:.0f}"


@drawn
def draw_phases(
    names: Sequence[str], phases: Mapping[str, Array], unit: str = "time [s]"
) -> Figure:
    """Draw the phases of the time of every contender, one bar each.

    Parameters
    ----------
    names : sequence of str
        Contenders.
    phases : mapping of name to (len(names),) [s]
    unit : str
    """
    top = 20 + 17 * -(-len(phases) // 2)
    figure, axes = row_canvas(names, 34, top, 40)
    start, rows = np.zeros(len(names)), np.arange(len(names))
    for (name, spent), colour in zip(phases.items(), PHASES, strict=False):
        axes.barh(rows, spent, 0.6, left=start, color=COLOURS[colour], label=name, linewidth=0)
        start = start + spent
    for row, total in enumerate(start):
        axes.annotate(
            f"{total:.3g}", (total, row), (4, 0), textcoords="offset points", va="center",
            color=INK, fontsize=10.5,
        )  # fmt: skip
    axes.set_xlim(0, 1.12 * float(start.max()))
    axes.set_xlabel(unit)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.4)
    return figure


@drawn
def draw_pairs(names: Sequence[str], ours: Array, naive: Array, unit: str = "time [s]") -> Figure:
    """Draw two times a row, ours and the naive form's, with their ratio.

    Parameters
    ----------
    names : sequence of str
    ours, naive : (k,) [s]
    unit : str
    """
    figure, axes = row_canvas(names, 32, 40, 60)
    rows = np.arange(len(names))
    axes.plot(naive, rows, "x", color=COLOURS["vermilion"], markersize=7, label="naive form")
    axes.plot(ours, rows, "o", color=COLOURS["blue"], markersize=7, label="ours")
    for row, (a, b) in enumerate(zip(ours, naive, strict=True)):
        axes.plot([a, b], [row, row], color=MUTED, linewidth=1, zorder=0)
        axes.annotate(
            for_svg(f"{times_faster(b / a)} ×"), (1, row), (6, 0),
            xycoords=("axes fraction", "data"), textcoords="offset points", va="center",
            color=INK, fontsize=10.5,
        )  # fmt: skip
    every = np.concatenate([ours, naive])
    log_scale(axes, 0.6 * float(every.min()), 1.7 * float(every.max()))
    axes.set_xlabel(unit)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handletextpad=0.3)
    return figure
