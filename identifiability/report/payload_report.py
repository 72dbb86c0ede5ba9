"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from identifiability.foundation.names import shorten_paths
from identifiability.foundation.numbers import measured
from identifiability.foundation.rounding import join
from identifiability.report.blocks import Section, Sketch, section
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import sentence
from identifiability.workflows.payload import Load


def heading(result: Load) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    logs = join(shorten_paths(result.logs), 3)
    return "Payload report", f"{result.robot.path.name} · {result.model} · {logs}"


def sketch(result: Load) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    mass = result.mass
    text = measured(mass.value, mass.half, "kg") if mass.told else "the load would hang here"
    return sketch_parts(result.robot, {result.body: Part("vermilion", text)}, "decision.loaded")


def sections(result: Load) -> list[Section | None]:
    """Return the sections of the page: gains, or quantities and how."""
    if result.gains:
        return [section("payload.gains", *result.tables())]
    every = (*result.logs, *result.without)
    called = dict(zip(every, shorten_paths(every), strict=True))
    pairs = join([f"{called[one]} with {called[other]}" for one, other in result.pairs])
    words = "payload.how"
    return [
        section("payload.quantities", result.tables()[0], body=result.body),
        section(
            "payload.method",
            sentence(words, "plain", body=result.body),
            sentence(words, "pairs", pairs=pairs) if pairs else None,
        ),
    ]
