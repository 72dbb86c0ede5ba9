"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from identifiability.foundation.names import shorten_paths
from identifiability.foundation.rounding import digits, join
from identifiability.report.blocks import Section, Sketch, picture, section
from identifiability.report.figures import draw_intervals
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import sentence
from identifiability.workflows.payload import Load, value_text


def heading(result: Load) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    logs = join(shorten_paths(result.logs), 3)
    return "Payload report", f"{result.robot.path.name} · {result.model} · {logs}"


def sketch(result: Load) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    text = value_text(result.mass) if result.mass.told else "the load would hang here"
    return sketch_parts(result.robot, {result.body: Part("vermilion", text)}, "decision.loaded")


def sections(result: Load) -> list[Section | None]:
    """Return the sections of the page: gains, quantities, each log by itself, how."""
    tables, frame = result.tables(), result.log_frame()
    rows = zip(result.robot.joints, result.estimate.rms, result.robot.torque_units, strict=True)
    left = join([f"{joint} {digits(3)(rms)} {unit}" for joint, rms, unit in rows], 12)
    every = (*result.logs, *result.without)
    called = dict(zip(every, shorten_paths(every), strict=True))
    pairs = join([f"{called[one]} with {called[other]}" for one, other in result.pairs])
    words = "payload.how"
    logs = None
    if not frame.empty:
        mass, half = (frame[name].to_numpy(float) for name in ("mass", "half"))
        figure = draw_intervals(list(frame["log"]), mass, half, "mass [kg]", result.mass.value)
        logs = section("payload.logs", picture("masses", figure))
    return [
        section("payload.gains", tables[1]) if result.gains else None,
        section("payload.quantities", tables[0], body=result.body),
        logs,
        section(
            "payload.method",
            sentence(words, "plain", body=result.body),
            sentence(words, "pairs", pairs=pairs) if pairs else None,
            sentence(words, "left", rms=left),
        ),
    ]
