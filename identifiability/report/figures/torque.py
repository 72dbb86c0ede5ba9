"""Measured against predicted torque along time."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import COLOURS, INK, MUTED, canvas, drawn, plain, thin


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
    _plot(above, t, measured, most, color=MUTED, linewidth=3, alpha=0.45, label="measured")
    _plot(above, t, predicted, most, color=COLOURS["blue"], linewidth=1.3, label="predicted")
    above.set_ylabel(f"torque [{unit}]" if "m" in unit else f"force [{unit}]")
    above.set_title(plain(title, 44), pad=26, color=INK, fontweight="bold")
    above.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    residual = measured - predicted
    below.axhline(0, color=MUTED, linewidth=0.8)
    _plot(below, t, residual, most, color=COLOURS["vermilion"], linewidth=0.9)
    below.set_ylabel(f"residual [{unit}]")
    below.set_xlabel("time [s]")
    if len(t) > 1 and t[-1] > t[0]:
        below.set_xlim(float(t[0]), float(t[-1]))
    for axes in (above, below):
        axes.locator_params(axis="y", nbins=5 if axes is above else 3)
    figure.align_ylabels([above, below])
    return figure


def _plot(axes: Axes, t: Array, y: Array, most: int, **style: Any) -> None:
    """Draw a thinned line that is broken where samples are missing."""
    for k, (start, stop) in enumerate(find_runs(t)):
        share = max(2, most * (stop - start) // len(t))
        if k:
            style["label"] = None
        axes.plot(*thin(t[start:stop], y[start:stop], share), **style)


def find_runs(t: Array) -> list[tuple[int, int]]:
    """Return stretches without gaps as (start, stop); a gap is three times the usual step."""
    step = np.diff(t)
    breaks = np.flatnonzero(step > 3 * np.median(step)) + 1 if len(step) else np.empty(0, int)
    edges = [0, *breaks.tolist(), len(t)]
    return list(pairwise(edges))


def choose_stretch(t: Array, longest: float = 10.0) -> slice:
    """Return the middle `longest` seconds of a log, or all of a shorter one."""
    if len(t) < 2 or t[-1] - t[0] <= longest:
        return slice(0, len(t))
    start = 0.5 * (t[0] + t[-1] - longest)
    first = int(np.searchsorted(t, start))
    return slice(first, max(first + 2, int(np.searchsorted(t, start + longest))))
