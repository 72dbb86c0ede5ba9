"""The report on a `Comparison`: what changed between two logs or results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.report.answers import answer_next
from identifiability.report.blocks import Answer, Answers, Fold, Notes, Prose, Section, Sketch
from identifiability.report.drawing import DASHED, INK, drawn, row_canvas, row_lines, whiskers
from identifiability.report.numbers import digits, join, rough_percent
from identifiability.report.page import Page
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.report.tables import Column, Table, measured_cells
from identifiability.report.words import columns, note, picture, section
from identifiability.workflows.commands import file_names, name_logs, quote, source_name
from identifiability.workflows.compare import LEVEL, Comparison, describe

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


#: Changes that the first line names.
SHOWN_NAMES = 3

#: What may be trusted, by what was compared.
TRUST = {
    "pairs": ("Yes: the motions are the same.", "green"),
    "logs": ("With care: the motions differ.", "amber"),
    "results": ("With care: the motions are not compared.", "amber"),
}


def answer_comparison(result: Comparison) -> Answers:
    """Return the first screen of a comparison."""
    next_ = answer_next(_next_commands(result))
    return Answers((_what(result), _least(result), _trust(result), next_), _sketch(result))


def _what(result: Comparison) -> Answer:
    sides = f"from {join(result.before, SHOWN_NAMES)} to {join(result.after, SHOWN_NAMES)}"
    question = f"What changed {sides}?"
    if not result.changes:
        tone = "amber" if result.blindness else "green"
        text = _sentence(result.blindness)
        return Answer(question, "Nothing that can be told from chance.", text, tone)
    named = [describe(change) for change in result.changes]
    short = join(named, SHOWN_NAMES)
    if result.changes[0].cause.kind != "value":  # a name is written as it is
        short = f"{short[0].upper()}{short[1:]}"
    return Answer(question, f"{short}.", _sentence(result.doubt), "vermilion")


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}." if text else ""


def _least(result: Comparison) -> Answer:
    question = "How small a change would have been found?"
    known = {j: share for j, share in result.found_from.items() if np.isfinite(share)}
    tested = f"{len(result.causes)} causes were tested."
    if not known:
        return Answer(question, "That is not known.", tested)
    least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    short = f"Friction that changes by {rough_percent(known[least])} ({least})"
    if most != least:
        short += f" to {rough_percent(known[most])} ({most})"
    return Answer(question, f"{short}.", f"Nine times in ten; {tested}", "blue")


def _trust(result: Comparison) -> Answer:
    short, tone = TRUST[result.difference.kind]
    chance = f"With nothing changed, one comparison in {round(1 / LEVEL)} would name something."
    return Answer("May I trust it?", short, f"{result.how} {chance}", tone)


def _next_commands(result: Comparison) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    if result.difference.kind == "results":
        again = f"identifiability compare {robot} before.csv after.csv --report changed.html"
        text = "Log the same motion before and after, and compare these logs, to be surer:"
        return [(text, again)]
    how = result.preparation
    before = name_logs(result.robot, result.before, how=how)
    after = name_logs(result.robot, result.after, how=how)
    kinds = {c.cause.kind for c in result.changes}
    out = []
    if "load" in kinds:
        fitted = f"identifiability analyze {robot} {before} --json result.json"
        held = "".join(f" --without {quote(n)}" for n in file_names(result.before))
        places = [c.cause.place for c in result.changes if c.cause.kind == "load"]
        weigh = f"{name_logs(result.robot, result.after)}{held} --body {places[0]}"
        call = f"{fitted} && identifiability payload {robot} result.json {weigh}"
        out.append(("Fit the robot without the load, and weigh the load:", call))
    elif result.changes:
        fit = f"identifiability analyze {robot} {after} --json result.json --report report.html"
        out.append(("Fit the robot as it is now:", fit))
    elif result.difference.kind == "pairs":
        both = name_logs(result.robot, (*result.before, *result.after), how=how)
        fit = f"identifiability analyze {robot} {both} --report report.html"
        out.append(("Nothing changed: fit all logs together:", fit))
    if result.difference.kind == "logs":
        more = "--before another.csv --report changed.html"
        text = "Log once more as before (another.csv), to see how logs of one side scatter:"
        files = name_logs(result.robot, (result.before[0], result.after[0]), how=how)
        out.append((text, f"identifiability compare {robot} {files} {more}"))
    return out


def _sketch(result: Comparison) -> Sketch | None:
    parts = {name: Part("grey", "nothing changed for sure") for name in result.robot.joints}
    for change in result.changes:
        place = change.cause.place
        owner = place if place in (*result.robot.joints, *result.robot.bodies) else ""
        parts[owner or place.rpartition(".")[0]] = Part("vermilion", describe(change))
    return sketch_parts(result.robot, parts, "decision.changed")


# The report on a `Comparison`: what changed between two logs or results.


#: Parameters that the figure shows.
SHOWN = 24


def build_comparison_page(result: Comparison) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    kinds = {"pairs": "the same motion", "logs": "different motions", "results": "two results"}
    sections = (section_changes, section_friction, section_parameters, section_method)
    return Page(
        title=result.robot.title or result.robot.name,
        sections=tuple(s for s in (build(result) for build in sections) if s is not None),
        overline="Comparison report",
        subtitle=f"{result.robot.path.name} · {result.rung.name} · {kinds[result.difference.kind]}",
        summary=(
            answer_comparison(result),
            *([Notes(tuple(note("hint", hint=h) for h in result.hints))] if result.hints else []),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def section_changes(result: Comparison) -> Section | None:
    """Return what changed; None where nothing did."""
    table = change_table(result)
    return section("comparison.changes", table) if table.rows else None


def change_table(result: Comparison) -> Table:
    """Return one row a change."""
    rows: list[Any] = list(result.to_frame().itertuples())
    own = columns(
        "changes",
        Column("what", get="what"),
        Column("number", "code", "name"),
        Column("change", "number", lambda r: measured_cells(r.change, _half(r))[0]),
        Column("± 95 %", "error", lambda r: measured_cells(r.change, _half(r))[1]),
        Column("unit", get="unit"),
        Column("share", rough_percent, "share"),
        Column("p", digits(2), "p"),
    )
    return Table.of("What changed, with 95 % intervals", own, rows)


def _half(row: Any) -> float:
    return 0.5 * float(row.high - row.low)


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
        Column("before", "number", lambda r: measured_cells(r.before, r.sd)[0]),
        Column("after", "number", lambda r: measured_cells(r.after, r.sd)[0]),
        Column("± σ", "error", lambda r: measured_cells(r.after, r.sd)[1]),
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
