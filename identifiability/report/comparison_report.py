"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.foundation.answers import Column, Table, measured_cells
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import digits, join, rough_percent
from identifiability.report.blocks import Section, Sketch, fold_rows, section
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import with_hints
from identifiability.workflows.compare import ALL_JOINTS, Comparison, describe


def heading(result: Comparison) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    kinds = {"pairs": "the same motion", "logs": "different motions", "results": "two results"}
    kind = kinds[result.kind]
    return "Comparison report", f"{result.robot.path.name} · {result.submodel.name} · {kind}"


def sketch(result: Comparison) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    parts = {name: Part("grey", "nothing changed for sure") for name in result.robot.joints}
    for change in result.changes:
        owners = result.robot.joints if change.place == ALL_JOINTS else (change.place,)
        parts |= {owner: Part("vermilion", describe(change)) for owner in owners}
    return sketch_parts(result.robot, parts, "decision.changed")


def sections(result: Comparison) -> list[Section | None]:
    """Return the sections of the page."""
    (changes,) = result.tables()
    least = [(joint, share) for joint, share in result.found_from.items() if np.isfinite(share)]
    friction = (Column("joint"), Column("found from", rough_percent))
    every = (*result.before, *result.after)
    called = dict(zip(every, shorten_paths(every), strict=True))
    pairs = join([f"{called[one]} with {called[other]}" for one, other in result.pairs])
    return [
        section("comparison.changes", changes) if changes.rows else None,
        section("comparison.friction", Table.of("", friction, least)) if least else None,
        _parameters(result),
        section(
            "comparison.method",
            result.how,
            result.nuisances or None,
            f"Compared: {pairs}." if pairs else None,
        ),
    ]


def _parameters(result: Comparison) -> Section:
    """Return every parameter before and after, those first that differ surely."""
    frame = result.parameters_frame()
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
    return section("comparison.parameters", *tables)
