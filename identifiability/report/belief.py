"""What is believed after the data: intervals by every road, correlations, convergence.

And where knowledge of each standard parameter comes from, with the room that each body has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from identifiability.estimation.rules import Thresholds as Verdicts
from identifiability.foundation.answers import Cell, Column, Note, Table, badge_cell, measured_cells
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import (
    digits,
    format_count,
    format_number,
    join,
    mark_of,
    stated_text,
    whole_percent,
)
from identifiability.posterior.rules import RULES as POSTERIOR_RULES
from identifiability.posterior.rules import Thresholds
from identifiability.report.blocks import (
    Fold,
    Gallery,
    Notes,
    Section,
    Term,
    Terms,
    gallery,
    picture,
    section,
)
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    DASHED,
    GREY,
    INK,
    LINE,
    MUTED,
    SURFACE,
    VERMILION,
    canvas,
    dots,
    drawn,
    label_axes,
    legend_above,
    log_scale,
    plain,
    row_canvas,
    row_lines,
    strokes,
    top_label,
)
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.belief import Source, StandardBelief, Summary
from identifiability.workflows.analyze.result import model_title, stated_values
from identifiability.workflows.answers import note, sentence, with_hints, words

# How well each parameter is known, and how far it lies from what the robot file states.


#: Distances above this many σ are drawn at the edge.
MOST_SIGMA = 6.0


def precision_order(sigma: Array) -> np.ndarray:
    """Return the order of parameters from best to least known, (k,)."""
    return np.argsort(np.where(np.isnan(sigma), np.inf, sigma), kind="stable")


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
        σ under white noise, and σ from what the label says, relative to the value; infinite where
        not determined.
    verdicts : sequence of str
    limit, paper_limit : float [%]
        Of the verdicts (for `label`) and of the 10× rule (for `white`).
    """
    order = precision_order(label)
    title = "standard deviation relative to the value [%]"
    figure, axes = row_canvas([names[k] for k in order], top=48, xlabel=title)
    known = np.concatenate([white, label, [limit, paper_limit]])
    known = known[np.isfinite(known) & (known > 0)]
    low = max(min(float(known.min(initial=limit)) / 1.8, 0.8), 1e-6)
    # Relative standard deviations above this are drawn at the edge [%].
    high = float(np.clip(known.max(initial=limit) * 2.2, 10 * limit, 1e4))
    log_scale(axes, low, high)
    axes.axvspan(low, limit, color=BLUE, alpha=0.06, linewidth=0)
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        rows = np.array([r for r, k in enumerate(order) if verdicts[k] == kind])
        _precision_rows(axes, rows, white[order[rows]], label[order[rows]], kind)
    axes.axvline(limit, color=INK, linewidth=1)
    top_label(axes, limit, f"limit {limit:g} % (label)", INK)
    if np.isfinite(paper_limit) and low < paper_limit < high:
        axes.axvline(paper_limit, color=MUTED, **DASHED)
        top_label(axes, paper_limit, "10 × least (white)", MUTED, level=1)
    return figure


def _precision_rows(axes: Axes, rows: np.ndarray, white: Array, label: Array, kind: str) -> None:
    colour = COLOURS[mark_of(kind).tone]
    low, high = axes.get_xlim()
    seen = label < high
    beyond = rows[~seen]
    axes.plot(np.full(len(beyond), high), beyond, ">", color=colour, markersize=6, clip_on=False)
    rows, white, label = rows[seen], np.maximum(white[seen], low), np.maximum(label[seen], low)
    strokes(axes, np.stack([white, rows], 1), np.stack([label, rows], 1), colour, linewidth=1.2)
    axes.plot(white, rows, "|", color=colour, markersize=8, markeredgewidth=1.2)
    draw_marks(axes, label, rows, kind)


def mark_style(kind: str) -> dict[str, Any]:
    """Return how the mark of a verdict looks."""
    mark = mark_of(kind)
    return {
        "marker": mark.marker,
        "fillstyle": mark.fill,
        "color": COLOURS[mark.tone],
        "markersize": 7,
        "linestyle": "none",
    }


def draw_marks(axes: Axes, x: Array, y: Array, kind: str) -> None:
    """Draw the mark of a verdict at some points."""
    style = mark_style(kind)
    edge = 1.6 if style["marker"] == "x" else 1.2
    axes.plot(x, y, markerfacecoloralt=SURFACE, zorder=3, markeredgewidth=edge, **style)


