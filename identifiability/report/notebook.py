"""What a notebook shows of a result: what its page answers first, and its table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

import pandas as pd
from markupsafe import Markup

from identifiability.foundation.answers import Table, frame_table
from identifiability.foundation.result import Result
from identifiability.report.blocks import Answers
from identifiability.report.page import page_environment
from identifiability.report.results import answer_first

#: Rows that are shown; the rest is counted.
SHOWN = 60

_PIECE = """{% import "macros.html.j2" as m %}
<div class="identifiability-piece"><style>{{ style }}</style>
{% if answers %}{{ m.answers(answers) }}{% endif %}
{% for line in lines %}<p class="statement">{{ line | symbols }}</p>
{% endfor %}
{% for table in tables %}{{ m.table(table) }}{% endfor %}
{% if rest %}<p class="subtitle">{{ rest }}</p>{% endif %}
</div>
"""


def notebook_result(result: Result) -> str:
    """Return what the page of a result answers first, with its robot, and its tables."""
    tables = result.tables()
    frame = None if tables else result.to_frame()
    return notebook_piece("", frame, "to_frame()", answer_first(result), tables)


def notebook_piece(
    statement: str,
    frame: pd.DataFrame | None = None,
    more: str = "",
    answers: Answers | None = None,
    tables: Sequence[Table] = (),
) -> str:
    """Return sentences and a table as HTML that needs nothing and leaves other cells alone.

    Parameters
    ----------
    statement : str
        A paragraph a line.
    frame : DataFrame, optional
        Of its rows the first `SHOWN`; words of verdicts bear their marks.
    more : str
        What gives the table as a whole, for the sentence that counts other rows.
    answers : Answers, optional
        What stands before the sentences.
    tables : sequence of Table
        Of which what is detail is left out.
    """
    rest = 0 if frame is None else max(len(frame) - SHOWN, 0)
    own = [] if frame is None or frame.empty else [frame_table(frame[:SHOWN], digits=4)]
    said = f"{rest} more rows: {more}" if rest and more else f"{rest} more rows" if rest else ""
    return (
        page_environment()
        .from_string(_PIECE)
        .render(
            answers=answers,
            lines=[line for line in statement.splitlines() if line.strip()],
            tables=[*(table.brief(SHOWN) for table in tables), *own],
            rest=said,
            style=Markup(_style()),
        )
    )


@cache
def _style() -> str:
    """Return the report's style sheet for the piece alone."""
    loader = page_environment().loader
    assert loader is not None
    sheet = loader.get_source(page_environment(), "style.css")[0]
    sheet = re.sub(r"/\*.*?\*/", "", sheet, flags=re.DOTALL)
    own = re.sub(r"(?m)^(\s*)(?::root|html|body|main)(?=\s*\{)", r"\1:scope", sheet)
    tidy = (
        ".chips, .arrow, .copy { display: none; } thead button { pointer-events: none; } "
        "tbody th { min-width: 0; } td.is-text:last-child { min-width: 280px; } "
    )
    narrow = ":scope { max-width: 100%; padding: 0 4px; font-size: 14px; background: none; }"
    return f"@scope (.identifiability-piece) {{\n{own}\n{narrow}\n{tidy}\n}}"
