"""The report on a `Batch`: one row a robot, with a link to its own page."""

from __future__ import annotations

from urllib.parse import quote

from markupsafe import Markup

from identifiability.foundation.errors import listing
from identifiability.report.blocks import Answer, Answers, Fold, Note, Notes, Prose, Section
from identifiability.report.numbers import NONE, error_text, format_count, rough_percent
from identifiability.report.page import Page
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import columns, section
from identifiability.workflows.batch import Batch, Row


def build_batch_page(result: Batch) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    return Page(
        title=result.name,
        sections=(section_robots(result), *section_failed(result)),
        overline="Batch",
        subtitle=f"{result.verb} · {format_count(len(result.rows), 'robot')}",
        summary=(
            answer_batch(result),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def answer_batch(result: Batch) -> Answers:
    """Return whether every robot has an answer, how well they are described, and what to check."""
    return Answers((_done(result), _errors(result), _check(result)))


def _done(result: Batch) -> Answer:
    done, total = len(result.done), len(result.rows)
    names = listing([row.robot for row in result.failed])
    short = f"Yes, all {total}." if done == total else f"{done} of {total}."
    text = f"Without one: {names}; why is said below." if names else ""
    return Answer("Has every robot an answer?", short, text, "amber" if names else "green")


def _errors(result: Batch) -> Answer:
    question, worst = "How well is unseen motion predicted?", result.worst
    if not worst:
        return Answer(question, "Not known.", tone="grey")
    errors = [row.unseen for row in worst]
    short = f"With an error of {rough_percent(errors[-1])} to {rough_percent(errors[0])}."
    named = [f"{row.robot} ({rough_percent(row.unseen)})" for row in worst[:3]]
    text = f"Half of them err by less than {rough_percent(errors[len(errors) // 2])}."
    return Answer(question, short, f"{text} The largest: {listing(named)}.", "blue")


def _check(result: Batch) -> Answer:
    lacking = [row.robot for row in result.done if row.missing]
    warned = [row.robot for row in result.done if row.warnings]
    parts = [
        f"Something is missing in the model of {listing(lacking)}." if lacking else "",
        f"There are warnings on {listing(warned)}." if warned else "",
    ]
    count = len({*lacking, *warned})
    short = f"{format_count(count, 'robot')} first." if count else "Nothing stands out."
    tone = "amber" if count else "green"
    return Answer("Which should I look at?", short, " ".join(filter(None, parts)), tone)


def _link(row: Row) -> Cell:
    link = Markup('<a href="{}">{}</a>').format(quote(row.page), row.robot)
    return Cell(link if row.page else row.robot, row.robot, note=row.file)


def _count(kind: str) -> Column:
    def of(row: Row) -> object:
        return row.verdicts.get(kind, 0) if row.verdicts else None

    return Column(kind, "number", of)


def _error(title: str, name: str) -> Column:
    def of(row: Row) -> Cell:
        error = getattr(row, name)
        return Cell(NONE, float("nan")) if error is None else Cell(error_text(error), error)

    return Column(title, "number", of)


def section_robots(result: Batch) -> Section:
    """Return the table of robots."""
    kinds = list(dict.fromkeys(kind for row in result.rows for kind in row.verdicts))
    before = [_error("before", "error_before")] if result.verb == "diagnose" else []
    own = columns(
        "batch",
        Column("robot", "text", _link),
        Column("model", "text", "model"),
        Column("size", "number", "parameters"),
        *map(_count, sorted(kinds)),
        _error("error", "error"),
        *before,
        _error("unseen", "error_unseen"),
        Column("missing", "text", lambda row: "; ".join(row.missing)),
        Column("warnings", "text", lambda row: " ".join(row.warnings)),
    )
    return section("batch.robots", Table.of("One row a robot", own, result.rows))


def section_failed(result: Batch) -> tuple[Section, ...]:
    """Return why some robots have no answer, if there are any."""
    notes = tuple(Note("warning", row.robot, row.failed) for row in result.failed)
    return (section("batch.failed", Notes(notes)),) if notes else ()
