"""Figures as functions of arrays and labels, in the page's style, and their way to inline SVG.

What to use when: `identifiability.plot` draws the figures of a result. This module draws predicted
torque and residuals, the uncertainty of parameters, comparisons of models, and their common parts:
rows with names, scales, legends, labels and whiskers.
"""

from __future__ import annotations

import hashlib
import io
import re
import tomllib
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, ParamSpec
from urllib.parse import unquote

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from matplotlib.transforms import ScaledTranslation

from identifiability.foundation.names import Array
from identifiability.foundation.quoting import for_html, for_svg, svg_id
from identifiability.foundation.rounding import REACH, format_number
from identifiability.foundation.values import frozen

# Figures in the page's style, and the one way from a Matplotlib figure to inline SVG.
#
# Colours are those of the light page; `svg` turns each into a variable of the style sheet, so that
# one figure serves the light and the dark page.


#: Style sheets and page templates.
TEMPLATES = Path(__file__).with_name("templates")

_LIGHT = (TEMPLATES / "style.css").read_text(encoding="utf-8").partition("}")[0]

#: The palette: colours of the light page by the name of the style sheet's variable.
COLOURS: dict[str, str] = dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", _LIGHT))

INK, MUTED, LINE, SURFACE = (COLOURS[name] for name in ("ink", "muted", "line", "surface"))
BLUE, VERMILION, GREEN = (COLOURS[name] for name in ("blue", "vermilion", "green"))

