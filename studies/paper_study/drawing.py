"""Figures of the studies, as functions of arrays and labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report import COLOURS, canvas, drawn

_LINES = ("blue", "vermilion", "green", "purple", "amber", "sky")


@drawn
def draw_lines(
    x: Array, lines: Mapping[str, tuple[Array, Array]], title: str, x_label: str, y_label: str
) -> Figure:
    """Draw mean ± sd of some quantities over x.

    Parameters
    ----------
    x : (k,)
    lines : mapping
        Label → means and standard deviations, each (k,).
    title, x_label, y_label : str
    """
    figure, (axes,) = canvas(440, 320, (56, 12, 70, 40))
    for colour, (label, (mean, sd)) in zip(_LINES, lines.items(), strict=False):
        axes.errorbar(
            x, mean, sd, fmt="o-", color=COLOURS[colour], markersize=5, capsize=3, label=label
        )
    axes.set_ylim(bottom=0)
    axes.set_title(title, pad=42)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    return figure


@drawn
def draw_parts(t: Array, parts: Mapping[str, Array], title: str) -> Figure:
    """Draw several forces of one leg over time.

    Parameters
    ----------
    t : (N,) [s]
    parts : mapping
        Label → force (N,) [N].
    title : str
    """
    figure, (axes,) = canvas(440, 320, (66, 12, 70, 40))
    for colour, (label, force) in zip(_LINES, parts.items(), strict=False):
        axes.plot(t, force, color=COLOURS[colour], label=label)
    axes.set_title(title, pad=42)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("force [N]")
    axes.set_xlim(float(t[0]), float(t[-1]))
    return figure


@drawn
def draw_bars(
    names: Sequence[str], groups: Mapping[str, Array], title: str, y_label: str
) -> Figure:
    """Draw bars of several groups side by side.

    Parameters
    ----------
    names : sequence of str
        Below the bars.
    groups : mapping
        Label → heights, (len(names),).
    title, y_label : str
    """
    figure, (axes,) = canvas(440, 300, (56, 12, 70, 40))
    width = 0.8 / len(groups)
    at = np.arange(len(names))
    for k, (label, heights) in enumerate(groups.items()):
        shift = (k - (len(groups) - 1) / 2) * width
        axes.bar(at + shift, heights, 0.9 * width, color=COLOURS[_LINES[k]], label=label)
    axes.set_xticks(at, list(names))
    axes.grid(visible=False, axis="x")
    axes.set_title(title, pad=42)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    axes.set_xlabel("model")
    axes.set_ylabel(y_label)
    return figure
