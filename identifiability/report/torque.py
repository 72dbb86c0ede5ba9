"""Torque along motion: measured against predicted, the gap between them, contributions.

What closes the gap, what the torque of each joint is made of, and which parameters are correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.estimation.noise import autocorrelation
from identifiability.estimation.torque_errors import loaded_joints
from identifiability.foundation.answers import Column, Table
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import digits, error_text, format_number, join
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import (
    Block,
    Fold,
    Gallery,
    Section,
    Trace,
    Traces,
    gallery,
    picture,
    section,
)
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    GREY,
    INK,
    LINE,
    MUTED,
    VERMILION,
    canvas,
    dots,
    drawn,
    label_axes,
    label_width,
    legend_above,
    peak_rows,
    plain,
    row_canvas,
    row_lines,
    thin,
    write_near,
)
from identifiability.robot.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import error_tables, model_title
from identifiability.workflows.answers import sentence
from identifiability.workflows.predict import PARTS, Fit, correlation_of, torque_budget

# Torque along the motion, measured and predicted, and what a model leaves of it.


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


# Which parameters are correlated with each other, and what torque consists of.


#: Side of a cell of the map, and the most parameters that it holds [px].
CELL, MOST = 17, 30

#: Parameters are correlated where the absolute correlation of their estimates is above this.
CONFUSED = 0.7

#: Colours of the parts of the torque, in their order.
PART_COLOURS = (BLUE, COLOURS["green"], COLOURS["amber"], VERMILION)


def order_correlated(correlation: Array, most: int = MOST) -> np.ndarray:
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


# The gap between model and data: over time, against the motion, and what closes it.


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
    dots(axes, x[rows], data[rows], MUTED, 3.0, 0.6)
    order = np.argsort(x)
    learned, spread = learned[order], spread[order]
    low, high = learned - REACH * spread, learned + REACH * spread
    band: Any = {"color": BLUE, "alpha": 0.2, "linewidth": 0, "label": "95 %"}
    axes.fill_between(x[order], low, high, **band)
    axes.plot(x[order], learned, color=BLUE, linewidth=1.2, label="learned")
    legend_above(axes, handlelength=1.4)
    label_axes(axes, *labels, title, pad=26)
    return figure


@drawn
def draw_named(
    x: Array, before: Array, after: Array, title: str, labels: tuple[str, str]
) -> Figure:
    """Draw what is left of torque over what names the effect, before and after, with its means.

    Parameters
    ----------
    x, before, after : (N,)
        Motion that was not fitted, and what two models leave of its torque.
    title : str
    labels : (str, str)
        Of the axes.
    """
    figure, (axes,) = canvas(400, 250, (60, 10, 50, 38))
    rows, order = spread_rows(len(x), POINTS), np.argsort(x)
    # Points of a line of means over a motion.
    parts = np.array_split(order, min(24, len(order)))
    middle = [float(np.median(x[part])) for part in parts]
    for left, (colour, label) in zip((before, after), STATES, strict=True):
        dots(axes, x[rows], left[rows], colour, 2.4, 0.35)
        axes.plot(middle, [left[p].mean() for p in parts], color=colour, lw=1.8, label=label)
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


# Measured against predicted torque on unseen motion, and what is left.


#: Joints that are shown at once; those beyond are folded.
SHOWN = 6

#: Points of all torque lines, and of all scatter plots, of a page.
LINE_POINTS, SCATTER_POINTS = 18_000, 5_000

#: Lags of the autocorrelation that are shown: least, most, and per autocorrelation time.
LAGS = (40, 400, 12.0)


def section_prediction(analysis: Analysis) -> Section:
    """Return measured and predicted torque of every joint along a stretch of unseen motion."""
    samples = unseen_samples(analysis)[0]
    times = analysis.held_out.t[0]
    first = analysis.held_out.series[: len(times)] == analysis.held_out.series[:1]
    part = choose_stretch(times[first])
    shown = times[part]
    return section(
        "analysis.prediction",
        torque_traces(analysis),
        Fold("Each joint as a picture", torque_pictures(analysis, part)),
        *error_tables(analysis),
        log=samples.name,
        span=f", t = {shown[0]:.3g} … {shown[-1]:.3g} s," if len(shown) > 1 else "",
        model=model_title(analysis.chosen),
        kind="a log that" if analysis.validation else "stretches of a log that",
        windows=_tell_windows(analysis),
    )


def _tell_windows(analysis: Analysis) -> str:
    """Return how many samples errors are of, where they are not of all."""
    for found in (analysis.held_out, analysis.fitted):
        if not found.whole:
            shown, total = f"{found.samples:,}", f"{found.total:,}"
            return sentence("analysis.windows", shown=shown, total=total)
    return ""


def torque_traces(analysis: Analysis) -> Traces:
    """Return the torque of each joint along the whole first unseen log, to zoom and read off."""
    out, m = analysis.held_out, analysis.selected
    t, whole = out.t[0], out.to_draw(m)
    most = max(300, LINE_POINTS // (2 * len(analysis.robot.joints)))
    groups = []
    joints, units = analysis.robot.joints, analysis.robot.torque_units
    for k in loaded_joints(out.rms):
        joint, unit = joints[k], units[k]
        measured, predicted = (x[: len(t), k] for x in whole)
        rows = peak_rows((measured, predicted, measured - predicted), most)
        lines = {"measured": measured, "predicted": predicted, "residual": measured - predicted}
        groups.append(Trace.of(joint, unit, t[rows], {n: y[rows] for n, y in lines.items()}))
    return Traces(tuple(groups), sentence("analysis.traces", log=unseen_samples(analysis)[0].name))


def torque_pictures(analysis: Analysis, part: slice) -> tuple[Block, ...]:
    """Return one picture for each joint over a part of the first unseen log."""
    joints, units = analysis.robot.joints, analysis.robot.torque_units
    out = analysis.held_out
    t = out.t[0][part]
    tau, predicted = (x[: len(out.t[0])][part] for x in out.to_draw(analysis.selected))
    errors = out.joint_error()[:, analysis.selected]
    most = int(np.clip(LINE_POINTS // (3 * len(joints)), 200, 1500))
    width = {1: 720, 2: 500}.get(len(joints), 400)
    pictures = []
    for k in loaded_joints(out.rms):
        joint = joints[k]
        title = f"{joint}, error {error_text(errors[k])}"
        figure = draw_torque(t, tau[:, k], predicted[:, k], title, units[k], most, width)
        pictures.append(picture("torque", figure, joint=joint))
    return fold_gallery(Gallery(tuple(pictures)))


def section_residuals(analysis: Analysis) -> Section:
    """Return distribution, memory and place of the residual."""
    return section("analysis.residuals", noise_pictures(analysis), *velocity_pictures(analysis))


def noise_pictures(analysis: Analysis) -> Gallery:
    """Return the distribution and the autocorrelation of the residual on the fitted motion."""
    fitted = analysis.fitted
    residual = fitted.residual[:, :, analysis.selected]
    rows = fitted.data.sum(0)
    centred = residual - residual.sum(0) / np.maximum(rows, 1)
    spread = np.sqrt((centred**2 * fitted.data).sum(0) / np.maximum(rows, 1))
    usable = fitted.data & (spread > 0)
    scaled = np.divide(centred, spread, out=np.full(centred.shape, np.nan), where=usable)
    times = analysis.chosen.autocorrelation_time
    worst = int(np.argmax(times))
    lags = int(np.clip(LAGS[2] * times[worst], *LAGS[:2]))
    correlation = mean_autocorrelation(residual, fitted.series, lags)
    memory = draw_autocorrelation(correlation, worst, analysis.robot.joints[worst], len(residual))
    histogram = draw_histogram(scaled.ravel())
    return Gallery((picture("histogram", histogram), picture("autocorrelation", memory)))


def mean_autocorrelation(residual: Array, series: np.ndarray, lags: int) -> Array:
    """Return the autocorrelation of each joint, averaged over series by length, (lags, n)."""
    parts = [residual[series == k] for k in np.unique(series)]
    lags = min(lags, max(min(len(p) for p in parts) // 3, 2))
    total = np.zeros((lags, residual.shape[1]))
    for part in parts:
        found = autocorrelation(part)[:lags]
        total[: len(found)] += len(part) * found
    mean: Array = total / len(residual)
    return mean


def velocity_pictures(analysis: Analysis) -> tuple[Block, ...]:
    """Return the residual on unseen motion over velocity, one picture for each joint."""
    out, robot = analysis.held_out, analysis.robot
    velocity = out.velocity
    measured, predicted = out.to_draw(analysis.selected)
    residual = measured - predicted
    speeds, forces = velocity_units(robot), robot.torque_units
    most = int(np.clip(SCATTER_POINTS // len(robot.joints), 150, 700))
    pictures = []
    for k, joint in enumerate(robot.joints):
        pair = velocity[:, k], residual[:, k]
        figure = draw_residual_velocity(*pair, joint, (speeds[k], forces[k]), most)
        pictures.append(picture("velocity", figure, joint=joint))
    return fold_gallery(gallery("velocity", pictures))


def fold_gallery(whole: Gallery) -> tuple[Block, ...]:
    """Return the first `SHOWN` pictures and a fold with those beyond."""
    rest = whole.pictures[SHOWN:]
    first = replace(whole, pictures=whole.pictures[:SHOWN])
    return (first, Fold(f"{len(rest)} more joints", (Gallery(rest),))) if rest else (first,)


# How torque and parameters hang together: the budget of each joint, the map of confusions.


def section_budget(fit: Fit, samples: Sequence[Prepared]) -> Section:
    """Return what each joint's torque consists of along some logs."""
    frame = torque_budget(fit, samples)
    frame = frame.iloc[loaded_joints(frame["measured"].to_numpy())]
    whole = frame["measured"].to_numpy()
    shares = frame[list(PARTS)].to_numpy() / np.where(whole > 0, whole, np.nan)[:, None]
    text = [f"{format_number(x, 3)} {unit}" for x, unit in zip(whole, frame["unit"], strict=True)]
    figure = draw_budget(list(frame["joint"]), shares, PARTS, text)
    own = (
        Column("joint"),
        Column("unit"),
        *(Column(name, digits(3)) for name in ("measured", *PARTS)),
    )
    table = Table.of("", own, frame.itertuples(index=False, name=None))
    return section("analysis.budget", picture("budget", figure), table)


