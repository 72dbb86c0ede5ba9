"""Where logs come from: CSV and Parquet, piece by piece from any row on, bags and containers.

A table is read once from its first row to its last and hashed; a long one is then read by rows.
"""

from __future__ import annotations

import hashlib
import re
import warnings
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.output import check_ending, csv_text, write_bytes, write_text
from identifiability.foundation.values import frozen
from identifiability.logs.checks import to_floats
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import PLAIN, Form, find_encoding, find_form
from identifiability.logs.formats.bags import hash_files
from identifiability.logs.formats.reader import MISSING, check_suffix, check_text, find_reader
from identifiability.logs.reading import with_index

if TYPE_CHECKING:
    import pandas as pd

#: Names of files that are Parquet, and types of it that are numbers as they are.
PARQUET = (".parquet", ".pq")
NUMBERS = ("double", "float", "int64", "int32", "int16", "int8")

#: Rows of a piece of Parquet, and its cells, at most.
PIECE_ROWS, PIECE_CELLS = 32_768, 1_000_000


def is_parquet(path: Path) -> bool:
    """Whether the name of a file says that it is Parquet."""
    return path.suffix.lower() in PARQUET


def write_table(path: str | Path, frame: pd.DataFrame) -> Path:
    """Write a table as CSV or Parquet, whole or not at all; CSV keeps every digit.

    Raises
    ------
    OutputError
        If it cannot be written, or is none of these.
    """
    path = Path(path)
    check_ending(path, ".csv", *PARQUET)
    if is_parquet(path):
        return write_bytes(path, frame.to_parquet(index=False))
    return write_text(path, csv_text(frame))


