"""What is believed after the data: intervals by every road, pairs, convergence.

And where knowledge of each standard parameter comes from.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from identifiability.foundation.answers import Cell, Column, Note, Table, badge_cell, measured_cells
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import digits, join, stated_text, whole_percent
from identifiability.posterior.rules import RULES as POSTERIOR_RULES
from identifiability.posterior.rules import Thresholds
from identifiability.report.blocks import (
    Fold,
    Gallery,
    Notes,
    Section,
    gallery,
    picture,
    section,
    share_cell,
)
from identifiability.report.figures import draw_forest, draw_pair
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.belief import Source, Summary
from identifiability.workflows.analyze.result import model_title, stated_values
from identifiability.workflows.answers import note, sentence, with_hints, words

# The parameters of the model to use by every road.


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
        detail=True,
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
    """Return a forest plot of every `ROWS` parameters."""
    names = analysis.chosen.submodel.columns
    layers, stated = forest_layers(analysis)
    pictures = []
    for rows in np.array_split(np.arange(len(names)), -(-len(names) // ROWS)):
        own = {n: v[rows] for n, v in layers.items()}
        shown_names = [names[k] for k in rows]
        figure = draw_forest(shown_names, own, stated[rows], analysis.robot.path.name)
        ends = {"first": shown_names[0], "last": shown_names[-1]}
        pictures.append(picture("forest", figure, **ends))
    return gallery("forest", pictures)


def forest_layers(analysis: Analysis) -> tuple[dict[str, Array], Array]:
    """Return 95 % intervals of every road in σ_robust, (k, 3) each, and the stated values (k,).

    Where something is left out the label's interval is the last.
    """
    chosen, posteriors = analysis.chosen, shown(analysis)
    value, white, robust, label = np.array(
        [(v.value, v.sigma, v.sigma_robust, v.sigma_label) for v in chosen.verdicts], float
    ).T
    open_ = ~(np.isfinite(robust) & (robust > 0) & chosen.estimate.determined)
    physical, drawn = posteriors[BODIES], chosen.fit.bootstrap

    def around(sd: Array) -> Array:
        half = REACH * np.array([0.0, -1.0, 1.0])
        ends: Array = value[:, None] + np.outer(np.where(open_, np.nan, sd), half)
        return ends

    roads = {"white σ": around(white), "robust σ": around(robust)}
    if drawn is not None:
        ends = np.column_stack([drawn.values.mean(0), drawn.interval()])
        roads["block bootstrap"] = np.where(open_[:, None], np.nan, ends)
    for name, summary in posteriors.items():
        if summary is not None:
            both = np.column_stack([summary.mean, summary.interval])
            roads[name] = np.where(summary.stated[:, None], both, np.nan)
    if any(v.terms["omitted"] for v in chosen.verdicts):
        roads["label"] = around(label)
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


# Where knowledge of each standard parameter comes from.


def section_standard(analysis: Analysis) -> Section:
    """Return what determines each standard parameter, and how much was learned of it."""
    belief = analysis.belief
    assert belief is not None
    known = belief.standard
    if known is None or shown(analysis)[BODIES] is None:
        notes = [n for n in posterior_notes(analysis) if "bodies" in n.title]
        why = " ".join(f"{n.title} {n.text}" for n in notes)
        return section(
            "analysis.standard", Notes((note("no-standard", why=why),)), detail=True, said=""
        )
    counts = [
        sentence("analysis.sources", kind.value, n=known.source.count(kind)) for kind in Source
    ]
    pairs = [measured_cells(*x) for x in zip(known.mean.tolist(), known.sd.tolist(), strict=True)]
    rows = zip(
        known.names,
        analysis.structure.nominal,
        known.prior_sd,
        *zip(*pairs, strict=True),
        [p.unit for p in analysis.base.parameters],
        [share_cell(x) for x in known.contraction],
        [badge_cell(s.value) for s in known.source],
        strict=True,
    )
    size = len(known.names)
    table = Table.of("", STANDARD, rows, filter_by=-1)
    fold = Fold(f"All {size} standard parameters", (table,))
    said = sentence("analysis.known", size=size, counts=join(counts))
    return section("analysis.standard", fold, detail=True, said=said)


STANDARD = (
    Column("parameter"),
    Column("robot file", stated_text),
    Column("prior sd", digits(3)),
    Column("posterior", "number"),
    Column("± sd", "error"),
    Column("unit"),
    Column("contraction", "bar"),
    Column("determined by", "badge"),
)
