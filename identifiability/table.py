"""Tables: CSV, Parquet and bags in, checked columns of numbers out."""

from __future__ import annotations

import csv
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identifiability.bags import is_bag, read_bag, split_topic
from identifiability.errors import LogError, listing
from identifiability.names import Array

if TYPE_CHECKING:
    import pandas as pd

PARQUET = (".parquet", ".pq")

#: Fewer samples than this say nothing about any robot.
FEWEST = 20

#: No time, position or torque in SI units is larger (time since 1970 in s is 1.7e9).
LARGEST = 1e12

#: No log is sampled faster than this [s].
SHORTEST_STEP = 1e-7


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a CSV or Parquet file, or the joint states of a bag, as it is.

    Raises
    ------
    LogError
        If the file is missing or is no table.
    """
    import pandas as pd  # noqa: PLC0415 - heavy; only files need it

    path = Path(path)
    if is_bag(split_topic(path)[0]):
        return read_bag(path)
    form = "Parquet" if path.suffix.lower() in PARQUET else "CSV"
    try:
        if path.is_file():
            return pd.read_parquet(path) if form == "Parquet" else _read_csv(path)
    except pd.errors.ParserWarning:
        raise LogError(f"{path} has rows with more fields than its header; repair it.") from None
    except Exception as error:  # noqa: BLE001 - foreign parsers may raise anything
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise LogError(f"{path} cannot be read as {form}: {reason}.") from None
    raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")


def _read_csv(path: Path) -> pd.DataFrame:
    """Read a CSV by its own header; pandas would rename repeated columns and shift long rows."""
    import pandas as pd  # noqa: PLC0415 - heavy; only files need it

    check_separator(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows longer than the header
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text is reported by row later
        frame = pd.read_csv(path, index_col=False, skipinitialspace=True)
    with path.open(encoding="utf-8-sig", newline="") as stream:
        header = next((row for row in csv.reader(stream, skipinitialspace=True) if row), [])
    return frame.set_axis(header, axis=1) if len(header) == frame.shape[1] else frame


def check_separator(path: Path) -> None:
    """Refuse a table whose header is separated by something else than commas.

    Raises
    ------
    LogError
    """
    with path.open(encoding="utf-8-sig", errors="replace") as stream:
        header = stream.readline(1 << 16).strip()
    if "," in header:
        return
    for mark, name in ((";", "';'"), ("\t", "tabs"), ("|", "'|'"), (" ", "spaces")):
        if "t" in (word.strip(' "') for word in header.split(mark)[:-1]):
            decimal = " and numbers with a decimal point" if mark == ";" else ""
            raise LogError(
                f"{path} is separated by {name}, not by commas; write it as CSV with "
                f"commas{decimal}."
            )


def check_columns(columns: list[str], source: str) -> None:
    """Refuse a table without time, or with a column twice.

    Raises
    ------
    LogError
    """
    if "t" not in columns:
        likely = [c for c in columns if c == "T" or c.casefold().startswith("time")]
        guess = f", did you mean '{likely[0]}'?" if likely else "."
        raise LogError(
            f"{source} has no column 't' (time in s){guess} It has the columns {listing(columns)}."
        )
    repeated = sorted({c for c in columns if columns.count(c) > 1})
    if repeated:
        raise LogError(f"{source} has the column '{repeated[0]}' more than once; keep one of them.")


def read_numbers(frame: pd.DataFrame, column: str, source: str) -> Array:
    """Return a column as floats, (N,).

    Raises
    ------
    LogError
        With the first row that is not a finite number of a size that can be.
    """
    import pandas as pd  # noqa: PLC0415 - heavy; only files need it

    given = frame[column]
    if len(given) and getattr(given.dtype, "kind", "O") in "mMcb":
        raise LogError(
            f"{source}: column '{column}' holds {given.dtype} (first '{given.iloc[0]}'); give "
            f"numbers in SI units{', seconds' if column == 't' else ''}."
        )
    try:
        numbers = pd.to_numeric(given, errors="coerce").to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):  # cells that hold lists, categories …
        numbers = np.full(len(given), np.nan)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        advice = (
            "give numbers with a decimal point"
            if len(bad) == len(numbers)
            else "remove or repair these rows"
        )
        raise LogError(
            f"{source}: column '{column}' is not a finite number in {len(bad)} of {len(numbers)} "
            f"rows, first in data row {bad[0] + 1} ('{str(given.iloc[bad[0]])[:40]}'); {advice}."
        )
    bad = np.flatnonzero(np.abs(numbers) > LARGEST)
    if len(bad):
        raise LogError(
            f"{source}: column '{column}' is {numbers[bad[0]]:g} in data row {bad[0] + 1}, more "
            f"than anything in SI units can be{' (time in s)' if column == 't' else ''}; repair "
            "the value or convert the unit."
        )
    return numbers


def check_times(t: Array, source: str) -> None:
    """Refuse times that are too few or do not increase.

    Raises
    ------
    LogError
    """
    if len(t) < FEWEST:
        raise LogError(
            f"{source} has {len(t)} samples, too few to say anything; at least {FEWEST} are needed "
            "and some hundreds are usual."
        )
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        k = int(back[0])
        raise LogError(
            f"{source}: time does not increase after data row {k + 1} (t = {t[k]:g} s, then "
            f"{t[k + 1]:g} s); sort the rows and remove repeated ones."
        )
    step = float(np.median(np.diff(t)))
    if step < SHORTEST_STEP:
        raise LogError(
            f"{source} has a sampling step of {step:.3g} s, which no robot has; give the time in s."
        )
