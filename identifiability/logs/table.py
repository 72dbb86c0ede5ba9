"""Tables: CSV, Parquet and bags as they are."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.logs.bags import is_bag, read_bag, split_topic

if TYPE_CHECKING:
    import pandas as pd

PARQUET = (".parquet", ".pq")


class LongRowError(Exception):
    """A CSV has rows with more fields than its header."""


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a CSV or Parquet file, or the joint states of a bag, as it is.

    Raises
    ------
    LogError
        If the file is missing or is no table.
    """
    path = Path(path)
    if is_bag(split_topic(path)[0]):
        return read_bag(path)
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    with parsing(path):
        if path.is_file():
            return pd.read_parquet(path) if is_parquet(path) else _read_csv(path)
    raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")


def is_parquet(path: Path) -> bool:
    """Whether the name of a file says that it is Parquet."""
    return path.suffix.lower() in PARQUET


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn whatever a parser raises into one sentence.

    Raises
    ------
    LogError
    """
    try:
        yield
    except LongRowError:
        raise LogError(f"{path} has rows with more fields than its header; repair it.") from None
    except LogError:
        raise
    except Exception as error:  # noqa: BLE001 - foreign parsers may raise anything
        form = "Parquet" if is_parquet(path) else "CSV"
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise LogError(f"{path} cannot be read as {form}: {reason}.") from None


def _read_csv(path: Path) -> pd.DataFrame:
    """Read a CSV by its own header; pandas would rename repeated columns and shift long rows."""
    check_separator(path)
    frame = parse_csv(path)
    header = read_header(path)
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


def parse_csv(source: Path | IO[bytes]) -> pd.DataFrame:
    """Return the table in a CSV.

    Raises
    ------
    LongRowError
        If rows are longer than the header.
    """
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows longer than the header
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text is reported by row later
        try:
            return pd.read_csv(source, index_col=False, skipinitialspace=True)
        except pd.errors.ParserWarning:
            raise LongRowError from None


def read_header(path: Path) -> list[str]:
    """Return the names in the first line of a CSV that has any."""
    with path.open(encoding="utf-8-sig", newline="") as stream:
        return next((row for row in csv.reader(stream, skipinitialspace=True) if row), [])
