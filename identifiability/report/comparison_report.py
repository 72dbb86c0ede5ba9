"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.shares import REACH
from identifiability.report.blocks import Section, Tile
from identifiability.report.figures.intervals import draw_intervals
from identifiability.report.numbers import digits, join, rough_percent
from identifiability.report.page import Page
from identifiability.report.tables import Column, Table
from identifiability.report.words import columns, picture, section
from identifiability.workflows.compare import Comparison

#: Parameters that the figure shows.
SHOWN = 24


def build_comparison_page(result: Comparison) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    kind = {"pairs": "the same motion", "logs": "different motions", "results": "two results"}
    sections = (section_changes, section_friction, section_parameters, section_method)
    return Page(
        title="Comparison",
        statement=result.statement,
        sections=tuple(s for s in (build(result) for build in sections) if s is not None),
        overline="Comparison report",
        subtitle=f"{result.robot.title or result.robot.name} · {result.rung.name}",
        tiles=(
            Tile(str(len(result.changes)), "sure changes", "family-wise level 5 %"),
            Tile(str(len(result.causes)), "causes were tested"),
            Tile(kind[result.difference.kind], "was compared"),
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
        Column("change", digits(3), "change"),
        Column("from", digits(3), "low"),
        Column("to", digits(3), "high"),
        Column("unit", get="unit"),
        Column("share", rough_percent, "share"),
        Column("p", digits(2), "p"),
    )
    return section("comparison.changes", Table.of("With 95 % intervals", own, rows))


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
        Column("before", digits(4), "before"),
        Column("after", digits(4), "after"),
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