def draw_arrows(axes: Axes, x: Array, rows: Array, edge: float, colour: str, **style: Any) -> None:
    """Draw arrows at the edges of the axes for points more than `MOST_SIGMA` from zero."""
    for marker, beyond in ((">", x > MOST_SIGMA), ("<", x < -MOST_SIGMA)):
        at = np.copysign(np.full(int(beyond.sum()), MOST_SIGMA + edge), x[beyond])
        axes.plot(at, rows[beyond], marker, color=colour, clip_on=False, **style)


@drawn
def draw_pulls(
    names: Sequence[str], pulls: Array, sigma: Array, verdicts: Sequence[str], origin: str
) -> Figure:
    """Draw how many σ the estimate lies from a stated value, in the order of `draw_precision`.

    Parameters
    ----------
    names : sequence of str
    pulls : (k,)
        ``(estimate - stated) / σ_robust``; NaN where nothing is stated.
    sigma : (k,) [%]
        Decides the order.
    verdicts : sequence of str
    origin : str
        What stands at zero, for the label.
    """
    order = precision_order(sigma)
    label = "distance of the estimate [σ robust]"
    figure, axes = row_canvas([names[k] for k in order], top=48, xlabel=label)
    axes.set_xlim(-MOST_SIGMA - 0.5, MOST_SIGMA + 0.5)
    axes.axvspan(-REACH, REACH, color=GREY, alpha=0.1, linewidth=0)
    axes.axvline(0, color=INK, linewidth=1)
    row_lines(axes, len(order))
    for kind in dict.fromkeys(verdicts):
        rows = np.array([r for r, k in enumerate(order) if verdicts[k] == kind])
        known = np.isfinite(pulls[order[rows]])
        _pull_rows(axes, rows[known], pulls[order[rows[known]]], kind)
    top_label(axes, 0, plain(origin, 40), INK)
    return figure


def _pull_rows(axes: Axes, rows: np.ndarray, pulls: Array, kind: str) -> None:
    colour = COLOURS[mark_of(kind).tone]
    draw_arrows(axes, pulls, rows, 0.25, colour, markersize=6)
    near = np.abs(pulls) <= MOST_SIGMA
    ends = np.stack([pulls[near], rows[near]], 1)
    strokes(axes, ends * [0, 1], ends, colour, linewidth=1.2)
    draw_marks(axes, pulls[near], rows[near], kind)


# What is believed after the data: intervals by every road, pairs, contraction, room of bodies.


#: Look of the layers of a forest plot, in their order: colour and marker.
LAYERS = (
    (MUTED, "v"),
    (BLUE, "o"),
    (COLOURS["amber"], "s"),
    (COLOURS["green"], "^"),
    (COLOURS["purple"], "D"),
    (INK, "P"),
)

#: Margins below this are drawn at the edge.
LEAST_MARGIN = 1e-8


