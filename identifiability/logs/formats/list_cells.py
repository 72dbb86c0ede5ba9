"""Columns whose cells are lists, such as ``[0.1, 0.2]``: each element becomes a column.

Tables of LeRobot episodes have such columns when they are saved as one file. Parquet keeps lists,
and CSV keeps their text, as Python, NumPy or PyTorch prints them.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array, numbered
from identifiability.logs.names import check_names

from .lerobot import FEATURES

if TYPE_CHECKING:
    import pandas as pd

#: The text of a list, a tuple, an array or a tensor; the group holds its elements.
_BRACKETS = re.compile(
    r"(?:(?:\w+\.)?(?:array|tensor)\()?\[([^\[\]]*)\](?:,[^\[\]]*)?\)?|\(([^()]*,[^()]*)\)"
)

#: A number as NumPy prints an element of a list.
_NUMPY_NUMBER = re.compile(r"\b\w{1,9}\.float\d+\(([^()]*)\)")


def spread_lists(path: Path | str, frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table in which each column of lists of numbers is one column an element.

    Element k of a feature of LeRobot belongs to joint k. Any other one is named ``<name>[k]``.

    Raises
    ------
    LogError
        If the lists of a column have different lengths.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    columns = [frame.iloc[:, k] for k in range(frame.shape[1])]  # names may be repeated
    widths = [_count_elements(column) for column in columns]
    if not any(widths):
        return frame
    parts: list[pd.Series | pd.DataFrame] = []
    for column, width in zip(columns, widths, strict=True):
        parts.append(_spread(path, column, width) if width else column)
    return pd.concat(parts, axis=1)


def _spread(path: Path | str, column: pd.Series, width: int) -> pd.DataFrame:
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    names = _names_of_elements(str(column.name), width)
    check_names(str(path), names)
    values = _values_of(column, width)
    if values is None:
        raise LogError(
            f"{path}: the lists in column '{column.name}' do not all hold {width} numbers; "
            "repair or remove these rows."
        )
    return pd.DataFrame(values, columns=names, index=column.index)


def _count_elements(column: pd.Series) -> int:
    """Return the number of elements of the first list in a column; 0 if it holds no lists."""
    if column.dtype.kind != "O":  # numbers or dates
        return 0
    filled = column.dropna()
    if filled.empty:
        return 0
    elements = _elements_of(filled.iloc[0])
    return 0 if elements is None else len(elements)


def _names_of_elements(name: str, width: int) -> list[str]:
    channel = FEATURES.get(name)
    if channel is None:
        return [f"{name}[{k}]" for k in range(width)]
    return [f"{joint}.{channel}" for joint in numbered(width)]


def _values_of(column: pd.Series, width: int) -> Array | None:
    """Return the elements (N, width), NaN for empty cells; None if a cell has another width."""
    values = np.full((len(column), width), np.nan)
    empty = column.isna().to_numpy()
    for row, cell in enumerate(column):
        if empty[row]:
            continue
        elements = _elements_of(cell)
        if elements is None or len(elements) != width:
            return None
        values[row] = elements
    return values


def _elements_of(cell: Any) -> Array | None:
    """Return the numbers of a cell; None if it is no list of numbers."""
    try:
        if isinstance(cell, str):
            text = cell.strip()
            if not text.endswith(("]", ")")):  # most texts, however long
                return None
            brackets = _BRACKETS.fullmatch(_NUMPY_NUMBER.sub(r"\1", text))
            if brackets is None:
                return None
            elements = brackets[1] or brackets[2] or ""
            return np.array(elements.replace(",", " ").split(), float)
        if isinstance(cell, (list, tuple, np.ndarray)):
            array = np.asarray(cell, float)
            return array if array.ndim == 1 else None
    except (TypeError, ValueError):  # a list of texts or of lists
        return None
    return None
