"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.report.answers import answer_next
from identifiability.report.blocks import Answer, Answers, Fold, Notes, Prose, Section, Sketch
from identifiability.report.comparison_report import draw_intervals
from identifiability.report.numbers import digits, format_measured, format_number, join, percent
from identifiability.report.page import Page
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.report.tables import Cell, Column, Table, measured_cells
from identifiability.report.words import columns, note, picture, section, sentence
from identifiability.workflows.commands import name_logs, quote, source_name
from identifiability.workflows.payload import Load, Quantity

# What a payload answers first: how heavy and where, how well known, may I trust it, what next.


def answer_load(result: Load) -> Answers:
    """Return the first screen of a payload."""
    next_ = answer_next(_next_commands(result))
    return Answers((_what(result), _known(result), _trust(result), next_), _sketch(result))


def value_text(quantity: Quantity) -> str:
    """Return a quantity with half of its 95 % interval, rounded together."""
    value, half = format_measured(quantity.value, quantity.half)
    return f"{value} ± {half} {quantity.unit}"


def _what(result: Load) -> Answer:
    question, mass = f"What hangs on {result.body}?", result.mass
    if not np.isfinite(mass.half):
        return Answer(question, "These logs do not tell.", tone="grey")
    if not mass.told:
        short = f"Nothing surely: at most {format_number(mass.high, 2)} kg."
        return Answer(question, short, tone="amber")
    gains = "It is proportional to the torque constants by which the torque was read."
    centre = [result.of[f"centre {axis}"] for axis in "xyz"]
    told = [f"{q.name[-1]} = {value_text(q)}" for q in centre if q.told]
    text = f"Its centre in the frame of {result.body}: {join(told)}." if told else ""
    return Answer(question, f"{value_text(mass)} (95 %).", f"{text} {gains}".strip(), "blue")


def _known(result: Load) -> Answer:
    mass, count = result.mass, sum(q.told for q in result.quantities)
    short = f"{count} of {len(result.quantities)} quantities are told."
    if mass.told and np.isfinite(mass.half):
        short = f"The mass to {percent(mass.half / mass.value, 2)}; {short}"
    lost = [q.name for q in result.quantities if not q.told]
    text = f"Not told: {join(lost, len(lost))}; the table says why." if lost else ""
    return Answer("How well is it known?", short, text, "green" if mass.told else "amber")


def _trust(result: Load) -> Answer:
    answer = _trusted(result)
    text = " ".join(filter(None, (answer.text, result.friction)))
    return replace(answer, text=text)


def _trusted(result: Load) -> Answer:
    question, motions = "May I trust it?", result.estimate.motions
    if result.caveats:
        return Answer(question, "With care: the robot changed since.", result.caveats[0], "amber")
    if motions is not None and not motions.agree:
        text = "Intervals are widened to hold all of them."
        return Answer(question, "With care: the logs disagree.", text, "amber")
    if len(result.pairs) == len(result.logs):
        text = "Each log has one of the same motion without the load: what the model gets wrong "
        return Answer(question, "Yes, within its intervals.", f"{text}along it cancels.", "green")
    if motions is None:
        text = "One motion cannot show what another would change."
        return Answer(question, "As far as one log can tell.", text, "amber")
    return Answer(question, "Yes, within its intervals.", "The logs agree.", "green")


def _next_commands(result: Load) -> list[tuple[str, str]]:
    robot, logs = source_name(result.robot), name_logs(result.robot, result.logs)
    call = f"identifiability payload {robot} {quote(result.origin)} {logs} --body {result.body}"
    without = "".join(f" --without {quote(n)}" for n in result.without)
    out = []
    if len(result.pairs) < len(result.logs):
        text = "Weigh it against a log of the same motion without the load (empty.csv):"
        out.append((text, f"{call} --without empty.csv --report payload.html"))
    if not all(q.told for q in result.quantities):
        begun = name_logs(result.robot, result.logs, "--start-from")
        text = "Find a motion that tells more:"
        out.append((text, f"identifiability excite {robot} {begun} --out next.json"))
    if result.mass.told:
        out.append(("Keep the numbers for other programs:", f"{call}{without} --json load.json"))
    return out


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
    return section("payload.quantities", quantity_table(result), body=result.body)


def quantity_table(result: Load) -> Table:
    """Return one row a quantity."""
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
    return Table.of("Mass, centre, and moments about the centre", own, result.quantities)


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