@contextmanager
def parsing(path: Path) -> Iterator[None]:
    """Turn whatever a parser raises into one sentence.

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
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise LogError(f"{path} cannot be read as {form}: {reason}.") from None


@frozen
class Table:
    """A CSV or Parquet file of which any rows can be read.

    Attributes
    ----------
    path : Path
    columns : tuple of str
    pieces : tuple of (int, int)
        Row and place at which each piece begins; last the number of rows and the end. Places are
        bytes of a CSV and groups of rows of a Parquet file, small ones together.
    header : bytes
        What is put before rows of a CSV, made of its own header.
    form : Form
        How a CSV was written.
    """

    path: Path
    columns: tuple[str, ...]
    pieces: tuple[tuple[int, int], ...]
    header: bytes = b""
    form: Form = PLAIN

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.pieces[-1][0]

    def parts(
        self,
        start: int,
        stop: int,
        columns: Sequence[str] | None = None,
    ) -> Iterator[Any]:
        """Yield the rows [start, stop) in order, some thousand at a time.

        They are tables of pandas from a CSV, and batches of Arrow from a Parquet file.

        Raises
        ------
        LogError
            If the file is damaged.
        """
        first = max(bisect_right(self.pieces, start, key=lambda piece: piece[0]) - 1, 0)
        with parsing(self.path), opened(self.path, self.form.encoding) as file:
            for (row, place), (_, end) in pairwise(self.pieces[first:]):
                for part in self._read(file, place, end, row, columns):
                    low, high = max(start - row, 0), min(stop - row, len(part))
                    if low < high:
                        yield part[low:high]
                    row += len(part)  # noqa: PLW2901 - the next part's
                    if row >= stop:
                        return

    def arrays(
        self,
        start: int,
        stop: int,
        columns: Sequence[str],
        reading: Mapping[str, Callable[[pd.Series], Any]] | None = None,
    ) -> Iterator[Array]:
        """Yield some columns of the rows [start, stop) as floats, each time (N, c).

        Parameters
        ----------
        start, stop : int
        columns : sequence of str
        reading : mapping of str to callable(Series), optional
            What makes numbers of columns that are none.

        Raises
        ------
        LogError
            If the file is damaged.
        """
        for part in self.parts(start, stop, columns):
            each = [_floats(part[name], (reading or {}).get(name)) for name in columns]
            yield np.stack(each, dtype=float).T  # a column is read far more often than a row

    def parse(self, piece: bytes, row: int) -> pd.DataFrame:
        """Return the rows in some bytes of a CSV, the first of which has that number.

        The names are the header's: pandas would rename repeated columns and shift long rows.
        """
        import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

        plain = self.form.plain_text(piece)
        text = BytesIO(self.header + plain)
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # rows longer than the header
            warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # text is reported by row later
            try:
                frame = pd.read_csv(
                    text,
                    index_col=False,
                    skipinitialspace=True,
                    decimal=self.form.decimal,
                    sep=r"\s+" if self.form.separator == " " else self.form.separator,
                )
            except pd.errors.ParserWarning:
                raise LogError(
                    f"{self.path} has rows with more fields than its header; repair it."
                ) from None
            except pd.errors.ParserError as error:  # it counts from the start of the piece
                number = r"(?<=line )\d+|(?<=row )\d+"
                shifted = re.sub(number, lambda m: str(int(m[0]) + row), str(error))
                raise pd.errors.ParserError(shifted) from None
        same = len(self.columns) == frame.shape[1]
        return frame.set_axis(list(self.columns), axis=1) if same else frame

    def _read(
        self, file: Any, place: int, end: int, row: int, columns: Sequence[str] | None
    ) -> Iterator[Any]:
        """Yield the rows from a place to the next."""
        if is_parquet(self.path):
            chosen = None if columns is None else list(columns)
            groups = list(range(place, end))
            count = len(self.columns if chosen is None else chosen)
            rows = max(1, min(PIECE_ROWS, PIECE_CELLS // max(count, 1)))
            # Its threads wait for each other longer than they work.
            yield from file.iter_batches(rows, row_groups=groups, columns=chosen, use_threads=False)
        else:
            file.seek(place)
            yield self.parse(file.read(end - place), row)


def open_parquet(path: Path) -> Table:
    """Return a Parquet file as a table; reads its footer only."""
    with opened(path) as file:
        meta = file.metadata
        sizes = [meta.row_group(k).num_rows for k in range(meta.num_row_groups)]
        # The names as pandas has them: an index that was stored is no column.
        names = file.schema_arrow.empty_table().to_pandas().columns
    pieces = [(0, 0)]
    for k, row in enumerate(accumulate(sizes), 1):
        if k == len(sizes) or row - pieces[-1][0] >= PIECE_ROWS:  # small groups are read together
            pieces.append((row, k))
    return Table(path, tuple(str(n) for n in names), tuple(pieces))


def opened(path: Path, encoding: str = "utf-8") -> Any:
    """Open a file; text in another code as UTF-8."""
    if not is_parquet(path):
        if encoding == "utf-8":
            return path.open("rb")
        return BytesIO(path.read_bytes().decode(encoding, "replace").encode())
    from pyarrow.parquet import ParquetFile  # noqa: PLC0415 - only who reads Parquet pays for it

    # Without a buffer of a bounded size whole columns of a group of rows are read ahead.
    how = {"pre_buffer": False, "buffer_size": 1 << 18}
    state = path.stat()
    return ParquetFile(path, metadata=_footer(path, state.st_mtime_ns, state.st_size), **how)


# Files of Parquet whose footers are kept.
@lru_cache(16)
def _footer(path: Path, changed: int, size: int) -> Any:
    """Return what the end of a Parquet file says of its groups of rows.

    Of a long log it takes 13 kB a group, and as often as it is read, as memory in pieces so small
    is not given back.
    """
    del changed, size
    from pyarrow.parquet import read_metadata  # noqa: PLC0415

    return read_metadata(path)


def _floats(column: Any, reading: Callable[[pd.Series], Any] | None = None) -> Array:
    """Return a column of pandas or Arrow as floats, (N,)."""
    if reading is not None:
        given = column.to_pandas() if hasattr(column, "null_count") else column
        return to_floats(reading(given))
    if not hasattr(column, "null_count"):
        return to_floats(column)
    if str(column.type) in NUMBERS and not column.null_count:
        plain: Array = np.from_dlpack(column)  # to_numpy imports pandas
        return plain
    return to_floats(column.to_pandas())


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
            if cut or (not more and (len(pieces) == 1 or rest)):
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
