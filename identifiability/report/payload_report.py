"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from identifiability.foundation.measured import measured
from identifiability.report.blocks import Section, Tile
from identifiability.report.figures.intervals import draw_intervals
from identifiability.report.numbers import digits, join
from identifiability.report.page import Page
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import columns, picture, section, sentence
from identifiability.workflows.payload import Load, Quantity


def build_payload_page(result: Load) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    mass = result.mass
    value = measured(mass.value, mass.half, "kg") if mass.told else "not told"
    told = [q for q in result.quantities if q.told]
    return Page(
        title="Payload",
        statement=result.statement,
        sections=tuple(
            s for s in (section_quantities(result), section_logs(result), section_how(result)) if s
        ),
        overline="Payload report",
        subtitle=f"{result.robot.title or result.robot.name} · {result.model} · {result.body}",
        tiles=(
            Tile(value, f"at {result.body}", "95 % interval"),
            Tile(f"{len(told)} of {len(result.quantities)}", "quantities are told"),
            Tile(str(len(result.pairs)), "pairs of logs", "with and without, one motion"),
        ),
    )


def section_quantities(result: Load) -> Section:
    """Return every quantity with its interval, and why some are not told."""
    own = columns(
        "load",
        Column("quantity", get="name"),
        Column("value", digits(4), "value"),
        Column("from", digits(4), "low"),
        Column("to", digits(4), "high"),
        Column("unit", get="unit"),
        Column("told", get=_told),
    )
    table = Table.of("Mass, centre, and moments about the centre", own, result.quantities)
    return section("payload.quantities", table, body=result.body)


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
