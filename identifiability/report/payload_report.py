"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from identifiability.foundation.rounding import (
    digits,
    join,
)
from identifiability.report.blocks import (
    Answers,
    Fold,
    Notes,
    Prose,
    Section,
    Sketch,
    picture,
    section,
)
from identifiability.report.comparison_report import draw_intervals
from identifiability.report.page import Page
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import note, sentence
from identifiability.workflows.payload import Load, value_text

# What a payload answers first: how heavy and where, how well known, may I trust it, what next.


def answer_load(result: Load) -> Answers:
    """Return the first screen of a payload."""
    return Answers(result.answers(), _sketch(result))


def _sketch(result: Load) -> Sketch | None:
    text = value_text(result.mass) if result.mass.told else "the load would hang here"
    return sketch_parts(result.robot, {result.body: Part("vermilion", text)}, "decision.loaded")


# The report on a `Load`: mass, centre and inertia of what hangs on a body.


def build_payload_page(result: Load) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    return Page(
        title=result.robot.title or result.robot.name,
        sections=tuple(
            s for s in (section_quantities(result), section_logs(result), section_how(result)) if s
        ),
        overline="Payload report",
        subtitle=f"{result.robot.path.name} · {result.model} · {join(result.logs, 3)}",
        summary=(
            answer_load(result),
            *([Notes(tuple(note("hint", hint=h) for h in result.hints))] if result.hints else []),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def section_quantities(result: Load) -> Section:
    """Return every quantity with its interval, and why some are not told."""
    return section("payload.quantities", result.tables()[0], body=result.body)


def section_logs(result: Load) -> Section | None:
    """Return the mass by each log alone, where there are several."""
    frame = result.log_frame()
    if frame.empty:
        return None
    figure = draw_intervals(
        frame["log"].tolist(),
        frame["mass"].to_numpy(float),
        frame["half"].to_numpy(float),
        "mass [kg]",
        result.mass.value,
    )
    return section("payload.logs", picture("masses", figure))


def section_how(result: Load) -> Section:
    """Return how the load was found, and what it leaves of the torque."""
    rows = zip(result.robot.joints, result.estimate.rms, result.robot.torque_units, strict=True)
    left = join([f"{joint} {digits(3)(rms)} {unit}" for joint, rms, unit in rows], 12)
    pairs = join([f"{one} with {other}" for one, other in result.pairs])
    words = "payload.how"
    return section(
        "payload.method",
        sentence(words, "plain", body=result.body),
        sentence(words, "pairs", pairs=pairs) if pairs else None,
        sentence(words, "left", rms=left),
    )
