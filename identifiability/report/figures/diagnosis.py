"""The gap between model and data: over time, against the motion, and what closes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.shares import REACH
from identifiability.report.drawing import (
    COLOURS,
    INK,
    MUTED,
    canvas,
    dots,
    drawn,
    label_width,
    plain,
    thin,
)
from identifiability.report.figures.residuals import binned_median

#: Points of a scatter.
POINTS = 500


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
    axes.plot(*thin(t, before, 800), color=COLOURS["vermilion"], linewidth=1.1, label="before")
    axes.plot(*thin(t, after, 800), color=COLOURS["blue"], linewidth=1.1, label="after")
    axes.set_title(plain(title, 44), pad=26, color=INK, fontweight="bold")
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"residual [{unit}]")
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
    rows = np.unique(np.linspace(0, len(x) - 1, POINTS).astype(int))
    dots(axes, x[rows], before[rows], MUTED, 2.4, 0.4)
    for y, colour, label in ((before, "vermilion", "before"), (after, "blue", "after")):
        axes.plot(*binned_median(x, y, 14), color=COLOURS[colour], marker="o", markersize=3.5,
                  linewidth=1.5, label=label)  # fmt: skip
    axes.set_title(plain(title, 36), color=INK, fontweight="bold")
    axes.locator_params(nbins=5)
    axes.set_xlabel(f"{what} [{units[0]}]")
    axes.set_ylabel(f"residual [{units[1]}]")
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
        axes.plot(np.maximum(ratio, 0.02), at, "o", markersize=6, linestyle="none",
                  color=COLOURS[palette[s % len(palette)]], label=f"step {s + 1}")  # fmt: skip
    axes.axvline(1.0, color=INK, linewidth=1, linestyle=(0, (4, 3)))
    axes.set_xscale("log")
    axes.set_yticks(range(len(names)), [plain(n) for n in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("evidence / limit of noise [–]")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=min(scores.shape[1], 6),
                handlelength=1, borderaxespad=0.2)  # fmt: skip
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
    left = label_width(names)
    figure, (axes,) = canvas(max(460.0, left + 280), 70 + 28 * len(names), (left, 60, 14, 40))
    at = np.arange(len(names))
    axes.barh(at, 100 * errors, height=0.55, color=COLOURS["blue"], alpha=0.75)
    for k, e in enumerate(errors):
        axes.annotate(f"{100 * e:.3g} %", (100 * e, k), (5, 0), textcoords="offset points",
                      va="center", color=INK)  # fmt: skip
    axes.set_yticks(at, [plain(n) for n in names])
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
    rows = np.unique(np.linspace(0, len(x) - 1, POINTS).astype(int))
    dots(axes, x[rows], data[rows], MUTED, 2.4, 0.4)
    order = np.argsort(x)
    low, high = learned - REACH * spread, learned + REACH * spread
    axes.fill_between(x[order], low[order], high[order], color=COLOURS["blue"], alpha=0.2,
                      linewidth=0, label="95 %")  # fmt: skip
    axes.plot(x[order], learned[order], color=COLOURS["blue"], linewidth=1.2, label="learned")
    axes.set_title(plain(title, 44), pad=26, color=INK, fontweight="bold")
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
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
    for share, colour, label in ((before, "vermilion", "before"), (after, "blue", "after")):
        low, middle, high = 100 * np.quantile(share, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=COLOURS[colour], alpha=0.18, linewidth=0)
        axes.plot(t, middle, color=COLOURS[colour], linewidth=1.8, label=label)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlim(0, float(t[-1]))
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time since the start of a stretch [s]")
    axes.set_ylabel("position error [%]")
    return figure
