"""What a model leaves: its distribution, its memory, and where it sits."""

from __future__ import annotations

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
    plain,
)

_SPAN = 4.5


@drawn
def draw_histogram(standardized: Array) -> Figure:
    """Draw the distribution of residuals in units of their joint's σ beside the normal curve."""
    figure, (axes,) = canvas(440, 270, (52, 12, 34, 38))
    edges = np.linspace(-_SPAN, _SPAN, 46)
    inside = np.clip(standardized[np.isfinite(standardized)], -_SPAN, _SPAN)
    if len(inside):
        density, _ = np.histogram(inside, edges, density=True)
        axes.stairs(density, edges, fill=True, color=COLOURS["blue"], alpha=0.3, label="residuals")
    z = np.linspace(-_SPAN, _SPAN, 121)
    normal = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    axes.plot(z, normal, color=INK, linewidth=1.2, label="normal distribution")
    axes.set_xlim(-_SPAN, _SPAN)
    axes.set_ylim(bottom=0)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlabel("residual of a joint over its standard deviation [–]")
    axes.set_ylabel("density [–]")
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
    axes.axhspan(-band, band, color=COLOURS["grey"], alpha=0.16, linewidth=0, label="white noise")
    for joint in range(correlation.shape[1]):
        if joint != worst:
            axes.plot(lags, correlation[:, joint], color=MUTED, linewidth=0.9, alpha=0.55)
    axes.plot(
        lags,
        correlation[:, worst],
        color=COLOURS["vermilion"],
        linewidth=1.6,
        label=plain(f" {name}"),
    )
    axes.axhline(0, color=MUTED, linewidth=0.8)
    axes.set_xlim(0, max(len(lags) - 1, 1))
    axes.legend(
        loc="lower left", bbox_to_anchor=(0, 1), ncols=2, handlelength=1.4, borderaxespad=0.2
    )
    axes.set_xlabel("lag [samples]")
    axes.set_ylabel("autocorrelation [–]")
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
        rows = np.unique(np.linspace(0, len(velocity) - 1, most).astype(int))
        dots(axes, velocity[rows], residual[rows], MUTED, 2.6, 0.4)
        x, y = binned_median(velocity, residual)
        axes.plot(x, y, color=COLOURS["vermilion"], marker="o", markersize=4, linewidth=1.6)
    axes.set_title(plain(title, 36), color=INK, fontweight="bold")
    axes.locator_params(nbins=5)
    axes.set_xlabel(f"velocity [{units[0]}]")
    axes.set_ylabel(f"residual [{units[1]}]")
    return figure


def binned_median(x: Array, y: Array, bins: int = 10) -> tuple[Array, Array]:
    """Return the medians of x and y in bins of x that hold equally many points."""
    order = np.argsort(x, kind="stable")
    parts = [p for p in np.array_split(order, min(bins, len(x))) if len(p)]
    return np.array([np.median(x[p]) for p in parts]), np.array([np.median(y[p]) for p in parts])
