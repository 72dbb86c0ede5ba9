"""What the structure of the robot allows to determine: rank, condition, groupings."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.report.blocks import Block, Fold, Gallery, Picture, Prose, Section, Term, Terms
from identifiability.report.figures import draw_conditions, draw_spectrum
from identifiability.report.numbers import format_count, format_number
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis


def section_structure(analysis: Analysis) -> Section:
    """Return rank with its gap, condition of each model, and the groupings."""
    base = analysis.base
    last, first = base.gap
    size = len(base.parameters)
    lead = (
        f"{base.rank} of {format_count(size, 'parameter')} are independent. The weakest of them "
        f"acts with {format_number(last, 2)} of the strongest, the next singular value is "
        f"{format_number(first, 2)}: the wider this gap, the surer the "
        "count. The condition number says how much a model magnifies errors."
    )
    blocks: tuple[Block, ...] = (structure_pictures(analysis), grouping_fold(analysis))
    if base.without_effect:
        blocks = (*blocks, idle_fold(analysis))
    return Section("structure", "Rank and condition", lead, blocks)


def structure_pictures(analysis: Analysis) -> Gallery:
    """Return the spectrum of the structure and the condition number of each model."""
    base, models = analysis.base, analysis.models
    spectrum = Picture(
        draw_spectrum(base.singular_values, base.rank, RANK_TOLERANCE),
        "Singular values of the column-scaled regressor at random states: what any motion could "
        "show. Columns that never act are left out.",
        "Singular values relative to the largest",
    )
    names = [m.name for m in models]
    condition = np.array([m.estimate.condition for m in models], float)
    conditions = Picture(
        draw_conditions(names, condition, analysis.selected),
        "Condition number along the fitted motion, columns scaled to equal length.",
        "Condition number of each model",
    )
    return Gallery((spectrum, conditions))


def grouping_fold(analysis: Analysis) -> Fold:
    """Return every base parameter with its grouping and its fate in the selected model."""
    base = analysis.base
    columns = (Column("base parameter"), Column("combination"), Column("unit"))
    use = Column(f"in {analysis.chosen.name}", hint="Kept, tied to others, held, or left out.")
    rows = tuple(
        (Cell(name), Cell(label), Cell(unit), Cell(_fate(analysis, k)))
        for k, (name, label, unit) in enumerate(
            zip(base.names, base.labels, base.units, strict=True)
        )
    )
    table = Table("", (*columns, use), rows)
    return Fold(f"Groupings of all {base.rank} base parameters", (table,))


def _fate(analysis: Analysis, row: int) -> str:
    """Return what became of a base parameter in the selected model."""
    rung = analysis.chosen.rung
    kept = [rung.columns[k] for k in np.flatnonzero(rung.M[row])]
    if not kept:
        held = float(rung.held[row])
        return f"held at {format_number(held)}" if held else "left out"
    alone = kept == [analysis.base.names[row]]
    return "kept" if alone else f"as {', '.join(kept)}"


def idle_fold(analysis: Analysis) -> Fold:
    """Return the parameters that never change the torque, by owner."""
    names = analysis.base.without_effect
    owners: dict[str, list[str]] = {}
    for name in names:
        owner, _, kind = name.rpartition(".")
        owners.setdefault(owner, []).append(kind)
    terms = Terms(tuple(Term(owner, ", ".join(kinds)) for owner, kinds in owners.items()))
    text = "No motion of this robot makes them act on the measured torque; any value will do."
    summary = f"{format_count(len(names), 'parameter')} without any effect"
    return Fold(summary, (Prose((text,)), terms))
