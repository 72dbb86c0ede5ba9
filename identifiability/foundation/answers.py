"""`Table`: rows of cells that know how to sort, and how they look."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from numbers import Integral, Real
from operator import attrgetter
from textwrap import fill, shorten
from typing import Any, Literal, TypeAlias

import numpy as np
import pandas as pd

from .rounding import NONE, format_measured, format_number
from .values import frozen

Kind = Literal["text", "number", "error", "bar", "badge", "code"]


@frozen
class Cell:
    """The content of one row and column of a table.

    Attributes
    ----------
    text : str
    key : float, str or None
        What it sorts by; None for the text.
    note : str
        Small print below.
    badge : str
        Word whose mark (colour and symbol) the text gets.
    share : float
        Length of a bar, 0 to 1.
    link : str
        Page that the text leads to.
    more : str
        What the small print unfolds.
    """

    text: str
    key: float | str | None = None
    note: str = ""
    badge: str = ""
    share: float = 0.0
    link: str = ""
    more: str = ""


#: Format of a column: its kind, or the function that writes its numbers.
Look: TypeAlias = Kind | Callable[[Any], str]


@frozen
class Column:
    """A column of a table: its title, and where each row has the value of its cell.

    Attributes
    ----------
    title : str
    look : {"text", "number", "error", "bar", "badge", "code"} or callable
        Numbers are aligned right and errors left, so that they meet at ±. Bars have a `Cell.share`.
        A function formats numbers as text.
    get : str or None
        Where the value is in a row: the key of a mapping, or an attribute (with dots for one of an
        attribute); None for the element of the row at the column's index.
    hint : str
        One sentence on the meaning of the column.
    detail : bool
        Whether it is shown only with detailed statistics.
    quiet : bool
        Whether that holds for the small print of its cells, which then shows on hover.
    line : bool
        Whether the small print is cut to its first term, and shows in full on hover and with
        details.
    """

    title: str
    look: Look = "text"
    get: str | None = None
    hint: str = ""
    detail: bool = False
    quiet: bool = False
    line: bool = False

    @property
    def kind(self) -> Kind:
        """The kind of its cells."""
        if callable(self.look):
            return "number"
        return self.look

    def cell(self, row: Any, place: int) -> Cell:
        """Return the cell of a row in this column, whose index is `place`."""
        if self.get is None:
            value = row[place]
        elif isinstance(row, Mapping):
            value = row[self.get]
        else:
            value = attrgetter(self.get)(row)
        if isinstance(value, Cell) or not callable(self.look):
            return as_cell(value)
        number = math.nan if value is None else float(value)
        return Cell(self.look(number), number)


@frozen
class Table:
    """A table that sorts by click and can filter by the words of one column.

    Attributes
    ----------
    caption : str
    columns : tuple of Column
        The first names the row.
    rows : tuple of tuple of Cell
    filter_by : int or None
        Badge column with a chip for each of its words; -1 for the last.
    marked : int or None
        Row that is emphasised.
    best : int or None
        Row that is shown beside it where most rows are folded.
    long : bool
        Whether it is too long for a terminal.
    always : bool
        Whether a terminal shows it without being asked for details.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    filter_by: int | None = None
    marked: int | None = None
    best: int | None = None
    long: bool = False
    always: bool = False

    @classmethod
    def of(
        cls, caption: str, columns: Sequence[Column], rows: Iterable[Any], **options: Any
    ) -> Table:
        """Return the table of some rows: mappings, objects, or tuples in the order of columns.

        Parameters
        ----------
        caption : str
        columns : sequence of Column
            Define the values of a row that they show, and their format.
        rows : iterable
        options
            `filter_by`, `marked`, `long` and `always`.
        """
        cells = (tuple(c.cell(row, k) for k, c in enumerate(columns)) for row in rows)
        return cls(caption, tuple(columns), tuple(cells), **options)

    def brief(self, most: int | None = None) -> Table:
        """Return the table without columns of details, with at most `most` rows."""
        shown = [k for k, c in enumerate(self.columns) if not c.detail]
        rows = tuple(tuple(row[k] for k in shown) for row in self.rows[:most])
        marked = self.marked if (self.marked or 0) < len(rows) else None
        chips = None if self.filter_by is None else self.filter_by % len(self.columns)
        filter_by = shown.index(chips) if chips in shown else None
        columns = tuple(self.columns[k] for k in shown)
        return replace(self, columns=columns, rows=rows, marked=marked, filter_by=filter_by)

    def without(self, *titles: str) -> Table:
        """Return the table without the columns of some titles."""
        shown = [k for k, column in enumerate(self.columns) if column.title not in titles]
        rows = tuple(tuple(row[k] for k in shown) for row in self.rows)
        columns = tuple(self.columns[k] for k in shown)
        return replace(self, columns=columns, rows=rows)

    def text(self, width: int = 80) -> str:
        """Return the table as text without detail columns; columns that do not fit are left out.

        The first column and those of badges, such as verdicts, are always shown.
        """
        own = self.brief()
        cells = [[shorten(cell.text, width // 3) for cell in row] for row in own.rows]
        columns = [column.title for column in own.columns]
        frame = pd.DataFrame(cells, columns=columns)
        shown = own._fitting_columns(cells, width)
        left_out = len(own.columns) - len(shown)
        caption = fill(self.caption, width)
        text = frame.iloc[:, shown].to_string(index=False)
        more = f"\nColumns left out: {left_out}." if left_out else ""
        return f"{caption}\n{text}{more}"

    def _fitting_columns(self, cells: Sequence[Sequence[str]], width: int) -> list[int]:
        """Return the columns that fit into a width [letters], in their order."""
        titles = [column.title for column in self.columns]
        longest = [max(map(len, texts)) + 1 for texts in zip(titles, *cells, strict=True)]
        always = [k for k, c in enumerate(self.columns) if k == 0 or c.kind == "badge"]
        room = width - sum(longest[k] for k in always)
        shown = [*always]
        for k in range(len(titles)):
            if k not in shown and longest[k] <= room:
                shown.append(k)
                room -= longest[k]
        return sorted(shown)


def frame_table(frame: pd.DataFrame, caption: str = "", *, filter_by: str | None = None) -> Table:
    """Return a DataFrame as a table, its index (if it has a name) as the first column.

    Parameters
    ----------
    frame : DataFrame
        Cells may be numbers, text, bool or `Cell`.
    caption : str
    filter_by : str, optional
        Column of `check_cell` to filter by.
    """
    if frame.index.name is not None:
        frame = frame.reset_index()
    columns = [
        Column(str(name), _kind(list(frame.iloc[:, k]), first=k == 0))
        for k, name in enumerate(frame.columns)
    ]
    rows = [[as_cell(x) for x in row] for row in frame.itertuples(index=False, name=None)]
    at = [c.title for c in columns].index(filter_by) if filter_by is not None else None
    return Table.of(caption, columns, rows, filter_by=at)


def measured_cells(value: float, sigma: float) -> tuple[Cell, Cell]:
    """Return a value and ± its standard deviation, rounded together."""
    first, second = format_measured(value, sigma)
    if first == NONE:
        return Cell(first, math.nan), Cell(second, sigma)
    return Cell(first, value), Cell(f"± {second}", sigma)


def as_cell(x: Any) -> Cell:
    """Return a value as a cell."""
    if isinstance(x, Cell):
        return x
    if isinstance(x, (bool, np.bool_)):
        return Cell("yes" if x else "no")
    if isinstance(x, Integral):
        return Cell(str(x).replace("-", "−"), float(x))
    if isinstance(x, Real):
        return Cell(format_number(float(x)), float(x))
    return Cell(NONE if x is None else str(x))


def _kind(values: Sequence[Any], *, first: bool) -> Kind:
    numbers = [isinstance(x, Real) and not isinstance(x, bool) for x in values]
    if not first and values and all(numbers):
        return "number"
    if any(isinstance(x, Cell) and x.badge for x in values):
        return "badge"
    return "text"


@frozen
class Note:
    """A caveat, or the absence of one.

    Attributes
    ----------
    level : {"warning", "note", "good"}
    title, text : str
    """

    level: Literal["warning", "note", "good"]
    title: str
    text: str


@frozen
class Answer:
    """A question that every reader has, its answer in a few words, and an explanation.

    Attributes
    ----------
    question, short, text : str
        The text has at most two sentences, or a line for each point.
    tone : str
    commands : tuple of (purpose, command)
        Lines for the terminal, ready to copy, each with its purpose.
    more : str
        What a page tells in a section further down.
    """

    question: str
    short: str
    text: str = ""
    tone: str = ""
    commands: tuple[tuple[str, str], ...] = ()
    more: str = ""

    @property
    def whole(self) -> str:
        """The short answer with all that explains it."""
        return " ".join(filter(None, (self.short, self.text.replace("\n", " "), self.more)))
