"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.rounding import rough_percent
from identifiability.report.blocks import Section, Sketch, section
from identifiability.report.skeleton import Part, sketch_parts
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
    changes, friction = result.tables()[0], list(result.found_from.items())
    own = (Column("joint"), Column("found from", rough_percent))
    least = Table.of("Smallest change that is found", own, friction)
    return [
        section("comparison.changes", changes) if changes.rows else None,
        section("comparison.friction", least) if friction else None,
    ]
