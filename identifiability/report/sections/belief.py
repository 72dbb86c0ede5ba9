"""What is believed after the data: intervals by every road, correlations, convergence."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.shares import REACH
from identifiability.posterior.diagnostics import Thresholds
from identifiability.report.blocks import Block, Gallery, Note, Notes, Picture, Section
from identifiability.report.figures import draw_forest, draw_pair
from identifiability.report.sections.facts import model_title, stated_values
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.belief import Summary

#: Pairs of parameters that are drawn, and the least correlation worth a picture.
PAIRS, LEAST_CORRELATION = 6, 0.3

#: Most rows of one forest plot.
ROWS = 14

_SIGNS, _BODIES = "posterior with signs", "posterior with bodies"


def section_posterior(analysis: Analysis) -> Section:
    """Return the parameters of the selected model by every road, beside each other."""
    belief = analysis.belief
    assert belief is not None
    lead = (
        f"{model_title(analysis.chosen)} by every road. Two posteriors count as many samples as "
        "are independent: one knows only which values cannot be negative, such as friction, the "
        "other that every body can exist, with a prior around the robot file."
    )
    blocks: list[Block] = []
    notes = posterior_notes(analysis)
    if notes:
        blocks.append(Notes(notes))
    blocks += [forest_gallery(analysis), *pair_gallery(analysis), convergence_table(analysis)]
    return Section("posterior", "What is believed after the data", lead, tuple(blocks))


def posterior_notes(analysis: Analysis) -> tuple[Note, ...]:
    """Return why a posterior is not shown, if one is not."""
    belief = analysis.belief
    assert belief is not None
    notes = []
    for name, summary in ((_SIGNS, belief.signs), (_BODIES, belief.physical)):
        if summary is None:
            why = belief.note.rstrip(".") or "it was not sampled"
            notes.append(Note("note", f"No {name}.", f"{why[0].upper()}{why[1:]}."))
        elif not summary.trustworthy:
            reasons = " ".join(summary.convergence.reasons)
            notes.append(
                Note("warning", f"The {name} has not converged; its numbers are withheld.", reasons)
            )
    return tuple(notes)


def shown(summary: Summary | None) -> Summary | None:
    """Return a posterior only if its numbers may be shown."""
    return summary if summary is not None and summary.trustworthy else None


def forest_gallery(analysis: Analysis) -> Gallery:
    """Return a forest plot for each group of parameters."""
    columns = analysis.chosen.rung.columns
    layers, stated = forest_layers(analysis)
    pictures = []
    for kind, rows in forest_groups(columns):
        figure = draw_forest(
            [columns[k] for k in rows], {n: v[rows] for n, v in layers.items()}, stated[rows],
            analysis.robot.path.name,
        )  # fmt: skip
        pictures.append(Picture(figure, f"{kind.capitalize()}.", f"95 % intervals of {kind}"))
    caption = (
        "95 % intervals by each road, as distance from the estimate in its robust σ; ▸ is beyond "
        "the axis. Where the motion leaves a value open, distances are from the posterior with "
        "bodies, in its sd. The bar is what the robot file states."
    )
    return Gallery(tuple(pictures), caption)


_GROUPS = ("bodies", "friction", "rotor inertia", "other effects")


def forest_groups(columns: tuple[str, ...]) -> list[tuple[str, np.ndarray]]:
    """Return each group with the rows of its parameters, at most `ROWS` at a time."""
    kinds = [group_of(c) for c in columns]
    parts = []
    for kind in dict.fromkeys(sorted(kinds, key=_GROUPS.index)):
        rows = np.array([k for k, other in enumerate(kinds) if other == kind])
        parts += [(kind, part) for part in np.array_split(rows, -(-len(rows) // ROWS))]
    return parts


def group_of(name: str) -> str:
    """Return the group of a parameter by its kind: bodies, friction, rotor inertia or other."""
    kind = name.rpartition(".")[2]
    if kind in INERTIAL:
        return "bodies"
    if kind in ("Ia", "Jr", "Js"):
        return "rotor inertia"
    return "friction" if kind.startswith("F") else "other effects"


def forest_layers(analysis: Analysis) -> tuple[dict[str, Array], Array]:
    """Return 95 % intervals of every road in σ_robust, (k, 3) each, and the stated values (k,)."""
    chosen, belief = analysis.chosen, analysis.belief
    assert belief is not None
    value = np.array([v.value for v in chosen.verdicts], float)
    white = np.array([v.sigma for v in chosen.verdicts], float)
    robust = np.array([v.sigma_robust for v in chosen.verdicts], float)
    open_ = ~(np.isfinite(robust) & (robust > 0) & chosen.estimate.determined)
    physical, drawn = shown(belief.physical), chosen.uncertainty.bootstrap
    half = REACH * np.array([0.0, -1.0, 1.0])
    roads = {"white σ": value[:, None] + np.outer(np.where(open_, np.nan, white), half)}
    roads["robust σ"] = value[:, None] + np.outer(np.where(open_, np.nan, robust), half)
    if drawn is not None:
        ends = np.column_stack([drawn.values.mean(0), drawn.interval()])
        roads["block bootstrap"] = np.where(open_[:, None], np.nan, ends)
    for name, summary in ((_SIGNS, shown(belief.signs)), (_BODIES, physical)):
        if summary is not None:
            roads[name] = np.column_stack([summary.mean, summary.interval])
    unknown = np.full(len(value), np.nan)
    centre = np.where(open_, unknown if physical is None else physical.mean, value)
    scale = np.where(open_, unknown if physical is None else physical.sd, robust)
    scale = np.where(scale > 0, scale, np.nan)
    stated = np.array([np.nan if s is None else s for s in stated_values(analysis, chosen)])
    layers = {n: (x - centre[:, None]) / scale[:, None] for n, x in roads.items()}
    return layers, (stated - centre) / scale


def pair_gallery(analysis: Analysis) -> tuple[Gallery, ...]:
    """Return the draws of the most correlated pairs of parameters, if any is worth a picture."""
    belief, chosen = analysis.belief, analysis.chosen
    assert belief is not None
    summary, name = shown(belief.physical), _BODIES
    if summary is None:
        summary, name = shown(belief.signs), _SIGNS
    if summary is None:
        return ()
    rho = summary.correlation
    labels = [f"{v.name} [{v.unit}]" for v in chosen.verdicts]
    values = [v.value for v in chosen.verdicts]
    pictures = tuple(
        Picture(
            draw_pair(
                summary.draws[:, i], summary.draws[:, j], (labels[i], labels[j]),
                (values[i], values[j]), float(rho[i, j]),
            ),
            alt=f"Draws of {labels[i]} and {labels[j]}",
        )
        for i, j in strongest_pairs(rho)
    )  # fmt: skip
    caption = (
        f"The most correlated pairs under the {name}: what the data tell of one they take from the "
        "other. The cross is the least-squares estimate."
    )
    return (Gallery(pictures, caption),) if pictures else ()


def strongest_pairs(rho: Array) -> list[tuple[int, int]]:
    """Return the pairs of the largest correlations, those below `LEAST_CORRELATION` left out."""
    i, j = np.triu_indices(len(rho), 1)
    size = np.abs(rho[i, j])
    order = [k for k in np.argsort(-size, kind="stable")[:PAIRS] if size[k] >= LEAST_CORRELATION]
    return [(int(i[k]), int(j[k])) for k in order]


def convergence_table(analysis: Analysis) -> Table:
    """Return the numbers that decide whether a posterior may be shown, and their limits."""
    belief, limits = analysis.belief, Thresholds()
    assert belief is not None
    columns = (
        Column("posterior"),
        Column("nested R-hat", "number", "Largest; between independent ensembles."),
        Column("effective draws", "number", "Fewest, in the bulk of a parameter."),
        Column("in the tails", "number", "Fewest, in the 5 % tails."),
        Column("autocorrelation time", "number", "Longest, in draws of one walker."),
        Column("accepted", "number", "Share of the proposals that emcee accepted."),
        Column("may be shown", "badge"),
    )
    rows = []
    for name, summary in ((_SIGNS, belief.signs), (_BODIES, belief.physical)):
        if summary is None:
            continue
        c, word = summary.convergence, "pass" if summary.trustworthy else "differs"
        numbers = (c.rhat.max(), c.ess_bulk.min(), c.ess_tail.min(), c.tau.max(), c.acceptance)
        texts = (
            f"{numbers[0]:.4f}", f"{numbers[1]:.0f}", f"{numbers[2]:.0f}", f"{numbers[3]:.1f}",
            f"{100 * numbers[4]:.0f} %",
        )  # fmt: skip
        cells = [Cell(t, float(x)) for t, x in zip(texts, numbers, strict=True)]
        rows.append((Cell(name), *cells, Cell("yes" if word == "pass" else "no", badge=word)))
    least = f"≥ {limits.ess:g}"
    limit = (
        f"≤ {limits.rhat:g}", least, least, f"draws ≥ {limits.lengths:g} ×",
        f"≥ {100 * limits.acceptance:g} %", "",
    )  # fmt: skip
    rows.append((Cell("limit"), *(Cell(text, np.nan) for text in limit)))
    return Table("Convergence of the chains", columns, tuple(rows))
