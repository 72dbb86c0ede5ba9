"""Which parameters are confused with each other, and what the torque is spent on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    GREY,
    INK,
    LINE,
    MUTED,
    VERMILION,
    canvas,
    drawn,
    label_width,
    plain,
)
from identifiability.report.figures.axes import legend_above, row_canvas, row_lines

#: Side of a cell of the map, and the most parameters that it holds [px].
CELL, MOST = 17, 30

#: Parameters are confused where the absolute correlation of their estimates is above this.
CONFUSED = 0.7

#: Colours of the parts of the torque, in their order.
PART_COLOURS = (BLUE, COLOURS["green"], COLOURS["amber"], VERMILION)


def order_confused(correlation: Array, most: int = MOST) -> np.ndarray:
    """Return parameters with a partner above `CONFUSED`, those of one group beside each other.

    Groups are connected by such pairs; if there are too many, the strongest groups are returned.

    Parameters
    ----------
    correlation : (k, k)
    most : int
    """
    strong = np.abs(np.nan_to_num(correlation)) > CONFUSED
    np.fill_diagonal(strong, False)
    _, group = scipy.sparse.csgraph.connected_components(strong, directed=False)
    size = np.abs(np.nan_to_num(correlation)) * strong
    groups = [np.flatnonzero(group == g) for g in range(int(group.max(initial=-1)) + 1)]
    groups = sorted((g for g in groups if len(g) > 1), key=lambda g: -float(size[g].max()))
    kept: list[int] = []
    for g in groups:
        kept += g.tolist()
    return np.array(kept[:most], int)


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
def draw_budget(
    joints: Sequence[str], shares: Array, parts: Sequence[str], whole: Sequence[str]
) -> Figure:
    """Draw the rms of each part of the torque over that of all of it, one group a joint.

    Parameters
    ----------
    joints : sequence of str
    shares : (n, parts)
    parts : sequence of str
    whole : sequence of str
        What all of each joint's torque is, with its unit.
    """
    names = [f"{j}  ({w})" for j, w in zip(joints, whole, strict=True)]
    figure, axes = row_canvas(names, 46, 52, xlabel="rms, of that of the measured torque [%]")
    height = 0.8 / len(parts)
    axes.set_xlim(0, 108 * max(1.0, float(np.nanmax(shares, initial=0.0))))
    row_lines(axes, len(joints))
    for p, part in enumerate(parts):
        at = np.arange(len(joints)) - 0.4 + height * (p + 0.5)
        colour = PART_COLOURS[p] if p < len(PART_COLOURS) else GREY
        axes.barh(at, 100 * shares[:, p], 0.86 * height, color=colour, label=part)
    axes.axvline(100, color=MUTED, linewidth=1)
    legend_above(axes, ncols=2, handlelength=0.9)
    return figure
