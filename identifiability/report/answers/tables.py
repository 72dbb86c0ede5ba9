"""Tables of results: caption and columns by name, as `tables.toml` has them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.foundation.answers import Cell, Column, Look, Table
from identifiability.foundation.rounding import (
    NONE,
    digits,
    error_text,
    format_number,
    percent,
    percent_text,
    probability_text,
    rough_percent,
    stated_text,
)

TABLES: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("tables.toml").read_text(encoding="utf-8")
)

#: How numbers are written, by the word for it in `tables.toml`.
FORMATS: dict[str, Look] = {
    "percent": percent,
    "rough percent": rough_percent,
    "padded percent": error_text,
    "percentage": percent_text,
    "probability": probability_text,
    "stated": stated_text,
    **{f"{count} digits": digits(count) for count in (2, 3, 4)},
}


def make_table(
    name: str,
    rows: Iterable[Any],
    /,
    marked: int | None = None,
    more: Iterable[Column] = (),
    **holes: Any,
) -> Table:
    """Return a table of some rows.

    Parameters
    ----------
    name : str
        Key in `tables.toml`.
    rows : iterable
        Mappings, objects, or tuples with an element for each column.
    marked : int, optional
        Row that is emphasised.
    more : iterable of Column
        Columns that only this table has, after the others.
    holes
        What fills its caption and hints.
    """
    known = TABLES[name]
    columns = [make_column(holes, **told) for told in known["columns"]]
    caption = known.get("caption", "").format(**holes)
    options = {key: known[key] for key in ("filter_by", "long", "always") if key in known}
    return Table.of(caption, [*columns, *more], rows, marked=marked, **options)


def unit_cell(x: float, unit: str) -> Cell:
    """Return a number with its unit as one cell."""
    return Cell(f"{format_number(x, 3, pad=True)} {unit}" if np.isfinite(x) else NONE, x)


def add_units(frame: pd.DataFrame, *columns: str) -> list[dict[Any, Any]]:
    """Return the rows of a frame, with the unit of each row in the cells of some columns."""
    rows = frame.to_dict("records")
    return [row | {name: unit_cell(row[name], row["unit"]) for name in columns} for row in rows]


def span_cell(low: float, high: float, unit: str = "", digits: int = 3) -> Cell:
    """Return a range as one cell, sorted by its upper end."""
    ends = dict.fromkeys(format_number(x, digits, pad=True) for x in (low, high))
    span = " … ".join(ends)
    return Cell(f"{span} {unit}".rstrip(), high)


def make_column(
    holes: dict[str, Any], /, title: str, look: Any = "text", hint: str = "", **told: Any
) -> Column:
    """Return a column as `tables.toml` states it, with the holes of title and hint filled."""
    return Column(title.format(**holes), FORMATS.get(look, look), hint=hint.format(**holes), **told)
