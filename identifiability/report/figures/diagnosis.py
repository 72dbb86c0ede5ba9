"""The gap between model and data: over time, against the motion, and what closes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    INK,
    MUTED,
    VERMILION,
    canvas,
    dots,
    drawn,
    label_width,
    plain,
    thin,
)
from identifiability.report.figures.axes import DASHED, label_axes, legend_above, write_near
from identifiability.report.figures.motion import binned_median, spread_rows

#: Points of a scatter.
POINTS = 500

#: Letters of a row label that names an effect.
TITLE = 44

#: Colour and name of the model as it was, and of the one with the named effects.
STATES = ((VERMILION, "before"), (BLUE, "after"))


@drawn
def draw_gap(t: Array, before: Array, after: Array, title: str, unit: str) -> Figure:
    """Draw the residual of a joint over time, of the model as it was and with the named effects.

    Parameters
    ----------
    t : (N,) [s]
    before, after : (N,) [unit]
    title, unit : str
    """
    figure, (axes,) = canvas(400, 230, (60, 10, 50, 38))
    axes.axhline(0, color=MUTED, linewidth=0.8)
    for y, (colour, label) in zip((before, after), STATES, strict=True):
        axes.plot(*thin(t, y, 800), color=colour, linewidth=1.1, label=label)
    legend_above(axes, handlelength=1.4)
    label_axes(axes, "time [s]", f"residual [{unit}]", title, pad=26)
    return figure


@drawn
def draw_against(
    x: Array, before: Array, after: Array, title: str, units: tuple[str, str], what: str
) -> Figure:
    """Draw medians of the residual over velocity, position or load, before and after.

    Parameters
    ----------
    x, before, after : (N,)
    title : str
    units : (str, str)
        Of x and of the residual.
    what : str
        What x is.
    """
    figure, (axes,) = canvas(300, 230, (60, 10, 30, 38))
    axes.axhline(0, color=MUTED, linewidth=0.8)
    rows = spread_rows(len(x), POINTS)
    dots(axes, x[rows], before[rows], MUTED, 2.4, 0.4)
    for y, (colour, _) in zip((before, after), STATES, strict=True):
        joined: Any = {"color": colour, "marker": "o", "markersize": 3.5, "linewidth": 1.5}
        axes.plot(*binned_median(x, y, 14), **joined)
    axes.locator_params(nbins=5)
    label_axes(axes, f"{what} [{units[0]}]", f"residual [{units[1]}]", title, 36)
    return figure


@drawn
def draw_evidence(names: Sequence[str], scores: Array, critical: Array) -> Figure:
    """Draw the evidence for every family at every step, as a multiple of the family-wise limit.

    Parameters
    ----------
    names : sequence of str
        Of the F families.
    scores : (F, S)
        Best score of a family at each step; nan where it was not a candidate.
    critical : (S,)
        Score that noise alone exceeds with the family-wise level.
    """
    left = label_width(names)
    height = 70 + 26 * len(names)
    figure, (axes,) = canvas(max(520.0, left + 320), height, (left, 16, 30, 42))
    palette = ("vermilion", "blue", "green", "amber", "purple", "sky")
    for s in range(scores.shape[1]):
        ratio = scores[:, s] / critical[s]
        at = np.arange(len(names)) + 0.12 * (s - 0.5 * (scores.shape[1] - 1))
        colour = COLOURS[palette[s % len(palette)]]
        axes.plot(
            np.maximum(ratio, 0.02), at, "o", markersize=6, color=colour, label=f"step {s + 1}"
        )
    axes.axvline(1.0, color=INK, **DASHED)
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), [plain(n) for n in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("evidence / limit of noise [–]")
    legend_above(axes, ncols=min(scores.shape[1], 6), handlelength=1)
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
    left = label_width(names, TITLE)
    figure, (axes,) = canvas(max(460.0, left + 280), 70 + 28 * len(names), (left, 60, 14, 40))
    at = np.arange(len(names))
    axes.barh(at, 100 * errors, height=0.55, color=BLUE, alpha=0.75)
    for k, e in enumerate(100 * errors):
        write_near(axes, f"{e:.3g} %", (e, k), (5, 0), fontsize=11)
    axes.set_yticks(at, [plain(n, TITLE) for n in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("error on unseen motion [%]")
    return figure


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
    dots(axes, x[rows], data[rows], MUTED, 2.4, 0.4)
    order = np.argsort(x)
    low, high = learned - REACH * spread, learned + REACH * spread
    band: Any = {"color": BLUE, "alpha": 0.2, "linewidth": 0, "label": "95 %"}
    axes.fill_between(x[order], low[order], high[order], **band)
    axes.plot(x[order], learned[order], color=BLUE, linewidth=1.2, label="learned")
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