def section_correlated(fit: Fit) -> Section:
    """Return the parameters whose estimates hang together, as a map and in words."""
    correlation = correlation_of(fit.covariance)
    at = order_correlated(correlation)
    if not len(at):
        text = f"None: no two estimates are correlated by more than {CONFUSED:g}."
        return section("analysis.correlated", text=text)
    names = [fit.names[k] for k in at]
    own = correlation[np.ix_(at, at)]
    figure = draw_confusion(names, own)
    return section("analysis.correlated", picture("correlated", figure), text=_words(names, own))


def _words(names: Sequence[str], correlation: Array) -> str:
    rows, columns = np.triu_indices(len(names), 1)
    rho = np.nan_to_num(correlation[rows, columns])
    # Pairs that are named in words.
    first = np.argsort(-np.abs(rho), kind="stable")[:3]
    pairs = [
        f"{names[rows[k]]} and {names[columns[k]]} ({format_number(float(rho[k]), 2)})"
        for k in first
        if abs(rho[k]) > CONFUSED
    ]
    most = " (the strongest groups are shown)" if len(names) == MOST else ""
    return (
        f"The logs tell these {len(names)} parameters apart worse than each from zero{most}. Most "
        f"correlated: {join(pairs)}. Where the correlation is near −1 their sum, near 1 their "
        "difference is known better than either of them; a motion that moves them apart helps."
    )


def unseen_samples(analysis: Analysis) -> tuple[Prepared, ...]:
    """Return the logs that held-out predictions are made on."""
    return analysis.validation or analysis.samples


def velocity_units(robot: Robot) -> tuple[str, ...]:
    """Return m/s or rad/s for each actuated joint."""
    return tuple("m/s" if robot.is_prismatic(int(k)) else "rad/s" for k in robot.actuated)
