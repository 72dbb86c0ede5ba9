"""The way down: error against the number of parameters, and what survives resampling."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import COLOURS, INK, MUTED, canvas, drawn, plain
from identifiability.report.figures.rows import row_canvas

#: Errors beyond this many times the largest up to the chosen rung are cut off, to show the choice.
BEYOND = 1.4


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
        The rung to use, and the one with the least error by the criterion.
    """
    figure, (axes,) = canvas(720, 320, (62, 16, 40, 44))
    low = 100 * unseen - 100 * np.nan_to_num(spread)
    high = 100 * unseen + 100 * np.nan_to_num(spread)
    axes.fill_between(
        sizes, low, high, color=COLOURS["blue"], alpha=0.16, linewidth=0, label="± SE"
    )
    axes.plot(sizes, 100 * unseen, "o-", color=COLOURS["blue"], markersize=5, label="unseen motion")
    axes.plot(
        sizes, 100 * fitted, "o-", color=MUTED, fillstyle="none", markersize=4, linewidth=1,
        label="fitted motion",
    )  # fmt: skip
    axes.axvline(float(sizes[selected]), color=COLOURS["blue"], linewidth=1, linestyle=(0, (4, 3)))
    axes.annotate(
        f"use {int(sizes[selected])}", (float(sizes[selected]), 1.0), (4, 4),
        xycoords=("data", "axes fraction"), textcoords="offset points", color=INK,
        fontweight="bold", ha="left", va="bottom",
    )  # fmt: skip
    if least != selected:
        axes.plot(
            sizes[least], 100 * unseen[least], "o", color=COLOURS["amber"], markersize=9,
            fillstyle="none", label="least error",
        )  # fmt: skip
    shown = np.concatenate([unseen[: selected + 1], fitted[: selected + 1]])
    shown = shown[np.isfinite(shown)]
    if len(shown) and shown.max() > 0:
        axes.set_ylim(80 * float(shown.min()), 100 * BEYOND * float(shown.max()))
    axes.set_xlim(float(sizes.max()) + 0.8, float(sizes.min()) - 0.8)
    axes.legend(loc="upper left", ncols=4, bbox_to_anchor=(0, 1.14), borderaxespad=0)
    axes.set_xlabel("number of parameters [–]")
    axes.set_ylabel("relative torque error [%]")
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
    figure, axes = row_canvas([plain(n) for n in names], 22, right=58)
    rows = np.arange(len(names))
    for kept, colour, label in ((True, "blue", "in the chosen model"), (False, "grey", "pruned")):
        mine = np.flatnonzero(chosen == kept)
        if len(mine):
            axes.barh(rows[mine], 100 * share[mine], 0.62, color=COLOURS[colour], label=label)
    for row, x in zip(rows, share, strict=True):
        axes.annotate(
            f"{100 * x:.0f} %", (100 * x, row), (6, 0), textcoords="offset points", va="center",
            color=INK, fontsize=10, annotation_clip=False,
        )  # fmt: skip
    axes.set_xlim(0, 100)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)
    axes.set_xlabel("survives in [% of resampled logs]")
    return figure
