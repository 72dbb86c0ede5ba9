"""Where logs come from: CSV, Parquet, bags and DataFrames, short and long, are read alike.

A table is read once from its first row to its last and hashed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import PLAIN, Form, find_encoding, find_form
from identifiability.logs.formats.bags import hash_files
from identifiability.logs.formats.reader import MISSING, check_suffix, check_text, find_reader
from identifiability.logs.reading import with_index
from identifiability.logs.tables import Table, is_parquet, open_parquet, opened, parsing

if TYPE_CHECKING:
    import pandas as pd


# Read a table once from its first row to its last, and hash what is read.


#: Bytes of a piece of CSV.
PIECE_BYTES = 2_000_000

#: Bytes in which the form of a text is decided.
BEGINNING = 1 << 18


def scan_table(path: Path, each: Callable[[pd.DataFrame, Form], None]) -> tuple[str, Table]:
    """Call a function with every piece in order, at least once; return hash and table."""
    if not is_parquet(path):
        return _scan_csv(path, each)
    digest, table = hash_files(path), open_parquet(path)
    if not table.rows:
        with opened(path) as file:
            each(file.read().to_pandas(), PLAIN)
    for batch in table.parts(0, table.rows):
        each(batch.to_pandas(), PLAIN)
    return digest, table


def _scan_csv(path: Path, each: Callable[[pd.DataFrame, Form], None]) -> tuple[str, Table]:
    with path.open("rb") as raw:
        encoding = find_encoding(raw.read(BEGINNING))
    digest = hashlib.sha256()
    with opened(path, encoding=encoding) as file:
        start = more = file.read(PIECE_BYTES)
        digest.update(start)
        table, rest = _begin_csv(path, start, encoding)
        row, byte = 0, len(start) - len(rest)
        pieces = [(row, byte)]
        while more:
            more = file.read(PIECE_BYTES)
            digest.update(more)
            rest += more
            cut = max(rest.rfind(b"\n"), rest.rfind(b"\r") if b"\n" not in rest else -1) + 1
            if not more:
                table, cut = _leave_half_line(table, rest)
            if cut or (not more and len(pieces) == 1):
                frame = table.parse(rest[:cut], row)
                each(frame, table.form)
                row, byte, rest = row + len(frame), byte + cut, rest[cut:]
                pieces.append((row, byte))
    table = replace(table, pieces=tuple(pieces))
    return digest.hexdigest() if encoding == "utf-8" else hash_files(path), table


def _begin_csv(path: Path, start: bytes, encoding: str) -> tuple[Table, bytes]:
    """Return a CSV without its rows, and what follows its header."""
    if not start.strip(b"\xef\xbb\xbf\0 \t\r\n"):
        raise LogError(f"{path} is empty; nothing was written to it.")
    # Bytes in which a file that is no text shows it.
    check_text(path, start[:4096])
    form = find_form(start[:BEGINNING].decode(errors="replace"), encoding)
    mark = {" ": "\t"}.get(form.separator, form.separator)
    quoted = [f'"{name.replace(chr(34), chr(34) * 2)}"' for name in form.columns]
    ends = [0, *(m.end() for m in re.finditer(rb"\r\n|\r|\n", start[:BEGINNING]))]
    header = f"{mark.join(quoted)}\n".encode()
    return Table(path, form.columns, (), header, form), start[ends[: form.lines + 1][-1] :]


def _leave_half_line(table: Table, rest: bytes) -> tuple[Table, int]:
    """Return how much of the end of a file is whole, with a note if the last line is left out.

    One without an end may lack digits that nobody misses.
    """
    at = max(rest.rfind(b"\n"), rest.rfind(b"\r")) + 1
    if not table.form.plain_text(rest[at:]).strip():
        return table, len(rest)
    note = "its last line has no end and was left out, for it may have been cut"
    form = replace(table.form, notes=(*table.form.notes, note))
    return replace(table, form=form), at


# Where logs come from: CSV, Parquet, bags and DataFrames, short and long, are read alike.


#: Tables with more values are read piece by piece; a value of a CSV takes about so many bytes.
LONG, BYTES_PER_VALUE = 2_000_000, 12

#: Tables with more values are never held in memory.
MOST = 50_000_000


def scan_file(
    path: Path, each: Callable[[pd.DataFrame, Form], None], known: Conventions | None = None
) -> tuple[str, Table | None]:
    """Read a file once from its first row to its last.

    Parameters
    ----------
    path : Path
        A CSV or Parquet file, a container of arrays, a bag (``bag:/topic``), or an episode of a
        LeRobot dataset (``dataset:3``).
    each : callable(DataFrame, Form)
        Called with every piece, at least once, and how it was written.
    known : Conventions, optional
        Which joints are asked for where messages of a bag tell of different ones.

    Returns
    -------
    sha256 : str
    table : Table or None
        None for a bag, an episode or a container of arrays, which are no files of rows.

    Raises
    ------
    LogError
        If the file is missing, is no table, or damaged.
    """
    found = find_reader(path)
    with parsing(path):
        if found is not None:
            if not found.place(path).exists():
                raise LogError(found.missing.format(found.place(path)))
            frame, form, digest = found.read(path, known or Conventions())
            each(frame, form)
            return digest, None
        if path.is_dir():
            raise LogError(
                f"{path} is a folder, and none of a bag (metadata.yaml) or of LeRobot "
                "(meta/info.json); name the files in it."
            )
        if not path.is_file():
            raise LogError(MISSING.format(path))
        check_suffix(path)
        return scan_table(path, each)


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a CSV or Parquet file, or the joint states of a bag, as it is.

    Raises
    ------
    LogError
        If the file is missing, is no table, or damaged.
    """
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    pieces: list[pd.DataFrame] = []
    scan_file(Path(path), lambda frame, _: pieces.append(with_index(frame)))
    return pd.concat(pieces, ignore_index=True)


def is_long(path: Path, limit: int | None = None) -> bool:
    """Whether a CSV or Parquet file has too many values to be held in memory without a thought.

    Parameters
    ----------
    path : Path
    limit : int, optional
        How many that is; `LONG` by default.

    Raises
    ------
    LogError
        If it is no table.
    """
    most = LONG if limit is None else limit
    with parsing(path):
        if find_reader(path) is not None or not path.is_file():
            return False
        if is_parquet(path):
            table = open_parquet(path)
            return table.rows * len(table.columns) > most
        return path.stat().st_size > most * BYTES_PER_VALUE
