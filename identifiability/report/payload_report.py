"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from identifiability.report.blocks import Fold, Notes, Prose, Section
from identifiability.report.figures.intervals import draw_intervals
from identifiability.report.numbers import digits, format_number, join
from identifiability.report.page import Page
from identifiability.report.sections.loaded import answer_load
from identifiability.report.tables import Cell, Column, Table, measured_cells
from identifiability.report.words import columns, note, picture, section, sentence
from identifiability.workflows.payload import Load, Quantity


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
    own = columns(
        "load",
        Column("quantity", get="name"),
        Column("value", "number", lambda q: _value(q)[0]),
        Column("± 95 %", "error", lambda q: _value(q)[1]),
        Column("from", digits(3), "low"),
        Column("to", digits(3), "high"),
        Column("unit", get="unit"),
        Column("told", get=_told),
    )
    table = Table.of("Mass, centre, and moments about the centre", own, result.quantities)
    return section("payload.quantities", table, body=result.body)


def _value(quantity: Quantity) -> tuple[Cell, Cell]:
    """Return a quantity and half of its interval, which is not about the value of one untold."""
    if quantity.told:
        return measured_cells(quantity.value, quantity.half)
    return Cell(format_number(quantity.value, 2), quantity.value), Cell("")


def _told(quantity: Quantity) -> Cell:
    return Cell("yes" if quantity.told else "no", note=quantity.why)


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
