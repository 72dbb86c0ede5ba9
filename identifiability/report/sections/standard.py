"""Where knowledge of each standard parameter comes from, and the room that each body has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.report.blocks import Fold, Gallery, Notes, Section, Term, Terms
from identifiability.report.figures.belief import draw_contraction, draw_margins
from identifiability.report.numbers import digits, format_count, join, stated_text
from identifiability.report.sections.belief import BODIES, posterior_notes, shown
from identifiability.report.tables import Column, Table, badge_cell, measured_cells
from identifiability.report.words import gallery, note, picture, section, sentence
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.belief import LEARNED, Source, StandardBelief

#: Standard parameters drawn at once, and rows of one picture.
SHOWN, ROWS = 40, 20


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
    for part in np.array_split(rows, max(1, -(-len(rows) // ROWS))):
        names, sources = [known.names[k] for k in part], [known.source[k].value for k in part]
        figure = draw_contraction(names, known.contraction[part], sources, LEARNED)
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
    held, origin = [n in active for n in region.names], analysis.robot.path.name
    figure = draw_margins(region.names, margins, nominal, held, origin)
    signs = () if nearest is None else nearest.active_rows
    also = Terms((Term("also at their limit", join(signs, 12)),)) if signs else None
    amount = ("none", "one")[len(active)] if len(active) < 2 else "several"
    held_text = sentence("analysis.held", amount, names=join(tuple(active)) if active else "")
    return section("analysis.bodies", picture("bodies", figure), also, held=held_text)
