"""Torque along the motion, measured and predicted, and what a model leaves of it."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.report.drawing import (
    BLUE,
    GREY,
    INK,
    MUTED,
    VERMILION,
    canvas,
    dots,
    drawn,
    plain,
    thin,
)
from identifiability.report.figures.axes import label_axes, legend_above

_SPAN = 4.5


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
    plot_runs(above, t, measured, most, color=MUTED, linewidth=3, alpha=0.45, label="measured")
    plot_runs(above, t, predicted, most, color=BLUE, linewidth=1.3, label="predicted")
    label_axes(above, "", f"torque [{unit}]" if "m" in unit else f"force [{unit}]", title, pad=26)
    legend_above(above, handlelength=1.4)
    below.axhline(0, color=MUTED, linewidth=0.8)
    plot_runs(below, t, measured - predicted, most, color=VERMILION, linewidth=0.9)
    label_axes(below, "time [s]", f"residual [{unit}]")
    if len(t) > 1 and t[-1] > t[0]:
        below.set_xlim(float(t[0]), float(t[-1]))
    above.locator_params(axis="y", nbins=5)
    below.locator_params(axis="y", nbins=3)
    figure.align_ylabels([above, below])
    return figure


def plot_runs(axes: Axes, t: Array, y: Array, most: int, **style: Any) -> None:
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
    return list(pairwise([0, *breaks.tolist(), len(t)]))


def choose_stretch(t: Array, longest: float = 10.0) -> slice:
    """Return the middle `longest` seconds of a log, or all of a shorter one."""
    if len(t) < 2 or t[-1] - t[0] <= longest:
        return slice(0, len(t))
    start = 0.5 * (t[0] + t[-1] - longest)
    first = int(np.searchsorted(t, start))
    return slice(first, max(first + 2, int(np.searchsorted(t, start + longest))))


@drawn
def draw_histogram(standardized: Array) -> Figure:
    """Draw the distribution of residuals in units of their joint's σ beside the normal curve."""
    figure, (axes,) = canvas(440, 270, (52, 12, 34, 38))
    edges = np.linspace(-_SPAN, _SPAN, 46)
    inside = np.clip(standardized[np.isfinite(standardized)], -_SPAN, _SPAN)
    if len(inside):
        density, _ = np.histogram(inside, edges, density=True)
        axes.stairs(density, edges, fill=True, color=BLUE, alpha=0.3, label="residuals")
    z = np.linspace(-_SPAN, _SPAN, 121)
    normal = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    axes.plot(z, normal, color=INK, linewidth=1.2, label="normal distribution")
    axes.set_xlim(-_SPAN, _SPAN)
    axes.set_ylim(bottom=0)
    legend_above(axes, handlelength=1.4)
    label_axes(axes, "residual of a joint over its standard deviation [–]", "density [–]")
    return figure


@drawn
def draw_autocorrelation(correlation: Array, worst: int, name: str, samples: int) -> Figure:
    """Draw the autocorrelation of residuals: the worst joint's in colour, the others' in grey.

    Parameters
    ----------
    correlation : (L, n)
        At lags 0 … L - 1.
    worst : int
    name : str
        Of the worst joint.
    samples : int
        The band holds 95 % of the values of white noise of this length.
    """
    figure, (axes,) = canvas(440, 270, (52, 12, 34, 38))
    lags = np.arange(len(correlation))
    band = REACH / np.sqrt(max(samples, 1))
    axes.axhspan(-band, band, color=GREY, alpha=0.16, linewidth=0, label="white noise")
    others = np.delete(correlation, worst, axis=1)
    axes.plot(lags, others, color=MUTED, linewidth=0.9, alpha=0.55)
    own = correlation[:, worst]
    axes.plot(lags, own, color=VERMILION, linewidth=1.6, label=plain(f" {name}"))
    axes.axhline(0, color=MUTED, linewidth=0.8)
    axes.set_xlim(0, max(len(lags) - 1, 1))
    legend_above(axes, handlelength=1.4)
    label_axes(axes, "lag [samples]", "autocorrelation [–]")
    return figure


@drawn
def draw_residual_velocity(
    velocity: Array, residual: Array, title: str, units: tuple[str, str], most: int = 700
) -> Figure:
    """Draw the residual of a joint over its velocity with the median of each tenth of the samples.

    Parameters
    ----------
    velocity, residual : (N,)
    title : str
    units : (str, str)
        Of velocity and residual.
    most : int
        Points that are drawn, evenly spaced in time.
    """
    figure, (axes,) = canvas(340, 250, (60, 10, 30, 38))
    known = np.isfinite(velocity) & np.isfinite(residual)
    velocity, residual = velocity[known], residual[known]
    axes.axhline(0, color=MUTED, linewidth=0.8)
    if len(velocity):
        rows = spread_rows(len(velocity), most)
        dots(axes, velocity[rows], residual[rows], MUTED, 2.6, 0.4)
        x, y = binned_median(velocity, residual)
        axes.plot(x, y, color=VERMILION, marker="o", markersize=4, linewidth=1.6)
    axes.locator_params(nbins=5)
    label_axes(axes, f"velocity [{units[0]}]", f"residual [{units[1]}]", title, 36)
    return figure


def spread_rows(count: int, most: int) -> np.ndarray:
    """Return at most so many of the rows 0 … count - 1, evenly spread."""
    return np.unique(np.linspace(0, count - 1, most).astype(int))


def binned_median(x: Array, y: Array, bins: int = 10) -> tuple[Array, Array]:
    """Return the medians of x and y in bins of x that hold equally many points."""
    order = np.argsort(x, kind="stable")
    parts = [p for p in np.array_split(order, min(bins, len(x))) if len(p)]
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])
