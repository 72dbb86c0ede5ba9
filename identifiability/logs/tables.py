"""Read logs from CSV, Parquet, bags and containers, some thousand rows at a time."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from io import StringIO
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.foundation.output import check_ending, csv_text, write_bytes, write_text

from .conventions import Conventions
from .form import PLAIN, Form, find_encoding, find_form
from .formats.list_cells import spread_lists
from .formats.parquet import check_parquet
from .formats.reader import (
    MISSING,
    Whole,
    check_suffix,
    check_text,
    find_reader,
    hash_files,
    list_files,
)
from .names import check_names

if TYPE_CHECKING:
    import pandas as pd

#: Names of files that are Parquet.
PARQUET = (".parquet", ".pq")

#: Cells of a piece of Parquet, and letters of a piece of CSV, at most.
PIECE_CELLS, PIECE_LETTERS = 500_000, 2_000_000

#: Bytes in which the form of a text is decided.
BEGINNING = 1 << 18


def is_log_file(path: Path) -> bool:
    """Return whether a path has the ending or the content of a log."""
    return path.suffix.lower() in (".csv", *PARQUET) or find_reader(path) is not None


def is_parquet(path: Path) -> bool:
    """Return whether the name of a file is that of a Parquet file."""
    return path.suffix.lower() in PARQUET


def write_table(path: str | Path, frame: pd.DataFrame) -> Path:
    """Write a table as CSV or Parquet, whole or not at all; CSV keeps every digit.

    Raises
    ------
    OutputError
        If it cannot be written, or has another ending.
    """
    path = Path(path)
    check_ending(path, ".csv", *PARQUET)
    if is_parquet(path):
        return write_bytes(path, frame.to_parquet(index=False))
    return write_text(path, csv_text(frame))


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn any error of a parser into one sentence.

    Raises
    ------
    LogError
    """
    try:
        yield
    except LogError:
        raise
    except Exception as error:  # noqa: BLE001 - foreign parsers may raise anything
        found = find_reader(path)
        form = "Parquet" if is_parquet(path) else "CSV" if found is None else found.kind
        short = " ".join(str(error).split())[:200]
        reason = short.rstrip(".") or type(error).__name__
        raise LogError(f"{path} cannot be read as {form}: {reason}.") from None


def read_pieces(path: Path, known: Conventions | None = None) -> Iterator[Whole]:
    """Yield the rows of a file in order, some thousand at a time, at least once.

    Parameters
    ----------
    path : Path
        A CSV or Parquet file, a container of arrays, a bag (``bag:/topic``), or an episode of a
        LeRobot dataset (``dataset:3``).
    known : Conventions, optional
        Conventions with the joints to read if messages of a bag have different ones.

    Yields
    ------
    frame : DataFrame
    form : Form
        Format of the text.
    sha256 : str
        Hash of the whole file.

    Raises
    ------
    LogError
        If the file is missing, is no table, damaged, or changes meanwhile.
    """
    found = find_reader(path)
    place = path if found is None else found.place(path)
    with parsing(path):
        if not place.exists():
            raise LogError(MISSING.format(place))
        before = _stamp(place)
        if found is not None:
            yield found.read(path, known or Conventions())
        elif path.is_dir():
            raise LogError(
                f"{path} is a folder, and none of a bag (metadata.yaml) or of LeRobot "
                "(meta/info.json); name the files in it."
            )
        elif not path.is_file():
            raise LogError(f"{path} is no file, but a pipe or a device; give a file.")
        else:
            check_suffix(path)
            digest = hash_files(path)
            for frame, form in _read_parquet(path) if is_parquet(path) else _read_csv(path):
                yield spread_lists(path, frame), form, digest
        if _stamp(place) != before:
            raise LogError(
                f"{path} changed while it was read; wait until it is complete, then start again."
            )


def _stamp(place: Path) -> list[tuple[int, int]]:
    """Return sizes and times of change of a file, or of a folder's."""
    states = [p.stat() for p in list_files(place)]
    return [(s.st_size, s.st_mtime_ns) for s in states]


def _read_parquet(path: Path) -> Iterator[tuple[pd.DataFrame, Form]]:
    from pyarrow.parquet import ParquetFile  # noqa: PLC0415 - only who reads Parquet pays for it

    texts = check_parquet(path)
    # Without a buffer of a bounded size whole columns of a group of rows are read ahead.
    with ParquetFile(path, pre_buffer=False, buffer_size=1 << 18, read_dictionary=texts) as file:
        if not file.metadata.num_rows:
            yield file.read().to_pandas(), PLAIN
        rows = max(1, PIECE_CELLS // max(file.metadata.num_columns, 1))
        for batch in file.iter_batches(rows, use_threads=False):
            frame = batch.to_pandas()
            kept = {c: frame[c].astype(object) for c in texts}  # rows share texts
            yield frame.assign(**kept), PLAIN


def _read_csv(path: Path) -> Iterator[tuple[pd.DataFrame, Form]]:
    with path.open("rb") as raw:
        start = raw.read(BEGINNING)
    if not start.strip(b"\xef\xbb\xbf\0 \t\r\n"):
        raise LogError(f"{path} is empty; nothing was written to it.")
    encoding = find_encoding(start)
    text = start.decode(encoding, "replace")
    check_text(path, text[:4096])
    form = find_form(text, encoding)
    row = 0
    check_names(str(path), form.columns)
    wrong = "strict" if encoding.startswith("utf-8") else "replace"
    with path.open(encoding=encoding, errors=wrong, newline="") as file:
        for _ in range(form.lines):
            file.readline()
        pieces = iter(partial(file.readlines, PIECE_LETTERS), [])
        for lines in chain([next(pieces, [])], pieces):
            if lines and not lines[-1].endswith(("\n", "\r")):
                half = lines.pop()  # it may lack digits without any sign of it
                if half.strip() and not form.is_comment(half):
                    note = "its last line has no end and was left out, for it may have been cut"
                    form = replace(form, notes=(*form.notes, note))
            frame = _parse(path, form, [x for x in lines if not form.is_comment(x)], row)
            yield frame, form
            row += len(frame)


def _parse(path: Path, form: Form, lines: list[str], row: int) -> pd.DataFrame:
    """Return the rows in some lines of a CSV; `row` is the number of the first one.

    The names are those of the header, because pandas would rename repeated columns and shift long
    rows.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    blank = form.separator == " "
    header = ("\t" if blank else form.separator).join(map(str, range(len(form.columns))))
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)  # rows longer than the header
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text is reported by row later
        try:
            text = "".join([f"{header}\n", *lines])
            frame = pd.read_csv(
                StringIO(text),
                index_col=False,
                skipinitialspace=True,
                decimal=form.decimal,
                sep=r"\s+" if blank else form.separator,
            )
        except pd.errors.ParserWarning:
            raise LogError(
                f"{path} has rows with more fields than its header; repair it."
            ) from None
        except pd.errors.ParserError as error:  # it counts from the start of the piece
            number = r"(?<=line )\d+|(?<=row )\d+"
            shifted = re.sub(number, lambda m: str(int(m[0]) + row), str(error))
            raise pd.errors.ParserError(shifted) from None
    if form.decimal == ",":  # pandas leaves commas in a column in which one cell is no number
        frame = frame.replace(r"^([-+]?\d*),(\d*([eE][-+]?\d+)?)$", r"\1.\2", regex=True)
    return frame.set_axis(list(form.columns), axis=1)
