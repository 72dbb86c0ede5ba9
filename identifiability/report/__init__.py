"""Reports: results in, one self-contained HTML file out.

What to use when: `write_analysis_report` for an `Analysis`; `write_page` for everything else: a
statement, and sections made of `Table` (or `frame_table` of a DataFrame, with `check_cell`),
`Picture` of a Matplotlib figure, `Prose`, `Notes`, `Terms`, `Gallery` and `Fold`. Figures that
follow the page's light and dark colours are in `identifiability.report.figures`.

Example
-------
>>> import pandas as pd
>>> from identifiability.report import Page, Section, check_cell, frame_table, render_page
>>> frame = pd.DataFrame({"model": ["Model 4"], "ε_RA": [check_cell("4.5 %", True, "4.5 ± 0.2")]})
>>> section = Section("table-3", "Table 3", "Noise", (frame_table(frame),))
>>> "4.5 ± 0.2" in render_page(Page("Noise", "All rows pass.", (section,)))
True
"""

# ruff: noqa: I001 - a type checker wants each name twice, and isort then a line for each

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identifiability.foundation.answers import (
        Answer as Answer,
        Cell as Cell,
        Column as Column,
        Note as Note,
        Table as Table,
        frame_table as frame_table,
    )
    from identifiability.foundation.quoting import for_svg as for_svg
    from identifiability.report import plot as plot
    from identifiability.report.blocks import (
        Answers as Answers,
        Block as Block,
        Fold as Fold,
        Gallery as Gallery,
        Notes as Notes,
        Picture as Picture,
        Prose as Prose,
        Section as Section,
        Term as Term,
        Terms as Terms,
        check_cell as check_cell,
    )
    from identifiability.report.figures import (
        COLOURS as COLOURS,
        canvas as canvas,
        drawn as drawn,
        svg as svg,
    )
    from identifiability.report.results import (
        Page as Page,
        build_page as build_analysis_page,
        build_page as build_page,
        render_page as render_page,
        write_page as write_page,
        write_result as write_analysis_report,
        write_result as write_result,
    )

#: Where each name stands. Answers are in this room, too, and need neither Matplotlib nor Jinja.
_HOMES = {
    name: home
    for home, names in {
        "foundation.answers": ("Answer", "Cell", "Column", "Note", "Table", "frame_table"),
        "foundation.quoting": ("for_svg",),
        "report.blocks": (
            *("Answers", "Block", "Fold", "Gallery", "Notes", "Picture", "Prose"),
            *("Section", "Term", "Terms", "check_cell"),
        ),
        "report.figures": ("COLOURS", "canvas", "drawn", "svg"),
        "report.results": ("Page", "build_page", "render_page", "write_page", "write_result"),
    }.items()
    for name in names
}

#: Other names of the same functions.
_ALIASES = {"build_analysis_page": "build_page", "write_analysis_report": "write_result"}

__all__ = [
    "COLOURS",
    "Answer",
    "Answers",
    "Block",
    "Cell",
    "Column",
    "Fold",
    "Gallery",
    "Note",
    "Notes",
    "Page",
    "Picture",
    "Prose",
    "Section",
    "Table",
    "Term",
    "Terms",
    "build_analysis_page",
    "canvas",
    "check_cell",
    "drawn",
    "for_svg",
    "frame_table",
    "plot",
    "render_page",
    "svg",
    "write_analysis_report",
    "write_page",
]


def __getattr__(name: str) -> Any:
    if name == "plot":
        return import_module("identifiability.report.plot")
    known = _ALIASES.get(name, name)
    if known not in _HOMES:
        raise AttributeError(f"module 'identifiability.report' has no attribute '{name}'")
    value = getattr(import_module(f"identifiability.{_HOMES[known]}"), known)
    globals()[name] = value
    return value
