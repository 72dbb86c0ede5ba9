"""`Table`: rows of cells that know how to sort, and how they look."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd

from identifiability.foundation.values import frozen
from identifiability.report.marks import MARKS
from identifiability.report.numbers import NONE, format_number

Kind = Literal["text", "number", "error", "bar", "badge", "code"]


@frozen
class Column:
    """A column of a table.

    Attributes
    ----------
    title : str
    kind : {"text", "number", "error", "bar", "badge", "code"}
        Numbers stand right, errors left (so that they meet at ±), bars have a `Cell.share`.
    hint : str
        One sentence that says what the column is.
    """

    title: str
    kind: Kind = "text"
    hint: str = ""


@frozen
class Cell:
    """What stands in a row and a column.

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
    """

    text: str
    key: float | str | None = None
    note: str = ""
    badge: str = ""
    share: float = 0.0

    @property
    def sort_key(self) -> str | None:
        """The key as the page's script reads it; None for the text, empty sorts last."""
        if self.key is None or isinstance(self.key, str):
            return self.key
        if math.isnan(self.key):
            return ""
        return f"{self.key:.6g}".replace("inf", "Infinity")


@frozen
class Table:
    """A table that sorts by click and, where asked for, filters by the words of one column.

    Attributes
    ----------
    caption : str
    columns : tuple of Column
        The first names the row.
    rows : tuple of tuple of Cell
    filter_by : int or None
        Badge column with a chip for each of its words.
    marked : int or None
        Row that is emphasised.
    cards : bool
        Whether rows become cards on a phone; otherwise the table scrolls in its own box.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    filter_by: int | None = None
    marked: int | None = None
    cards: bool = True
    kind: ClassVar[str] = "table"

    @property
    def words(self) -> list[tuple[str, int]]:
        """The words to filter by, in order of appearance in `MARKS`, with their counts."""
        if self.filter_by is None:
            return []
        words = [row[self.filter_by].badge for row in self.rows]
        return [(w, words.count(w)) for w in sorted(set(words), key=_rank)]


@frozen
class Check:
    """A number beside what it should be; a cell of a DataFrame given to `frame_table`.

    Attributes
    ----------
    text : str
    passed : bool or None
        None where nothing was checked.
    reason : str
        The tolerance, or why it differs.
    """

    text: str
    passed: bool | None
    reason: str = ""

    @property
    def word(self) -> str:
        """``pass``, ``differs`` or ``not checked``."""
        return {True: "pass", False: "differs", None: "not checked"}[self.passed]


def frame_table(
    frame: pd.DataFrame, caption: str = "", *, digits: int = 4, filter_by: str | None = None
) -> Table:
    """Return a DataFrame as a table, its index (if it has a name) as the first column.

    Parameters
    ----------
    frame : DataFrame
        Cells may be numbers, text, bool, `Cell` or `Check`.
    caption : str
    digits : int
        Significant digits of numbers.
    filter_by : str, optional
        Column of `Check` to filter by.
    """
    if frame.index.name is not None:
        frame = frame.reset_index()
    names = [str(c) for c in frame.columns]
    columns = tuple(
        Column(name, _kind(list(frame.iloc[:, k]), first=k == 0)) for k, name in enumerate(names)
    )
    rows = tuple(
        tuple(as_cell(x, digits) for x in row) for row in frame.itertuples(index=False, name=None)
    )
    at = names.index(filter_by) if filter_by is not None else None
    return Table(caption, columns, rows, at, cards=len(columns) > 2)


def as_cell(x: Any, digits: int = 4) -> Cell:
    """Return a value as a cell."""
    if isinstance(x, Cell):
        return x
    if isinstance(x, Check):
        return Cell(x.text or x.word, x.word, x.reason, x.word)
    if isinstance(x, (bool, np.bool_)):
        return Cell("yes" if x else "no")
    if isinstance(x, (int, np.integer)):
        return Cell(str(x).replace("-", "−"), float(x))
    if isinstance(x, (float, np.floating)):
        return Cell(format_number(float(x), digits), float(x))
    return Cell(NONE if x is None else str(x))


def _kind(values: Sequence[Any], *, first: bool) -> Kind:
    if not first and values and all(_is_number(x) for x in values):
        return "number"
    return "badge" if any(isinstance(x, Check) for x in values) else "text"


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float, np.integer, np.floating)) and not isinstance(x, bool)


def _rank(word: str) -> tuple[int, str]:
    order = list(MARKS)
    return (order.index(word) if word in order else len(order)), word
