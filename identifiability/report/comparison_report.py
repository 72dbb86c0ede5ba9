"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.answers import Column, Table, measured_cells
from identifiability.foundation.names import Array, shorten_paths
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import digits, join, rough_percent
from identifiability.report.blocks import Section, Sketch, fold_rows, picture, section
from identifiability.report.drawing import DASHED, INK, drawn, row_canvas, row_lines, whiskers
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import with_hints
from identifiability.workflows.compare import ALL_JOINTS, Comparison, describe

# Values of several things with their intervals, a row each.


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
    figure, axes = row_canvas(names, row=26, top=14, xlabel=xlabel)
    whiskers(axes, values, np.arange(len(names), dtype=float), halves)
    axes.axvline(line, color=INK, **DASHED)
    row_lines(axes, len(names))
    return figure


# What a comparison answers first: what changed, how small a change shows, trust, what next.


def sketch(result: Comparison) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    parts = {name: Part("grey", "nothing changed for sure") for name in result.robot.joints}
    for change in result.changes:
        owners = result.robot.joints if change.place == ALL_JOINTS else (change.place,)
        parts |= {owner: Part("vermilion", describe(change)) for owner in owners}
    return sketch_parts(result.robot, parts, "decision.changed")


# The report on a `Comparison`: what changed between two logs or results.


def heading(result: Comparison) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    kinds = {"pairs": "the same motion", "logs": "different motions", "results": "two results"}
    kind = kinds[result.kind]
    return "Comparison report", f"{result.robot.path.name} · {result.submodel.name} · {kind}"


def sections(result: Comparison) -> list[Section | None]:
    """Return the sections of the page."""
    builders = (section_changes, section_friction, section_parameters, section_method)
    return [build(result) for build in builders]


def section_changes(result: Comparison) -> Section | None:
    """Return what changed; None where nothing did."""
    table = result.tables()[0]
    return section("comparison.changes", table) if table.rows else None


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
    # Parameters that the figure shows.
    order = np.argsort(-frame["sigmas"].abs().to_numpy(float))[:24]
    largest = frame.iloc[order]
    halves = np.full(len(largest), REACH)
    figure = draw_intervals(
        largest["name"].tolist(), largest["sigmas"].to_numpy(float), halves, "change [σ]"
    )
    own = with_hints(
        "compared",
        Column("parameter", "code", "name"),
        Column("before", "number", lambda r: measured_cells(r.before, r.sd)[0]),
        Column("after", "number", lambda r: measured_cells(r.after, r.sd)[0]),
        Column("± σ", "error", lambda r: measured_cells(r.after, r.sd)[1]),
        Column("unit", get="unit"),
        Column("in σ", digits(2), "sigmas"),
    )
    rows: list[Any] = list(frame.itertuples())
    beyond = (frame["sigmas"].abs() > REACH).tolist()
    table = Table.of("Before and after", own, rows)
    tables = fold_rows(table, beyond, f"that differ by more than {REACH:.3g} σ", "nearer")
    shown = picture("changes", figure, count=len(largest))
    return section("comparison.parameters", shown, *tables)


def section_method(result: Comparison) -> Section:
    """Return what was compared, and how."""
    every = (*result.before, *result.after)
    called = dict(zip(every, shorten_paths(every), strict=True))
    pairs = join([f"{called[one]} with {called[other]}" for one, other in result.pairs])
    return section(
        "comparison.method",
        result.how,
        result.nuisances or None,
        f"Compared: {pairs}." if pairs else None,
    )
