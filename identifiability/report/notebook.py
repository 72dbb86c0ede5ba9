"""What a notebook shows of a result: what its page answers first, and its table."""

from __future__ import annotations

import re
from functools import cache

import pandas as pd
from markupsafe import Markup

from identifiability.foundation.result import Result
from identifiability.report.blocks import Answers
from identifiability.report.numbers import MARKS
from identifiability.report.page import page_environment
from identifiability.report.results import answer_first
from identifiability.report.tables import Table, badge_cell, frame_table

#: Rows that are shown; the rest is counted.
SHOWN = 60

#: Terms of a grouped parameter that are shown; its frame has the others.
TERMS = 3

#: Columns of a table of verdicts that are shown; its frame has the others.
OF_VERDICTS = ("name", "label", "unit", "value", "sigma_robust_percent", "verdict", "reason")

_PIECE = """{% import "macros.html.j2" as m %}
<div class="identifiability-piece"><style>{{ style }}</style>
{% if answers %}{{ m.answers(answers) }}{% endif %}
{% for line in lines %}<p class="statement">{{ line | symbols }}</p>
{% endfor %}
{% if table %}{{ m.table(table) }}{% endif %}
{% if rest %}<p class="subtitle">{{ rest }}</p>{% endif %}
</div>
"""


def notebook_result(result: Result) -> str:
    """Return what the page of a result answers first, with its robot, and its table.

    A result that has no page is its statement and its table.
    """
    answers, frame = answer_first(result), result._first_frame()
    said = result.statement if answers is None else ""
    return notebook_piece(said, frame, "to_frame()", answers)


def notebook_piece(
    statement: str,
    frame: pd.DataFrame | None = None,
    more: str = "",
    answers: Answers | None = None,
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
    """
    rest = 0 if frame is None else max(len(frame) - SHOWN, 0)
    said = f"{rest} more rows: {more}" if rest and more else f"{rest} more rows" if rest else ""
    return (
        page_environment()
        .from_string(_PIECE)
        .render(
            answers=answers,
            lines=[line for line in statement.splitlines() if line.strip()],
            table=None if frame is None or frame.empty else _table(frame[:SHOWN]),
            rest=said,
            style=Markup(_style()),
        )
    )


def _table(frame: pd.DataFrame) -> Table:
    """Return a table whose words of verdicts are badges; without what only a page's script does."""
    shown = OF_VERDICTS if set(OF_VERDICTS) <= set(frame.columns) else frame.columns
    columns = {str(name): list(frame[name]) for name in shown}
    if "label" in columns:
        columns["label"] = [_first_terms(text) for text in columns["label"]]
    for name, cells in columns.items():
        words = [x for x in cells if isinstance(x, str)]
        if words and all(word in MARKS for word in words):
            columns[name] = [badge_cell(x) if isinstance(x, str) else x for x in cells]
    return frame_table(pd.DataFrame(columns, dtype=object), digits=4)


def _first_terms(label: str) -> str:
    """Return the first terms of a sum of parameters, and how many there are beyond them."""
    parts = re.split(r" (?=[+−] )", label)
    rest = len(parts) - TERMS
    return label if rest < 2 else f"{' '.join(parts[:TERMS])} … {rest} more"


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