#: Matplotlib's settings.
STYLE: Any = {
    **mpl.rc_params_from_file(TEMPLATES / "page.mplstyle", use_default_template=False),
    **dict.fromkeys(("axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), MUTED),
    **{"text.color": INK, "grid.color": LINE},
}

_VARIABLE = {colour: f"var(--{name})" for name, colour in COLOURS.items()} | {
    "#000000": "var(--ink)"
}

#: Settings that act when a figure is saved, not when it is drawn.
_SAVED = ("axes.unicode_minus", "path.simplify", "svg.fonttype", "svg.hashsalt")

#: Start of the identifiers of labels that the page links to the row of that name.
MARKED = "row:"


P = ParamSpec("P")


class Shown(Figure):
    """A figure that shows itself in a notebook, whichever backend Matplotlib has there."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        stream = io.BytesIO()
        with mpl.rc_context(STYLE):
            # Pixels of a figure in a notebook for each of its own, for screens that
            # are dense.
            self.savefig(
                stream,
                format="png",
                dpi=72 * 2,
                facecolor=SURFACE,
            )
        width, height = (round(72 * size) for size in self.get_size_inches())
        return stream.getvalue(), {"width": width, "height": height}


def drawn(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw in the page's style, independent of the user's Matplotlib settings."""

    @wraps(draw)
    def styled(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return styled


def canvas(
    width: float,
    height: float,
    margins: tuple[float, float, float, float],
    ratios: Sequence[float] = (1,),
) -> tuple[Figure, list[Axes]]:
    """Return a figure with axes one above the other.

    Parameters
    ----------
    width, height : float [px]
    margins : (left, right, top, bottom) [px]
    ratios : sequence of float
        Relative heights of the axes, which share x.
    """
    left, right, top, bottom = margins
    figure = Shown(figsize=(width / 72, height / 72), dpi=72)
    figure.subplots_adjust(
        left / width, bottom / height, 1 - right / width, 1 - top / height, hspace=0.14
    )
    axes = figure.subplots(
        len(ratios),
        1,
        sharex=True,
        squeeze=False,
        height_ratios=ratios,
    )
    return figure, list(axes[:, 0])


def label_width(names: Sequence[str]) -> float:
    """Return the room that row labels need [px]."""
    return 16 + 6.5 * max((len(for_svg(name)) for name in names), default=0)


def strokes(axes: Axes, starts: Array, ends: Array, colour: str, **style: Any) -> None:
    """Draw straight strokes between points (N, 2) as one path, so that many are fast."""
    ends_each = np.stack([starts, ends], 1)
    codes = np.tile([Outline.MOVETO, Outline.LINETO], len(starts))
    path = Outline(
        ends_each.reshape(-1, 2),
        codes,
    )
    path.should_simplify = False  # else strokes without length are dropped
    axes.add_patch(
        PathPatch(
            path,
            edgecolor=colour,
            facecolor="none",
            **style,
        )
    )


def peak_rows(lines: Sequence[Array], most: int) -> np.ndarray:
    """Return rows that keep the peaks of lines (N,), at most `most` for each of them, ascending.

    Values that are NaN are no peaks, but kept where there are no others: they break the line.
    """
    count = len(lines[0])
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, max(most // 2, 1) + 1).astype(int)
    found = {
        a
        + int(
            np.argmax(
                np.nan_to_num(
                    sign * y[a:b],
                    nan=-np.inf,
                )
            )
        )
        for y in lines
        for a, b in pairwise(edges)
        for sign in (1.0, -1.0)
    }
    return np.array(sorted(found))


def break_gaps(t: Array, lines: Sequence[Array]) -> tuple[Array, list[Array]]:
    """Return times (N,) and lines (N,) with a NaN more wherever samples are missing."""
    step = np.diff(t)
    # A step of time this many times the usual one is a gap.
    gaps = np.flatnonzero(step > 10.0 * np.median(step)) + 1 if len(step) else np.empty(0, int)
    times = np.insert(t, gaps, t[gaps] - 1e-9)
    return times, [np.insert(y, gaps, np.nan) for y in lines]


def plot_line(axes: Axes, t: Array, y: Array, most: int, **style: Any) -> None:
    """Draw a line of at most `most` points, with its peaks, broken where samples are missing."""
    rows = peak_rows((y,), most)
    times, (values,) = break_gaps(t[rows], [y[rows]])
    axes.plot(times, values, **style)


def svg(figure: Figure, alt: str = "") -> Markup:
    """Return a figure as inline SVG: no fixed size, no date, colours from the style sheet.

    The same figure gives the same text. Its identifiers are prefixed with a hash of it, so that
    figures on one page do not share them.
    """
    stream = io.StringIO()
    settings: Any = {k: STYLE[k] for k in _SAVED}
    nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with mpl.rc_context(settings), warnings.catch_warnings():
        # The browser has glyphs that the font which text is measured with may lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(
            stream,
            format="svg",
            transparent=True,
            dpi=72,
            metadata=nothing,
        )
    text = stream.getvalue()
    opened = text.index(">", text.index("<svg")) + 1
    body = text[opened:].replace("</svg>", "").strip()
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    key = hashlib.sha256(body.encode()).hexdigest()[:8]
    classes: dict[str, str] = {}
    body = re.sub(r"<[a-zA-Z][^<>]*>", lambda m: _clean_tag(m[0], key, classes), body)
    body = re.sub(r">\s+<", "><", body)
    rules = "".join(f".{name}{{{style}}}" for style, name in classes.items())
    width, height = (round(72 * x) for x in figure.get_size_inches())
    return Markup(
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{for_html(alt)}">'
        f"<style>{rules}</style>{body}</svg>"
    )


def _clean_tag(tag: str, key: str, classes: dict[str, str]) -> str:
    """Return an SVG tag in the page's terms: short numbers, separate identifiers, its colours.

    Styles that repeat become `classes`, which halves the size of a figure.
    """
    tag = re.sub(rf'id="{MARKED}([^"]*)"', lambda m: f'data-row="{for_html(unquote(m[1]))}"', tag)
    if tag.startswith("<g "):
        tag = re.sub(r'\s+id="[^"]*"', "", tag)
    tag = re.sub(r'\bid="([^"]*)"', rf'id="{key}-\1"', tag)
    tag = re.sub(r'xlink:href="#', f'href="#{key}-', tag).replace("url(#", f"url(#{key}-")
    tag = re.sub(r"\s*font-family:[^;\"]*;?", "", tag)
    tag = re.sub(r"\.(\d\d)\d+", r".\1", tag)
    tag = re.sub(r' transform="rotate\(-?0 [^"]*"', "", tag)
    tag = re.sub(r"#[0-9a-f]{6}\b", lambda m: _VARIABLE.get(m[0], m[0]), tag)
    tag = re.sub(r"\s+", " ", tag).replace(' "', '"')

    def name(style: re.Match[str]) -> str:
        return f'class="{classes.setdefault(style[1], f"s{key}-{len(classes)}")}"'

    return re.sub(r'\bstyle="([^"]*)"', name, tag)


# What figures share: rows with names, scales, legends, labels, whiskers.


WIDTH = 350

#: Look of limits and of references.
DASHED: Any = {"linewidth": 1, "linestyle": (0, (4, 3))}


def row_canvas(
    names: Sequence[str], row: float = 19, top: float = 40, xlabel: str = ""
) -> tuple[Figure, Axes]:
    """Return axes with one labelled row for each name, the first on top."""
    count = max(len(names), 1)
    bottom = 38
    left = min(label_width(names), 0.45 * WIDTH)
    height = top + bottom + row * count
    figure, (axes,) = canvas(WIDTH, height, (left, 14, top, bottom))
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_yticks([])
    beside = axes.get_yaxis_transform() + ScaledTranslation(-6 / 72, 0, figure.dpi_scale_trans)
    for k, name in enumerate(names):  # as ticks they would take most of the time of a page
        label = axes.text(
            0,
            k,
            for_svg(name),
            transform=beside,
            va="center_baseline",
            color=INK,
            fontsize=STYLE["ytick.labelsize"],
            ha="right",
        )
        label.set_gid(MARKED + svg_id(name))
    axes.spines["left"].set_visible(False)
    axes.set_xlabel(xlabel)
    return figure, axes


def row_lines(axes: Axes, count: int) -> None:
    """Draw a faint line along each row, for the eye to follow."""
    at = np.arange(count, dtype=float)
    first, last = (np.stack([np.full(count, x), at], 1) for x in axes.get_xlim())
    strokes(
        axes,
        first,
        last,
        LINE,
        linewidth=0.6,
        zorder=0,
    )


def label_axes(axes: Axes, x: str, y: str, title: str = "") -> None:
    """Write the labels of the axes, and a bold title above the legend."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(
            "\n".join(break_title(title)),
            loc="left",
            x=-0.15,  # above the label of the axis, so that a long one has room
            pad=26,
            color=INK,
            fontweight="bold",
        )


def break_title(title: str) -> list[str]:
    """Return the lines of a title, at most two."""
    return [for_svg(line, 46) for line in wrap(title, 46, max_lines=2, placeholder="…")]


def legend_above(axes: Axes, **style: Any) -> None:
    """Write a legend of two columns above the axes."""
    above: Any = {
        "loc": "lower left",
        "bbox_to_anchor": (0, 1),
        "ncols": 2,
        "borderaxespad": 0.2,
        "handlelength": 1.4,
    }
    axes.legend(**above | style)


def whiskers(axes: Axes, x: Array, y: Array, reach: Any, **style: Any) -> None:
    """Draw points with errors along x, by default large blue ones with caps."""
    large: Any = {"color": BLUE, "markersize": 7, "elinewidth": 2, "capsize": 3}
    shown, half = (np.where(np.isfinite(v), v, np.nan) for v in (x, reach))
    axes.errorbar(
        shown,
        y,
        xerr=half,
        fmt="o",
        **large | style,
    )


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Make x logarithmic from `low` to `high`, with few ticks: powers of ten, or 1, 2 and 5."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    steps = (1.0, 2.0, 5.0) if np.log10(high / low) < 2.5 else (1.0,)
    axes.xaxis.set_major_locator(LogLocator(subs=steps, numticks=7))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: format_number(x, 2)))
    axes.xaxis.set_minor_locator(NullLocator())


# How a verdict looks, in tables and figures alike: colour and symbol, never colour alone.


Tone = Literal["blue", "green", "amber", "vermilion", "purple", "sky", "grey"]


@frozen
class Mark:
    """The look of a class.

    Attributes
    ----------
    tone : str
        Colour of the colour-blind-safe palette [Okabe & Ito 2008].
    symbol : str
        Text in front of the word.
    marker, fill : str
        The same in Matplotlib's terms.
    """

    tone: Tone
    symbol: str
    marker: str = "o"
    fill: Literal["full", "left", "none"] = "full"


MARKS: dict[str, dict[str, Any]] = tomllib.loads(
    (TEMPLATES / "marks.toml").read_text(encoding="utf-8")
)


def mark_of(kind: str) -> Mark:
    """Return the look of a verdict, or a neutral one for a word that has none."""
    return Mark(**MARKS.get(kind, MARKS["other"]))


# Torque and motion along time.


#: Points of a scatter, or of a line next to a moving robot.
POINTS = 500

#: Colour and name of the model as it was, and of the one with the named effects.
STATES = ((MUTED, "before"), (BLUE, "after"))


@drawn
def draw_torque(
    t: Array,
    measured: Array,
    predicted: Array,
    title: str,
    unit: str,
    most: int = 1500,
) -> Figure:
    """Draw measured and predicted torque of one joint, and the residual below.

    Parameters
    ----------
    t : (N,) [s]
    measured, predicted : (N,) [unit]
    title, unit : str
    most : int
        Points a line keeps.
    """
    figure, (above, below) = canvas(WIDTH, 334, (60, 10, 54, 38), (2.2, 1))
    plot_line(
        above,
        t,
        measured,
        most,
        color=MUTED,
        linewidth=3,
        alpha=0.45,
        label="measured",
    )
    plot_line(
        above,
        t,
        predicted,
        most,
        color=BLUE,
        linewidth=1.3,
        label="predicted",
    )
    label_axes(above, "", f"{name_torque(unit)} [{unit}]", title)
    legend_above(above)
    below.axhline(
        0,
        color=MUTED,
        linewidth=0.8,
    )
    plot_line(
        below,
        t,
        measured - predicted,
        most,
        color=VERMILION,
        linewidth=0.9,
    )
    label_axes(below, "time [s]", f"residual [{unit}]")
    if len(t) > 1 and t[-1] > t[0]:
        below.set_xlim(float(t[0]), float(t[-1]))
    above.locator_params(axis="y", nbins=5)
    below.locator_params(axis="y", nbins=3)
    figure.align_ylabels([above, below])
    return figure


def name_torque(unit: str) -> str:
    """Return "torque", or "force" where the unit is that of a force."""
    return "torque" if "m" in unit else "force"


@drawn
def draw_curve(
    x: Array, learned: Array, spread: Array, data: Array, title: str, labels: tuple[str, str]
) -> Figure:
    """Draw the learned curve of an effect, with its 95 % interval, against the data.

    Torque that is no curve of the motion is drawn over the fitted torque.

    Parameters
    ----------
    x, learned, spread, data : (N,)
        Motion, torque of the effect, its standard error, and the residual that it should explain.
    title : str
    labels : (str, str)
        Of the axes.
    """
    more = 15 * len(break_title(title)[1:])
    figure, (axes,) = canvas(WIDTH, 176 + more, (60, 10, 42 + more, 36))
    data, learned = seen = np.nan_to_num([data, learned], posinf=0.0, neginf=0.0)
    along = learned[np.argsort(x)]
    branches = _is_rough(along)
    # Of a delay speed alone says nothing. Friction by position has one branch a direction.
    if branches and _is_rough(np.abs(along)):
        branches = False
        x = learned
        labels = f"fitted {labels[1]}", labels[1]
    rows = np.unique(np.linspace(0, len(x) - 1, min(POINTS, len(x))).astype(int))
    points = np.stack([x, data], 1)[rows]
    # Strokes without length are a tenth of the size of markers.
    strokes(axes, points, points, MUTED, linewidth=3.0, capstyle="round", alpha=0.6)
    axes.plot([], [], ".", color=MUTED, label="measured less rest of model")
    order = np.argsort(x)
    if branches:
        axes.plot(x[rows], learned[rows], ".", markersize=3.0, color=BLUE, label="fitted")
    else:
        low, high = (learned[order] + side * REACH * spread[order] for side in (-1.0, 1.0))
        # A band that is thinner than the line cannot be seen: the legend leaves it out.
        label = "95 %" if 2 * REACH * np.mean(spread) > 0.02 * np.ptp(data) else None
        axes.fill_between(x[order], low, high, color=BLUE, alpha=0.2, linewidth=0, label=label)
        axes.plot(x[order], learned[order], color=BLUE, linewidth=1.2, label="fitted")
    margin = 0.1 * np.ptp(seen)
    if margin > 0:  # a wide interval does not hide the data
        axes.set_ylim(seen.min() - margin, seen.max() + margin)
    axes.locator_params(steps=[1, 2, 5, 10])  # numbers such as −0.75 touch
    axes.locator_params("y", nbins=5)
    # Three entries are as wide as the picture.
    legend_above(axes, ncols=3, columnspacing=0.7, handletextpad=0.3, handlelength=1.0)
    label_axes(axes, *labels, title)
    return figure


def _is_rough(y: Array) -> bool:
    """Return whether the median step of a sequence is more than a fifth of its spread."""
    return bool(np.median(np.diff(y) ** 2) > 0.05 * np.var(y))


@drawn
def draw_profile(
    grid: Array, rise: Array, best: float, region: Array, xlabel: str, *, log: bool
) -> Figure:
    """Draw the rise of the deviance over a number, its 95 % limit and its region.

    Parameters
    ----------
    grid, rise : (g,)
        The rise is infinite where the value is impossible.
    best : float
    region : (2,)
        Inside the grid.
    xlabel : str
    log : bool
        Whether the number has a logarithmic axis.
    """
    figure, (axes,) = canvas(300, 200, (48, 12, 12, 40))
    limit = REACH**2
    shown = np.isfinite(rise)
    axes.axvspan(*region, color=BLUE, alpha=0.12, linewidth=0)
    axes.axhline(limit, color=MUTED, **DASHED)
    axes.plot(grid[shown], rise[shown], color=BLUE, linewidth=1.2)
    axes.plot(best, 0.0, "o", color=BLUE, markersize=4.0)
    (near,) = np.nonzero(rise <= 2 * limit)
    low = float(grid[max(near[0] - 1, 0)])
    high = float(grid[min(near[-1] + 1, len(grid) - 1)])
    if log and high > 3 * low:  # else linear ticks are easier to read
        log_scale(axes, low, high)
    else:
        axes.set_xlim(low, high)
        axes.xaxis.set_major_locator(MaxNLocator(4))
    axes.set_ylim(0.0, 3 * limit)
    label_axes(axes, for_svg(xlabel), "rise of the deviance")
    return figure


@drawn
def draw_response(frequency: Array, measured: Array, modelled: Array, resonance: float) -> Figure:
    """Draw the torque of links over that of rigid links by frequency, and the resonance.

    Parameters
    ----------
    frequency : (F,) [Hz]
    measured, modelled : (F,)
    resonance : float [Hz]
    """
    figure, (axes,) = canvas(WIDTH, 240, (60, 10, 50, 38))
    axes.plot(frequency, measured, ".", markersize=4.0, color=MUTED, label="measured")
    axes.plot(frequency, modelled, color=BLUE, linewidth=1.2, label="modelled")
    axes.axhline(1.0, color=MUTED, **DASHED)
    if resonance <= frequency[-1]:
        axes.axvline(resonance, color=BLUE, **DASHED)
    legend_above(axes)
    axes.set_xlim(0.0, float(frequency[-1]))
    axes.set_ylim(0.0, 1.2 * float(modelled.max()))
    label_axes(axes, "frequency [Hz]", "torque over that of rigid links")
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
    figure, (axes,) = canvas(WIDTH, 240, (60, 20, 30, 38))
    for share, (colour, label) in zip((before, after), STATES, strict=True):
        low, middle, high = 100 * np.quantile(
            share,
            [0.25, 0.5, 0.75],
            axis=0,
        )
        axes.fill_between(
            t,
            low,
            high,
            color=colour,
            alpha=0.18,
            linewidth=0,
        )
        axes.plot(
            t,
            middle,
            color=colour,
            linewidth=1.8,
            label=label,
        )
    legend_above(axes)
    axes.set_xlim(0, float(t[-1]))
    axes.set_ylim(bottom=0)
    label_axes(axes, "time since the start of a stretch [s]", "position error [%]")
    return figure


# Models side by side.


def label_line(axes: Axes, x: float, text: str, side: str) -> None:
    """Write next to a vertical line at x, at the top of the axes."""
    top = axes.get_xaxis_transform()
    apart = (-4 if side == "right" else 4, 0)
    axes.annotate(text, (x, 0.98), apart, top, "offset points", color=BLUE, va="top", ha=side)


@drawn
def draw_ladder(
    sizes: Array,
    other: Array,
    unseen: Array,
    spread: Array,
    selected: int,
    name: str,
    likely: Sequence[int] = (),
    exported: float = np.nan,
) -> Figure:
    """Draw the error of each model against its size, with the band of one standard error.

    The axis ends at five times the error of the model to use.

    Parameters
    ----------
    sizes : (m,)
        Numbers of parameters, descending.
    other, unseen : (m,)
        ε_RA as fractions.
    spread : (m,)
        Standard error of the difference of `unseen` to the selected model's.
    selected : int
        The model to use.
    name : str
        Of the `other` errors.
    likely : (int, int), optional
        Least and largest size that is as good.
    exported : float
        ε_RA of the values that the model to use exports.
    """
    figure, (axes,) = canvas(WIDTH, 220, (44, 8, 26, 40))
    other, unseen, spread = (
        100 * np.where(np.isfinite(x), x, np.nan) for x in (other, unseen, spread)
    )
    half = np.nan_to_num(spread)
    band = axes.fill_between(
        sizes,
        unseen - half,
        unseen + half,
        color=BLUE,
        alpha=0.16,
        linewidth=0,
    )
    (line,) = axes.plot(sizes, unseen, "o-", color=BLUE, markersize=5)
    (seen,) = axes.plot(
        sizes,
        other,
        "o-",
        color=MUTED,
        fillstyle="none",
        markersize=4,
        linewidth=1,
    )
    if likely:
        axes.axvspan(likely[0] - 0.5, likely[1] + 0.5, color=GREEN, alpha=0.12, linewidth=0)
    chosen = float(sizes[selected])
    axes.axvline(chosen, color=BLUE, **DASHED)
    # The curve rises at the right: the label is at the left if there is room.
    side = "right" if 4 * chosen < 3 * sizes.max() else "left"
    label_line(axes, chosen, f"use {chosen:.0f}", side)
    shown = np.concatenate([unseen, other])
    if (shown[np.isfinite(shown)] > 0).any():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)))
        # Models far above the one to use would hide small differences.
        if 0 < 5 * unseen[selected] < np.nanmax(unseen):
            axes.set_ylim(top=5 * unseen[selected])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set_xlim(float(sizes.max()) + 0.8, float(sizes.min()) - 0.8)
    drawn = {"cross-validation": (band, line), name: seen}
    if np.isfinite(exported):
        (drawn["exported"],) = axes.plot(chosen, 100 * exported, "D", color=VERMILION)
    legend_above(
        axes,
        handles=drawn.values(),
        labels=drawn,
        ncols=3,
        columnspacing=0.8,
        handletextpad=0.5,
    )
    size = f"smaller model → [parameters, of {sizes.max():.0f}]"
    label_axes(axes, size, "error [%]")
    return figure


# How well each parameter is known.


@drawn
def draw_precision(
    names: Sequence[str],
    white: Array,
    label: Array,
    verdicts: Sequence[str],
    limit: float,
    paper_limit: float,
) -> Figure:
    """Draw relative standard deviations on a log axis, best known first, with both limits.

    Parameters
    ----------
    names : sequence of str
    white, label : (k,) [%]
        σ under white noise, and σ of the labelled parameter, relative to the value; infinite where
        not determined.
    verdicts : sequence of str
    limit, paper_limit : float [%]
        Of the verdicts (for `label`) and of the 10× rule (for `white`).
    """
    order = np.argsort(np.nan_to_num(label, nan=np.inf), kind="stable")
    figure, axes = row_canvas(
        [names[k] for k in order],
        xlabel="standard deviation relative to the value [%]",
    )
    known = np.concatenate([white, label, [limit, paper_limit]])
    known = known[np.isfinite(known) & (known > 0)]
    low = max(min(float(known.min(initial=limit)) / 1.8, 0.8), 1e-6)
    # Relative standard deviations above this are drawn at the edge [%].
    high = float(
        np.clip(
            known.max(initial=limit) * 2.2,
            10 * limit,
            1e4,
        )
    )
    log_scale(axes, low, high)
    axes.axvspan(
        low,
        limit,
        color=BLUE,
        alpha=0.06,
        linewidth=0,
    )
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        mark = mark_of(kind)
        colour = COLOURS[mark.tone]
        rows = np.flatnonzero([verdicts[k] == kind for k in order])
        start, end = (
            np.clip(np.nan_to_num(x[order[rows]], nan=np.inf), low, high) for x in (white, label)
        )
        strokes(
            axes,
            np.stack([start, rows], 1),
            np.stack([end, rows], 1),
            colour,
            linewidth=1.2,
        )
        axes.plot(
            start,
            rows,
            "|",
            color=colour,
            markersize=8,
            markeredgewidth=1.2,
        )
        for own, marker in ((end < high, mark.marker), (end >= high, ">")):
            axes.plot(
                end[own],
                rows[own],
                linestyle="none",
                color=colour,
                markersize=7,
                marker=marker,
                clip_on=False,
                fillstyle=mark.fill,
                markerfacecoloralt=SURFACE,
            )
    axes.axvline(
        limit,
        color=INK,
        linewidth=1,
        label=f"limit {limit:g} % (label)",
    )
    if low < paper_limit < high:
        axes.axvline(
            paper_limit,
            color=MUTED,
            label="10 × least (white)",
            **DASHED,
        )
    legend_above(axes, loc="lower right", bbox_to_anchor=(1, 1))
    return figure


@drawn
def draw_intervals(
    names: Sequence[str], values: Array, halves: Array, xlabel: str, line: float = 0.0
) -> Figure:
    """Draw values with half widths of intervals along x, and a line to compare them with.

    Parameters
    ----------
    names : sequence of str
    values, halves : (k,)
    xlabel : str
    line : float
    """
    figure, axes = row_canvas(
        names,
        row=26,
        top=14,
        xlabel=xlabel,
    )
    whiskers(axes, values, np.arange(len(names), dtype=float), halves)
    axes.axvline(
        line,
        color=INK,
        **DASHED,
    )
    row_lines(axes, len(names))
    return figure
