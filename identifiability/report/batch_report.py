"""The report on a `Batch`: one row a robot, with a link to its own page."""

from __future__ import annotations

from identifiability.foundation.answers import Note
from identifiability.foundation.rounding import format_count
from identifiability.report.blocks import Answers, Fold, Notes, Prose, Section
from identifiability.report.page import Page
from identifiability.report.words import section
from identifiability.workflows.batch import Batch


def build_batch_page(result: Batch) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    return Page(
        title=result.name,
        sections=(section_robots(result), *section_failed(result), *section_warnings(result)),
        overline="Batch",
        subtitle=f"{result.verb} · {format_count(len(result.rows), 'robot')}",
        summary=(
            answer_batch(result),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def answer_batch(result: Batch) -> Answers:
    """Return whether every robot has an answer, how well they are described, and what to check."""
    return Answers(result.answers())


def section_robots(result: Batch) -> Section:
    """Return the table of robots."""
    return section("batch.robots", *result.tables())


def section_warnings(result: Batch) -> tuple[Section, ...]:
    """Return what to check in logs and files, robot by robot, if there is anything."""
    notes = tuple(Note("note", row.robot, " ".join(row.warnings)) for row in result.done)
    notes = tuple(n for n in notes if n.text)
    return (section("batch.warnings", Notes(notes)),) if notes else ()


def section_failed(result: Batch) -> tuple[Section, ...]:
    """Return why some robots have no answer, if there are any."""
    notes = tuple(Note("warning", row.robot, row.failed) for row in result.failed)
    return (section("batch.failed", Notes(notes)),) if notes else ()
