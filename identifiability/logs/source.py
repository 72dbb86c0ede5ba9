"""Where logs come from: CSV, Parquet, bags and DataFrames, short and long, are read alike.

A table is read once from its first row to its last and hashed; a log that its first lines refuse
is a sentence before anything else is looked at.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.logs.columns import name_columns
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import LINE_END, PLAIN, Form, find_encoding, find_form
from identifiability.logs.formats.bags import hash_files
from identifiability.logs.formats.reader import (
    MISSING,
    check_columns,
    check_suffix,
    check_text,
    find_reader,
)
from identifiability.logs.reading import with_index
from identifiability.logs.tables import Table, is_parquet, open_parquet, opened, parsing
from identifiability.robot.floating import BASE_JOINTS

if TYPE_CHECKING:
    import pandas as pd


# Read a table once from its first row to its last, and hash what is read.


#: Bytes of a piece of CSV.
PIECE_BYTES = 2_000_000

#: Bytes of a Parquet file that is read at once.
WHOLE = 16_000_000

#: Bytes in which the form of a text is decided.
BEGINNING = 1 << 18


def scan_table(path: Path, each: Callable[[pd.DataFrame, Form], None]) -> tuple[str, Table]:
    """Call a function with every piece in order, at least once; return hash and table.

    What is hashed is what is read, also where the file is written anew meanwhile.
    """
    if not is_parquet(path):
        return _scan_csv(path, each)
    whole = path.read_bytes() if path.stat().st_size <= WHOLE else None
    digest = hash_files(path) if whole is None else hashlib.sha256(whole).hexdigest()
    table = open_parquet(path, whole)
    if not table.rows:
        with opened(path, whole) as file:
            each(file.read().to_pandas(), PLAIN)
    for batch in table.parts(0, table.rows, whole=whole):
        each(batch.to_pandas(), PLAIN)
    return digest, table


def _scan_csv(path: Path, each: Callable[[pd.DataFrame, Form], None]) -> tuple[str, Table]:
    digest = hashlib.sha256()
    with path.open("rb") as file:

        def read() -> bytes:
            more = file.read(PIECE_BYTES)
            digest.update(more)
            return more

        start = read()
        table, rest = begin_csv(path, start)
        row, byte, ended = 0, len(start) - len(rest), False
        pieces = [(row, byte)]
        while not ended:
            more = read()
            rest, ended = rest + more, not more
            # A line of a CSV is shorter than so many pieces.
            too_long = len(rest) > 8 * PIECE_BYTES
            cut = len(rest) if ended else _last_line(rest, table.form) or len(rest) * too_long
            if ended:
                table, cut = _leave_half_line(table, rest)
            if cut or (ended and (len(pieces) == 1 or rest)):
                frame = table.parse(rest[:cut], row)
                each(frame, table.form)
                row, byte, rest = row + len(frame), byte + cut, rest[cut:]
                pieces.append((row, byte))
    return digest.hexdigest(), replace(table, pieces=tuple(pieces))


def begin_csv(path: Path, start: bytes) -> tuple[Table, bytes]:
    """Return a CSV without its rows, and what follows its header."""
    if not start.strip(b"\xef\xbb\xbf\0 \t\r\n"):
        raise LogError(f"{path} is empty; nothing was written to it.")
    if len(start) >= BEGINNING and not re.search(rb"[\r\n]", start[:BEGINNING]):
        raise LogError(
            f"{path} has no end of a line in its first {BEGINNING // 1000} kB, so it has no "
            "header; give a table with a row a sample."
        )
    encoding = find_encoding(start)
    if not encoding.startswith("utf-16"):
        # Bytes in which a file that is no text shows it.
        check_text(path, start[:4096])
    text = start[:BEGINNING].decode(encoding, errors="replace")
    form = find_form(text, encoding)
    check_columns(path, len(form.columns))
    mark = {" ": "\t"}.get(form.separator, form.separator)
    line = mark.join(f'"{name.replace(chr(34), chr(34) * 2)}"' for name in form.columns) + "\n"
    # A letter of another code, in a comment, takes as many bytes as it has.
    errors = "surrogateescape" if encoding == "utf-8" else "replace"
    exact = start[:BEGINNING].decode(encoding, errors)
    ends = [m.end() for m in LINE_END.finditer(exact)][: form.lines]
    at = len(exact[: ends[-1] if ends else 0].encode(encoding, errors))
    return Table(path, form.columns, (), line.encode(), form), start[at:]


def _leave_half_line(table: Table, rest: bytes) -> tuple[Table, int]:
    """Return how much of the end of a file is whole, with a note if the last line is left out.

    One without an end may lack digits that nobody misses.
    """
    end_of_file = table.form.plain_text(rest)
    at = max(end_of_file.rfind(b"\n"), end_of_file.rfind(b"\r")) + 1
    last = end_of_file[at:].decode(errors="replace")
    if not last.strip():
        return table, len(rest)
    kept = len(rest) - len(last.encode(table.form.encoding, "replace"))
    note = "its last line has no end and was left out, for it may have been cut"
    form = replace(table.form, notes=(*table.form.notes, note))
    return replace(table, form=form), kept


def _last_line(piece: bytes, form: Form) -> int:
    """Return where the last line ends that is whole, as far as quotes can tell."""
    if form.encoding.startswith("utf-16"):
        letters = piece[: len(piece) - len(piece) % 2].decode(form.encoding, errors="replace")
        end = max(letters.rfind("\n"), letters.rfind("\r") if "\n" not in letters else -1) + 1
        return len(letters[:end].encode(form.encoding))
    mark = b"\n" if b"\n" in piece else b"\r"
    cut = piece.rfind(mark) + 1
    if piece.count(b'"', 0, cut) % 2:  # a line break between quotes: cut before it
        cut = piece.rfind(mark, 0, piece.rfind(b'"', 0, cut)) + 1 or cut
    return cut


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


# Refuse a log by its first lines, before anything else of it, or any number, is looked at.


def check_header(path: Path, known: Conventions) -> None:
    """Refuse a CSV whose columns are none of a robot's log; other files are left to their reader.

    Parameters
    ----------
    path : Path
    known : Conventions

    Raises
    ------
    LogError
        What `Log.read` would say of the columns.
    """
    if not path.is_file():  # a pipe would be waited for
        return
    if known.joints == BASE_JOINTS[:1]:  # of a body alone no column is about a joint
        return
    with parsing(path):
        with path.open("rb") as file:
            start = file.read(BEGINNING)
        table, rest = begin_csv(path, start)
        line = table.form.plain_text(rest).decode(errors="replace").partition("\n")[0]
        row = dict(zip(table.columns, table.form.split(line), strict=False))
    texts = {name: text for name, text in row.items() if not table.form.is_number(text)}
    name_columns(
        table.columns,
        str(path),
        known,
        dict(zip(table.columns, table.form.units, strict=False)),
        texts,
    )
