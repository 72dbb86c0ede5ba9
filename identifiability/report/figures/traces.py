"""What a log holds of a joint: position, velocity and torque over time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.drawing import BLUE, COLOURS, MUTED, VERMILION, canvas, drawn
from identifiability.report.figures.axes import DASHED, label_axes
from identifiability.report.figures.motion import plot_runs

#: Points that a line keeps.
MOST = 1200

#: A limit is drawn if the motion comes nearer to it than this share of its own range.
NEAR = 0.25


@drawn
def draw_traces(
    position: tuple[Array, Array],
    velocity: tuple[Array, Array],
    torque: tuple[Array, Array],
    title: str,
    units: tuple[str, str],
    limits: tuple[float, float],
) -> Figure:
    """Draw position, velocity and torque of a joint.

    Parameters
    ----------
    position, velocity, torque : ((N,), (N,))
        Times from the beginning of the log [s], and values; velocity may be empty.
    title : str
    units : (str, str)
        Of position and torque.
    limits : (float, float)
        Of position; NaN or infinite without.
    """
    figure, axes = canvas(400, 330, (66, 10, 34, 38), (1, 1, 1))
    for ax, (t, y), colour in zip(
        axes, (position, velocity, torque), (BLUE, COLOURS["green"], VERMILION), strict=True
    ):
        if len(t):
            plot_runs(ax, t, y, MOST, color=colour, linewidth=1.1)
        ax.locator_params(axis="y", nbins=4)
    _draw_limits(axes[0], position[1], limits)
    label_axes(axes[0], "", f"q [{units[0]}]", title)
    label_axes(axes[1], "", f"q̇ [{units[0]}/s]")
    label_axes(axes[2], "time [s]", f"τ [{units[1]}]" if "m" in units[1] else f"f [{units[1]}]")
    if len(position[0]) > 1:
        axes[2].set_xlim(float(position[0][0]), float(position[0][-1]))
    figure.align_ylabels(axes)
    return figure


def _draw_limits(axes: Axes, q: Array, limits: tuple[float, float]) -> None:
    """Draw the limits that the motion comes near to."""
    span = float(np.ptp(q)) or 1.0
    for limit, end in zip(limits, (float(q.min()), float(q.max())), strict=True):
        if np.isfinite(limit) and abs(limit - end) < NEAR * span:
            axes.axhline(limit, color=MUTED, **DASHED)
