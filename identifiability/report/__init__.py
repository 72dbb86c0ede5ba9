"""Reports: results in, one self-contained HTML file out.

What to use when: `write_result` for a result; `write_page` for everything else: a
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

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identifiability.foundation.answers import Answer, Cell, Column, Note, Table, frame_table
    from identifiability.report import plot

    from .blocks import (
        Answers,
        Block,
        Fold,
        Gallery,
        Notes,
        Picture,
        Prose,
        Section,
        Term,
        Terms,
        check_cell,
    )
    from .figures import COLOURS, canvas, drawn, svg
    from .results import Page, build_page, render_page, write_page, write_result

#: Where the names of `__all__` stand. Answers, in this room too, need neither Matplotlib nor Jinja.
_HOMES = (
    "report.blocks",
    "report.figures",
    "report.results",
    "foundation.answers",
)

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
    "build_page",
    "canvas",
    "check_cell",
    "drawn",
    "frame_table",
    "plot",
    "render_page",
    "svg",
    "write_page",
    "write_result",
]


def __getattr__(name: str) -> Any:
    if name == "plot":
        return import_module("identifiability.report.plot")
    homes = (import_module(f"identifiability.{home}") for home in _HOMES)
    found = next((home for home in homes if name in __all__ and hasattr(home, name)), None)
    if found is None:
        raise AttributeError(f"module 'identifiability.report' has no attribute '{name}'")
    value = getattr(found, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
