"""Where knowledge of each standard parameter comes from, and the room that each body has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.report.blocks import (
    Block,
    Fold,
    Gallery,
    Note,
    Notes,
    Picture,
    Section,
    Term,
    Terms,
)
from identifiability.report.figures import draw_contraction, draw_margins
from identifiability.report.numbers import format_count, format_measured, format_number, join
from identifiability.report.sections.belief import posterior_notes, shown
from identifiability.report.sections.facts import stated_text
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.belief import LEARNED, Source, StandardBelief

#: Standard parameters drawn at once, and rows of one picture.
SHOWN, ROWS = 40, 20


def section_standard(analysis: Analysis) -> Section:
    """Return what determines each standard parameter, and how much was learned of it."""
    belief = analysis.belief
    assert belief is not None
    title = "Where knowledge of each mass and inertia comes from"
    if belief.standard is None or shown(belief.physical) is None:
        notes = [n for n in posterior_notes(analysis) if "bodies" in n.title]
        why = " ".join(f"{n.title} {n.text}" for n in notes)
        note = Note("warning", "Nothing is said of standard parameters.", why)
        return Section("standard", title, "", (Notes((note,)),))
    known = belief.standard
    counts = [f"{sum(s is kind for s in known.source)} by the {_WORDS[kind]}" for kind in Source]
    lead = (
        f"The logs determine combinations; of the {len(known.names)} standard parameters behind "
        f"them {join(counts)} are determined. Contraction is the share of the prior's sd that is "
        "gone after the data."
    )
    first, rest = contraction_order(known)
    blocks: list[Block] = [_contraction_gallery(known, first)]
    if len(rest):
        summary = f"The other {format_count(len(rest), 'parameter')}"
        blocks.append(Fold(summary, (_contraction_gallery(known, rest),)))
    table = standard_table(analysis, known)
    blocks.append(Fold(f"All {len(known.names)} standard parameters", (table,)))
    return Section("standard", title, lead, tuple(blocks))


_WORDS = {
    Source.DATA: "data",
    Source.CONSTRAINT: "constraint that bodies can exist",
    Source.PRIOR: "prior",
    Source.STRUCTURE: "structure (no motion shows them)",
}


def contraction_order(known: StandardBelief) -> tuple[np.ndarray, np.ndarray]:
    """Return the parameters to draw at once and the rest, both in the order of the bodies."""
    idle = np.array([s is Source.STRUCTURE for s in known.source])
    rank = np.lexsort((-known.contraction, idle))
    first = min(SHOWN, max(int((~idle).sum()), 1))
    return np.sort(rank[:first]), np.sort(rank[first:])


def _contraction_gallery(known: StandardBelief, rows: np.ndarray) -> Gallery:
    parts = np.array_split(rows, max(1, -(-len(rows) // ROWS)))
    figures = [
        draw_contraction(
            [known.names[k] for k in part], known.contraction[part],
            [known.source[k].value for k in part], LEARNED,
        )
        for part in parts
    ]  # fmt: skip
    pictures = tuple(Picture(f, alt="Contraction of standard parameters") for f in figures)
    return Gallery(
        pictures,
        "0: the posterior is as wide as the prior, nothing was learned; 1: known exactly. The mark "
        "says what determines the parameter.",
    )


def standard_table(analysis: Analysis, known: StandardBelief) -> Table:
    """Return one row for each standard parameter, filtered by what determines it."""
    units = [p.unit for p in analysis.base.parameters]
    nominal = analysis.structure.nominal
    columns = (
        Column("parameter"),
        Column("robot file", "number"),
        Column("prior sd", "number"),
        Column("posterior", "number"),
        Column("± sd", "error"),
        Column("unit"),
        Column("contraction", "number"),
        Column("determined by", "badge"),
    )
    rows = []
    for k, name in enumerate(known.names):
        mean, sd = format_measured(float(known.mean[k]), float(known.sd[k]))
        source, learned = known.source[k].value, float(known.contraction[k])
        rows.append(
            (
                Cell(name),
                Cell(stated_text(float(nominal[k])), float(nominal[k])),
                Cell(format_number(float(known.prior_sd[k]), 3), float(known.prior_sd[k])),
                Cell(mean, float(known.mean[k])),
                Cell(f"± {sd}", float(known.sd[k])),
                Cell(units[k]),
                Cell(f"{learned:.2f}".replace("-", "−"), learned),
                Cell(source, source, badge=source),
            )
        )
    return Table("", columns, tuple(rows), filter_by=len(columns) - 1)


def section_bodies(analysis: Analysis) -> Section:
    """Return how much room each body has before it could not exist."""
    physical = analysis.chosen.physical
    region, nearest = physical.region, physical.nearest
    nominal = region.margins(analysis.structure.nominal)
    margins = np.full(len(region.names), np.nan) if nearest is None else nearest.margins
    active = () if nearest is None else nearest.active_bodies
    lead = (
        "Every body's pseudo-inertia matrix has eigenvalues above zero if some distribution of "
        "mass can produce it; the smallest, in units of the body's own mass and size, is its room. "
        + _held_text(active)
    )
    figure = draw_margins(
        region.names, margins, nominal, [n in active for n in region.names],
        analysis.robot.path.name,
    )  # fmt: skip
    caption = (
        "Room of each body; at the left edge it is a thin rod or a flat plate, and nothing is left."
    )
    blocks: list[Block] = [Picture(figure, caption, "Margin of each body")]
    signs = () if nearest is None else nearest.active_rows
    if signs:
        blocks.append(Terms((Term("also at their limit", join(signs, 12)),)))
    return Section("bodies", "Can each body exist?", lead, tuple(blocks))


def _held_text(active: Sequence[str]) -> str:
    if not active:
        return (
            "No body of the nearest real robot is at the edge: the data alone keep them possible."
        )
    verb = "is" if len(active) == 1 else "are"
    return f"In the nearest real robot {join(tuple(active))} {verb} held at the edge."
