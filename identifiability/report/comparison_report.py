"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.numbers import REACH
from identifiability.report.blocks import Fold, Notes, Prose, Section
from identifiability.report.figures.intervals import draw_intervals
from identifiability.report.numbers import digits, join, rough_percent
from identifiability.report.page import Page
from identifiability.report.sections.compared import answer_comparison
from identifiability.report.tables import Column, Table, measured_cells
from identifiability.report.words import columns, note, picture, section
from identifiability.workflows.compare import Comparison

#: Parameters that the figure shows.
SHOWN = 24


def build_comparison_page(result: Comparison) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    kinds = {"pairs": "the same motion", "logs": "different motions", "results": "two results"}
    sections = (section_changes, section_friction, section_parameters, section_method)
    return Page(
        title=result.robot.title or result.robot.name,
        sections=tuple(s for s in (build(result) for build in sections) if s is not None),
        overline="Comparison report",
        subtitle=f"{result.robot.path.name} · {result.rung.name} · {kinds[result.difference.kind]}",
        summary=(
            answer_comparison(result),
            *([Notes(tuple(note("hint", hint=h) for h in result.hints))] if result.hints else []),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def section_changes(result: Comparison) -> Section | None:
    """Return what changed; None where nothing did."""
    rows = list(result.to_frame().itertuples())
    if not rows:
        return None
    own = columns(
        "changes",
        Column("what", get="what"),
        Column("number", "code", "name"),
        Column("change", "number", lambda r: measured_cells(r.change, _half(r))[0]),
        Column("± 95 %", "error", lambda r: measured_cells(r.change, _half(r))[1]),
        Column("unit", get="unit"),
        Column("share", rough_percent, "share"),
        Column("p", digits(2), "p"),
    )
    return section("comparison.changes", Table.of("With 95 % intervals", own, rows))


def _half(row: Any) -> float:
    return 0.5 * float(row.high - row.low)


def section_friction(result: Comparison) -> Section | None:
    """Return how small a change of friction would have been found; None where none is told."""
    rows = [(joint, share) for joint, share in result.found_from.items() if np.isfinite(share)]
    if not rows:
        return None
    own = (Column("joint"), Column("found from", rough_percent))
    return section("comparison.friction", Table.of("Smallest change that is found", own, rows))


def section_parameters(result: Comparison) -> Section:
    """Return every parameter before and after, and the largest differences as a figure."""
    frame = result.parameters_frame()
    order = np.argsort(-frame["sigmas"].abs().to_numpy(float))[:SHOWN]
    largest = frame.iloc[order]
    halves = np.full(len(largest), REACH)
    figure = draw_intervals(
        largest["name"].tolist(), largest["sigmas"].to_numpy(float), halves, "change [σ]"
    )
    own = columns(
        "compared",
        Column("parameter", "code", "name"),
        Column("before", "number", lambda r: measured_cells(r.before, r.sd)[0]),
        Column("after", "number", lambda r: measured_cells(r.after, r.sd)[0]),
        Column("± σ", "error", lambda r: measured_cells(r.after, r.sd)[1]),
        Column("unit", get="unit"),
        Column("in σ", digits(2), "sigmas"),
    )
    rows: list[Any] = list(frame.itertuples())
    table = Table.of("Before and after", own, rows)
    shown = picture("changes", figure, count=len(largest))
    return section("comparison.parameters", shown, table)


def section_method(result: Comparison) -> Section:
    """Return what was compared, and how."""
    pairs = join([f"{one} with {other}" for one, other in result.pairs])
    return section("comparison.method", result.how, f"Compared: {pairs}." if pairs else None)
