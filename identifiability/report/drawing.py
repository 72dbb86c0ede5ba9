"""Figures in the page's style, and the one way from a Matplotlib figure to inline SVG.

Rows with names, scales, legends, labels and whiskers are shared by figures.
"""

from __future__ import annotations

import hashlib
import io
import re
import unicodedata
import warnings
from collections.abc import Callable, Sequence
from functools import partial, wraps
from itertools import pairwise
from pathlib import Path
from typing import Any, ParamSpec
from urllib.parse import quote, unquote

import matplotlib as mpl
import numpy as np
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation

from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_number, superscript

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
BLUE, VERMILION, GREY = (COLOURS[name] for name in ("blue", "vermilion", "grey"))

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

#: What the identifier of a label begins with that the page links to the row of that name.
MARKED = "row:"


P = ParamSpec("P")


class Shown(Figure):
    """A figure that shows itself in a notebook, whichever backend Matplotlib has there."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        stream = io.BytesIO()
        with mpl.rc_context(STYLE):
            # Pixels of a figure in a notebook for each of its own, for screens that
            # are dense.
            self.savefig(stream, format="png", dpi=72 * 2, facecolor=SURFACE)
        width, height = (round(72 * size) for size in self.get_size_inches())
        return stream.getvalue(), {"width": width, "height": height}


def drawn(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw in the page's style, whatever the user's Matplotlib settings are."""

    @wraps(draw)
    def styled(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(STYLE):
            return draw(*args, **kwargs)

    return styled


def canvas(
    width: float,
    height: float,
    margins: tuple[float, float, float, float] = (58, 12, 30, 38),
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
    grid = {"height_ratios": ratios}
    axes = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, gridspec_kw=grid)
    return figure, list(axes[:, 0])


def plain(name: str, most: int = 28) -> str:
    """Return a name from a file so that it is drawn as it stands: no mathtext, one line, short."""
    name = "".join(" " if unicodedata.category(c).startswith("C") else c for c in name)
    if len(name) > most:
        name = f"{name[: most // 2]}…{name[-(most - most // 2 - 1) :]}"
    return name.replace("$", r"\$")


def label_width(names: Sequence[str], most: int = 28) -> float:
    """Return the room that row labels of at most so many letters need [px]."""
    return 16 + 6.5 * max((len(plain(n, most)) for n in names), default=0)


def strokes(axes: Axes, starts: Array, ends: Array, colour: str, **style: Any) -> None:
    """Draw straight strokes between points (N, 2) as one path, whatever their number."""
    path = Outline(
        np.stack([starts, ends], 1).reshape(-1, 2),
        np.tile([Outline.MOVETO, Outline.LINETO], len(starts)),
    )
    path.should_simplify = False  # else strokes without length are dropped
    axes.add_patch(PathPatch(path, edgecolor=colour, facecolor="none", **style))


def dots(
    axes: Axes, x: Array, y: Array, colour: str, size: float = 2.4, alpha: float = 0.5
) -> None:
    """Draw points as strokes without length, a tenth of the size of markers."""
    points = np.stack([x, y], 1)
    strokes(axes, points, points, colour, linewidth=size, capstyle="round", alpha=alpha)
    axes.autoscale_view()


def peak_rows(lines: Sequence[Array], most: int) -> np.ndarray:
    """Return rows that keep the peaks of lines (N,), at most `most` for each of them, ascending.

    Values that are NaN are no peaks, but kept where there are no others: they break the line.
    """
    count = len(lines[0])
    if count <= most:
        return np.arange(count)
    edges = np.linspace(0, count, max(most // 2, 1) + 1).astype(int)
    found = {
        a + int(np.argmax(np.where(np.isnan(y[a:b]), -np.inf, sign * y[a:b])))
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
    """Draw a line of at most so many points, with its peaks, broken where samples are missing."""
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
        figure.savefig(stream, format="svg", transparent=True, dpi=72, metadata=nothing)
    text = stream.getvalue()
    body = text[text.index(">", text.index("<svg")) + 1 :].replace("</svg>", "").strip()
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)
    key = hashlib.sha256(body.encode()).hexdigest()[:8]
    classes: dict[str, str] = {}
    body = re.sub(r"<[a-zA-Z][^<>]*>", lambda m: _clean_tag(m[0], key, classes), body)
    body = re.sub(r">\s+<", "><", body)
    rules = "".join(f".{name}{{{style}}}" for style, name in classes.items())
    width, height = (round(72 * x) for x in figure.get_size_inches())
    return Markup(
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(alt)}">'
        f"<style>{rules}</style>{body}</svg>"
    )


def _clean_tag(tag: str, key: str, classes: dict[str, str]) -> str:
    """Return an SVG tag in the page's terms: short numbers, own identifiers, its colours.

    Styles that repeat become `classes`, which halves the size of a figure.
    """
    tag = re.sub(rf'id="{MARKED}([^"]*)"', lambda m: f'data-row="{escape(unquote(m[1]))}"', tag)
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


WIDTH = 440

#: Look of limits and of what is compared with.
DASHED: Any = {"linewidth": 1, "linestyle": (0, (4, 3))}


def row_canvas(
    names: Sequence[str], row: float = 19, top: float = 40, right: float = 14, xlabel: str = ""
) -> tuple[Figure, Axes]:
    """Return axes with one labelled row for each name, the first on top."""
    count = max(len(names), 1)
    bottom = 38
    left = min(label_width(names), 0.45 * WIDTH)
    figure, (axes,) = canvas(WIDTH, top + bottom + row * count, (left, right, top, bottom))
    axes.set_ylim(count - 0.5, -0.5)
    axes.set_yticks([])
    style = {"color": INK, "fontsize": STYLE["ytick.labelsize"], "ha": "right"}
    beside = axes.get_yaxis_transform() + ScaledTranslation(-6 / 72, 0, figure.dpi_scale_trans)
    for k, name in enumerate(names):  # as ticks they would take most of the time of a page
        label = axes.text(0, k, plain(name), transform=beside, va="center_baseline", **style)
        label.set_gid(MARKED + quote(name, safe=""))  # it is not escaped in SVG
    axes.spines["left"].set_visible(False)
    axes.set_xlabel(xlabel)
    return figure, axes


def row_lines(axes: Axes, count: int) -> None:
    """Draw a faint line along each row, for the eye to follow."""
    low, high = axes.get_xlim()
    at = np.arange(count, dtype=float)
    first, last = (np.stack([np.full(count, x), at], 1) for x in (low, high))
    strokes(axes, first, last, LINE, linewidth=0.6, zorder=0)


def label_axes(
    axes: Axes, x: str, y: str, title: str = "", most: int = 44, pad: float | None = None
) -> None:
    """Write what the axes are, and a bold title of at most so many letters, `pad` above them."""
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if title:
        axes.set_title(plain(title, most), pad=pad, color=INK, fontweight="bold")


def legend_above(axes: Axes, **style: Any) -> None:
    """Write a legend of two columns above the axes."""
    above: Any = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 2, "borderaxespad": 0.2}
    axes.legend(**above | style)


def whiskers(axes: Axes, x: Array, y: Array, reach: Any, **style: Any) -> None:
    """Draw points with errors along x, by default large blue ones with caps."""
    large: Any = {"color": BLUE, "markersize": 7, "elinewidth": 2, "capsize": 3}
    shown, half = (np.where(np.isfinite(v), v, np.nan) for v in (x, reach))
    axes.errorbar(shown, y, xerr=half, fmt="o", **large | style)


def log_scale(axes: Axes, low: float, high: float) -> None:
    """Make x logarithmic from `low` to `high`, with few ticks: powers of ten, or 1, 2 and 5."""
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    decades = np.log10(high / low)
    powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    write = power_of_ten
    if decades < 2.5:
        ticks = np.outer(10.0**powers, [1, 2, 5]).ravel()
        write = partial(format_number, digits=2)
    else:
        ticks = 10.0 ** powers[:: max(1, int(decades // 6))]
    shown = ticks[(low <= ticks) & (ticks <= high)]
    axes.xaxis.set_major_locator(FixedLocator(shown.tolist()))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: write(x)))
    axes.xaxis.set_minor_locator(NullLocator())


def power_of_ten(x: float) -> str:
    """Return a power of ten as a plain number where that is short, else as 10ⁿ."""
    power = round(np.log10(x)) if x > 0 else 0
    if -3 <= power <= 4:
        return f"{10.0**power:.{max(0, -power)}f}"
    return "10" + superscript(power)