@drawn
def draw_forest(
    names: Sequence[str], layers: Mapping[str, Array], stated: Array, origin: str
) -> Figure:
    """Draw 95 % intervals of each parameter by several roads, below each other in its row.

    Parameters
    ----------
    names : sequence of str
    layers : mapping of str to (k, 3)
        Centre, lower and upper end, as distances from the estimate in σ_robust; NaN for none. At
        most as many as `LAYERS`.
    stated : (k,)
        The same of a stated value; NaN where nothing is stated.
    origin : str
        Who states it, for the legend.
    """
    lines = -(-(len(layers) + 1) // 2)
    label = "distance from the estimate [σ robust]"
    figure, axes = row_canvas(names, 9 * len(layers) + 10, top=14 + 17 * lines, xlabel=label)
    axes.set_xlim(-MOST_SIGMA - 0.5, MOST_SIGMA + 0.5)
    axes.axvline(0, color=INK, linewidth=1)
    edges = np.arange(1, len(names)) - 0.5
    first, last = (np.stack([np.full(len(edges), x), edges], 1) for x in axes.get_xlim())
    strokes(axes, first, last, LINE, linewidth=0.8)
    rows, step = np.arange(len(names)), 0.8 / max(len(layers), 1)
    for k, (label, values) in enumerate(layers.items()):
        colour, marker = LAYERS[k]
        at = rows + (k - (len(layers) - 1) / 2) * step
        _intervals(axes, values, at, colour)
        x = values[:, 0]
        style: Any = {"markersize": 5, "zorder": 3}
        near = np.abs(x) <= MOST_SIGMA
        axes.plot(
            x[near], at[near], marker, color=colour, label=label, markeredgewidth=1.2, **style
        )
        draw_arrows(axes, x, at, 0.3, colour, **style)
    _stated(axes, stated, rows, plain(origin, 24))
    legend_above(axes, handletextpad=0.4, handlelength=1.4, columnspacing=1.2)
    return figure


def _intervals(axes: Axes, values: Array, rows: Array, colour: str) -> None:
    known = np.isfinite(values).all(1)
    low, high = axes.get_xlim()
    ends = np.clip(values[known, 1:], low, high)
    first, last = (np.stack([ends[:, i], rows[known]], 1) for i in (0, 1))
    strokes(axes, first, last, colour, linewidth=1.6)


def _stated(axes: Axes, stated: Array, rows: Array, label: str) -> None:
    """Draw stated values as bars through the height of their rows."""
    near = np.abs(stated) <= MOST_SIGMA
    x, at = stated[near], rows[near]
    strokes(axes, np.stack([x, at - 0.42], 1), np.stack([x, at + 0.42], 1), VERMILION, linewidth=2)
    draw_arrows(axes, stated, rows, 0.3, VERMILION, markersize=5, zorder=3)
    axes.add_line(Line2D([], [], color=VERMILION, linewidth=2, label=label))


@drawn
def draw_pair(
    draws: Array, labels: tuple[str, str], estimate: tuple[float, float], rho: float
) -> Figure:
    """Draw the draws of two parameters against each other.

    Parameters
    ----------
    draws : (D, 2)
    labels : (str, str)
        Name and unit of each.
    estimate : (float, float)
        Least squares, without prior or constraint.
    rho : float
        Their correlation.
    """
    figure, (axes,) = canvas(320, 280, (72, 14, 32, 46))
    # Points drawn in a pair.
    known = draws[np.isfinite(draws).all(1)][:400]
    dots(axes, known[:, 0], known[:, 1], COLOURS["purple"], 3.2, 0.55)
    axes.margins(0.08)
    (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    if low <= estimate[0] <= high and bottom <= estimate[1] <= top:
        axes.plot(*estimate, "+", color=INK, markersize=11, markeredgewidth=1.8)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter(FuncFormatter(lambda v, _: format_number(v, 4)))
    label_axes(axes, plain(labels[0], 40), plain(labels[1], 34))
    axes.set_title(f"correlation {rho:.2f}".replace("-", "−"))
    return figure


@drawn
def draw_contraction(
    names: Sequence[str], contraction: Array, sources: Sequence[str], limit: float
) -> Figure:
    """Draw how much narrower each parameter is after the data than before.

    Parameters
    ----------
    names : sequence of str
    contraction : (k,)
        ``1 - sd / prior sd``; what is negative is drawn at zero.
    sources : sequence of str
        What determines each: data, constraint, prior, structure.
    limit : float
        From here on a parameter has been learned.
    """
    figure, axes = row_canvas(names, top=72, xlabel="contraction from prior to posterior sd [–]")
    axes.set_xlim(0, 1.02)
    row_lines(axes, len(names))
    rows, x = np.arange(len(names)), np.clip(contraction, 0.0, 1.0)
    for kind in dict.fromkeys(sources):
        own = np.array([s == kind for s in sources]) & np.isfinite(x)
        tone = COLOURS[mark_of(kind).tone]
        ends = np.stack([x[own], rows[own]], 1)
        strokes(axes, ends * [0, 1], ends, tone, linewidth=1.2)
        draw_marks(axes, x[own], rows[own], kind)
    axes.axvline(limit, color=MUTED, **DASHED)
    top_label(axes, limit, "learned from here on", MUTED)
    keys = [Line2D([], [], label=plain(k), **mark_style(k)) for k in dict.fromkeys(sources)]
    legend_above(axes, handles=keys, handletextpad=0.2, borderaxespad=2.0, columnspacing=1.2)
    return figure


@drawn
def draw_margins(
    bodies: Sequence[str], nearest: Array, stated: Array, active: Sequence[bool], origin: str
) -> Figure:
    """Draw how far each body is from the edge of what can exist, on a log axis.

    Parameters
    ----------
    bodies : sequence of str
    nearest, stated : (nb,)
        Smallest dimensionless eigenvalue of the nearest real robot's bodies and of the stated ones.
    active : sequence of bool
        Whether the nearest real robot is held back by this body.
    origin : str
        Who states the latter.
    """
    label = "smallest scaled eigenvalue of the pseudo-inertia [–]"
    figure, axes = row_canvas(bodies, 24, top=48, xlabel=label)
    log_scale(axes, LEAST_MARGIN, 1.0)
    row_lines(axes, len(bodies))
    rows, at_edge = np.arange(len(bodies)), np.array(active, bool)
    # What is below the axis moves to its edge; NaN stays.
    stated, nearest = (np.clip(x, LEAST_MARGIN, 1.0) for x in (stated, nearest))
    both = np.isfinite(nearest) & np.isfinite(stated)
    a, b = (np.stack([x[both], rows[both]], 1) for x in (stated, nearest))
    strokes(axes, a, b, MUTED, linewidth=1)
    hollow: Any = {"fillstyle": "none", "color": MUTED, "markersize": 7}
    axes.plot(stated, rows, "o", label=plain(origin, 24), **hollow)
    for own, marker, colour, name in (
        (~at_edge, "o", BLUE, "nearest real robot"),
        (at_edge, "X", VERMILION, "the same, held at the edge"),
    ):
        if own.any():
            axes.plot(nearest[own], rows[own], marker, color=colour, markersize=7, label=name)
    legend_above(axes, bbox_to_anchor=(-0.2, 1), handletextpad=0.2, columnspacing=1.0)
    return figure


# What is believed after the data: intervals by every road, correlations, convergence.


#: Pairs of parameters that are drawn, and the least correlation worth a picture.
PAIRS, LEAST_CORRELATION = 6, 0.3

#: Most rows of one forest plot.
ROWS = 14

SIGNS, BODIES = "posterior with signs", "posterior with bodies"

CONVERGENCE = with_hints(
    "convergence",
    Column("posterior"),
    Column("nested R-hat", "{:.4f}".format),
    Column("effective draws", "{:.0f}".format),
    Column("in the tails", "{:.0f}".format),
    Column("autocorrelation time", "{:.1f}".format),
    Column("accepted", whole_percent),
    Column("may be shown", "badge"),
)


def summaries(analysis: Analysis) -> dict[str, Summary | None]:
    """Return both posteriors of the selected model by name, None for one that was not sampled."""
    belief = analysis.belief
    assert belief is not None
    return {SIGNS: belief.signs, BODIES: belief.physical}


def section_posterior(analysis: Analysis) -> Section:
    """Return the parameters of the selected model by every road, beside each other."""
    notes = posterior_notes(analysis)
    return section(
        "analysis.posterior",
        Notes(notes) if notes else None,
        forest_gallery(analysis),
        pair_gallery(analysis),
        convergence_table(analysis),
        title=model_title(analysis.chosen),
    )


def posterior_notes(analysis: Analysis) -> tuple[Note, ...]:
    """Return why a posterior, or an interval of it, is not shown, if one is not."""
    belief = analysis.belief
    assert belief is not None
    notes = []
    for name, summary in summaries(analysis).items():
        if summary is None:
            why = belief.note.rstrip(".") or "it was not sampled"
            notes.append(note("no-posterior", name=name, why=f"{why[0].upper()}{why[1:]}"))
        elif not summary.trustworthy:
            notes.append(note("doubtful", name=name, why=" ".join(summary.convergence.reasons)))
        elif not summary.stated.all():
            names = np.array(analysis.chosen.submodel.columns)[~summary.stated].tolist()
            share = f"{len(names)} of {len(summary.stated)}"
            notes.append(
                note(
                    "prior-sensitive",
                    name=name,
                    share=share,
                    names=join(names, ROWS),
                    limit=100 * POSTERIOR_RULES.prior_sensitivity,
                )
            )
    return tuple(notes)


def shown(analysis: Analysis) -> dict[str, Summary | None]:
    """Return both posteriors by name, None for one whose numbers may not be shown."""
    found = summaries(analysis)
    return {name: x if x is not None and x.trustworthy else None for name, x in found.items()}


def forest_gallery(analysis: Analysis) -> Gallery:
    """Return a forest plot for each group of parameters."""
    names = analysis.chosen.submodel.columns
    layers, stated = forest_layers(analysis)
    pictures = []
    for kind, rows in forest_groups(names):
        shown_names, own = [names[k] for k in rows], {n: v[rows] for n, v in layers.items()}
        figure = draw_forest(shown_names, own, stated[rows], analysis.robot.path.name)
        pictures.append(picture("forest", figure, kind=kind, group=kind.capitalize()))
    return gallery("forest", pictures)


_GROUPS = ("bodies", "friction", "rotor inertia", "other effects")


def forest_groups(names: tuple[str, ...]) -> list[tuple[str, np.ndarray]]:
    """Return each group with the rows of its parameters, at most `ROWS` at a time."""
    kinds = [group_of(n) for n in names]
    parts = []
    for kind in dict.fromkeys(sorted(kinds, key=_GROUPS.index)):
        rows = np.array([k for k, other in enumerate(kinds) if other == kind])
        parts += [(kind, part) for part in np.array_split(rows, -(-len(rows) // ROWS))]
    return parts


def group_of(name: str) -> str:
    """Return the group of a parameter by its kind: bodies, friction, rotor inertia or other."""
    kind = name.rpartition(".")[2]
    if kind in GROUPED_KINDS:
        return "bodies"
    if kind in ("Ia", "Jr", "Js"):
        return "rotor inertia"
    return "friction" if kind.startswith("F") else "other effects"


def forest_layers(analysis: Analysis) -> tuple[dict[str, Array], Array]:
    """Return 95 % intervals of every road in σ_robust, (k, 3) each, and the stated values (k,).

    Where something is left out the label's interval is the last.
    """
    chosen = analysis.chosen
    posteriors = shown(analysis)
    value, white, robust = np.array(
        [(v.value, v.sigma, v.sigma_robust) for v in chosen.verdicts], float
    ).T
    open_ = ~(np.isfinite(robust) & (robust > 0) & chosen.estimate.determined)
    physical, drawn = posteriors[BODIES], chosen.uncertainty.bootstrap
    half = REACH * np.array([0.0, -1.0, 1.0])
    roads = {"white σ": value[:, None] + np.outer(np.where(open_, np.nan, white), half)}
    roads["robust σ"] = value[:, None] + np.outer(np.where(open_, np.nan, robust), half)
    if drawn is not None:
        ends = np.column_stack([drawn.values.mean(0), drawn.interval()])
        roads["block bootstrap"] = np.where(open_[:, None], np.nan, ends)
    for name, summary in posteriors.items():
        if summary is not None:
            both = np.column_stack([summary.mean, summary.interval])
            roads[name] = np.where(summary.stated[:, None], both, np.nan)
    if any(v.sigma_omit for v in chosen.verdicts):
        label = np.array([v.sigma_label for v in chosen.verdicts])
        roads["label"] = value[:, None] + np.outer(np.where(open_, np.nan, label), half)
    centre = np.where(open_, np.nan if physical is None else physical.mean, value)
    scale = np.where(open_, np.nan if physical is None else physical.sd, robust)
    scale = np.where(scale > 0, scale, np.nan)
    stated = np.array(stated_values(analysis, chosen), float)
    layers = {n: (x - centre[:, None]) / scale[:, None] for n, x in roads.items()}
    return layers, (stated - centre) / scale


def pair_gallery(analysis: Analysis) -> Gallery | None:
    """Return the draws of the most correlated pairs of parameters, if any is worth a picture."""
    posteriors = shown(analysis)
    name = SIGNS if posteriors[BODIES] is None else BODIES
    summary = posteriors[name]
    if summary is None:
        return None
    rho, verdicts = summary.correlation, analysis.chosen.verdicts
    labels = [f"{v.name} [{v.unit}]" for v in verdicts]
    pictures = []
    for i, j in strongest_pairs(rho):
        figure = draw_pair(
            summary.draws[:, [i, j]],
            (labels[i], labels[j]),
            (verdicts[i].value, verdicts[j].value),
            float(rho[i, j]),
        )
        pictures.append(picture("pair", figure, one=labels[i], other=labels[j]))
    return gallery("pairs", pictures, posterior=name) if pictures else None


def strongest_pairs(rho: Array) -> list[tuple[int, int]]:
    """Return the pairs of the largest correlations, those below `LEAST_CORRELATION` left out."""
    i, j = np.triu_indices(len(rho), 1)
    size = np.abs(rho[i, j])
    order = [k for k in np.argsort(-size, kind="stable")[:PAIRS] if size[k] >= LEAST_CORRELATION]
    return [(int(i[k]), int(j[k])) for k in order]


def convergence_table(analysis: Analysis) -> Table:
    """Return the numbers that decide whether a posterior may be shown, and their limits."""
    rows: list[tuple[Any, ...]] = []
    for name, summary in summaries(analysis).items():
        if summary is not None:
            c = summary.convergence
            numbers = (c.rhat.max(), c.ess_bulk.min(), c.ess_tail.min(), c.tau.max(), c.acceptance)
            good = summary.trustworthy
            word = Cell("yes" if good else "no", badge="pass" if good else "differs")
            rows.append((name, *numbers, word))
    limits = Thresholds()
    limit = words("analysis.limits", **asdict(limits), percent=100 * limits.acceptance)
    rows.append(("limit", *(Cell(text, np.nan) for text in limit.values())))
    return Table.of("Convergence of the chains", CONVERGENCE, rows)


# Where knowledge of each standard parameter comes from, and the room that each body has.


#: Standard parameters drawn at once, and rows of one picture.
SHOWN, ROWS_STANDARD = 40, 20


def section_standard(analysis: Analysis) -> Section:
    """Return what determines each standard parameter, and how much was learned of it."""
    belief = analysis.belief
    assert belief is not None
    if belief.standard is None or shown(analysis)[BODIES] is None:
        notes = [n for n in posterior_notes(analysis) if "bodies" in n.title]
        why = " ".join(f"{n.title} {n.text}" for n in notes)
        doubt = Notes((note("no-standard", why=why),))
        return replace(section("analysis.no-standard", doubt), name="standard")
    known = belief.standard
    counts = [
        sentence("analysis.sources", kind.value, n=known.source.count(kind)) for kind in Source
    ]
    size, (first, rest) = len(known.names), contraction_order(known)
    others = Fold(
        f"The other {format_count(len(rest), 'parameter')}", (_contraction_gallery(known, rest),)
    )
    return section(
        "analysis.standard",
        _contraction_gallery(known, first),
        others if len(rest) else None,
        Fold(f"All {size} standard parameters", (standard_table(analysis, known),)),
        size=size,
        counts=join(counts),
    )


STANDARD = (
    Column("parameter"),
    Column("robot file", stated_text),
    Column("prior sd", digits(3)),
    Column("posterior", "number"),
    Column("± sd", "error"),
    Column("unit"),
    Column("contraction", lambda x: f"{x:.2f}".replace("-", "−")),
    Column("determined by", "badge"),
)


def contraction_order(known: StandardBelief) -> tuple[np.ndarray, np.ndarray]:
    """Return the parameters to draw at once and the rest, both in the order of the bodies."""
    idle = np.array([s is Source.STRUCTURE for s in known.source])
    rank = np.lexsort((-known.contraction, idle))
    first = min(SHOWN, max(int((~idle).sum()), 1))
    return np.sort(rank[:first]), np.sort(rank[first:])


def _contraction_gallery(known: StandardBelief, rows: np.ndarray) -> Gallery:
    pictures = []
    for part in np.array_split(rows, max(1, -(-len(rows) // ROWS_STANDARD))):
        names, sources = [known.names[k] for k in part], [known.source[k].value for k in part]
        figure = draw_contraction(names, known.contraction[part], sources, Verdicts.contraction)
        pictures.append(picture("contraction", figure))
    return gallery("contraction", pictures)


def standard_table(analysis: Analysis, known: StandardBelief) -> Table:
    """Return one row for each standard parameter, filtered by what determines it."""
    pairs = [measured_cells(*x) for x in zip(known.mean.tolist(), known.sd.tolist(), strict=True)]
    rows = zip(
        known.names,
        analysis.structure.nominal,
        known.prior_sd,
        *zip(*pairs, strict=True),
        [p.unit for p in analysis.base.parameters],
        known.contraction,
        [badge_cell(s.value) for s in known.source],
        strict=True,
    )
    return Table.of("", STANDARD, rows, filter_by=-1)


def section_bodies(analysis: Analysis) -> Section:
    """Return how much room each body has before it could not exist."""
    physical = analysis.chosen.physical
    region, nearest = physical.region, physical.nearest
    nominal = region.margins(analysis.structure.nominal)
    margins = np.full(len(region.names), np.nan) if nearest is None else nearest.margins
    active = () if nearest is None else nearest.active_bodies
    at_edge, origin = [n in active for n in region.names], analysis.robot.path.name
    figure = draw_margins(region.names, margins, nominal, at_edge, origin)
    signs = () if nearest is None else nearest.active_rows
    also = Terms((Term("also at their limit", join(signs, 12)),)) if signs else None
    amount = ("none", "one")[len(active)] if len(active) < 2 else "several"
    edge_text = sentence("analysis.held", amount, names=join(tuple(active)) if active else "")
    return section("analysis.bodies", picture("bodies", figure), also, held=edge_text)
