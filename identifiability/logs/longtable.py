"""Tables that are read piece by piece, from any row on: CSV and Parquet files of any length."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.checks import to_floats
from identifiability.logs.table import check_separator, is_parquet, parse_csv, parsing, read_header

if TYPE_CHECKING:
    import pandas as pd

#: Types of Parquet that are numbers as they are.
PLAIN = ("double", "float", "int64", "int32", "int16", "int8")

#: Rows of a piece of Parquet, and bytes of a piece of CSV.
PIECE_ROWS, PIECE_BYTES = 8_192, 2_000_000

#: A line of a CSV is shorter than so many pieces.
MOST_PIECES = 8

#: Tables with more values are read piece by piece; a value of a CSV takes about so many bytes.
LONG, BYTES_PER_VALUE = 2_000_000, 12


@frozen
class ParquetTable:
    """A Parquet file.

    Attributes
    ----------
    path : Path
    columns : tuple of str
    groups : tuple of int
        Row at which each group of rows begins, and the number of rows.
    """

    path: Path
    columns: tuple[str, ...]
    groups: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.groups[-1]

    def frames(
        self, start: int, stop: int, columns: Sequence[str] | None = None
    ) -> Iterator[pd.DataFrame]:
        """Yield the rows [start, stop) in order, some thousand at a time.

        Raises
        ------
        LogError
            If the file is damaged.
        """
        for batch in self._batches(start, stop, columns):
            yield batch.to_pandas()

    def arrays(self, start: int, stop: int, columns: Sequence[str]) -> Iterator[Array]:
        """Yield some columns of the rows [start, stop) as floats, each time (N, c).

        Raises
        ------
        LogError
            If the file is damaged.
        """
        for batch in self._batches(start, stop, columns):
            out = np.empty((len(batch), len(columns)))
            for k, name in enumerate(columns):
                column = batch.column(name)
                plain = str(column.type) in PLAIN and not column.null_count
                values = np.from_dlpack(column) if plain else None  # to_numpy imports pandas
                out[:, k] = to_floats(column.to_pandas()) if values is None else values
            yield out

    def _batches(self, start: int, stop: int, columns: Sequence[str] | None) -> Iterator[Any]:
        first = max(bisect_right(self.groups, start) - 1, 0)
        wanted = [k for k in range(first, len(self.groups) - 1) if self.groups[k] < stop]
        at = self.groups[first]
        with parsing(self.path), _open_parquet(self.path) as file:
            chosen = None if columns is None else list(columns)
            for batch in file.iter_batches(PIECE_ROWS, row_groups=wanted, columns=chosen):
                low, high = max(start - at, 0), min(stop - at, len(batch))
                if low < high:
                    yield batch.slice(low, high - low)
                at += len(batch)
                if at >= stop:
                    break


def _open_parquet(path: Path) -> Any:
    from pyarrow.parquet import ParquetFile  # noqa: PLC0415 - only who reads Parquet pays for it

    # Without a buffer of a bounded size whole columns of a group of rows are read ahead.
    return ParquetFile(path, pre_buffer=False, buffer_size=1 << 18)


@frozen
class CsvTable:
    """A CSV file and where its pieces begin.

    Attributes
    ----------
    path : Path
    columns : tuple of str
    header : bytes
        Everything before the first row.
    pieces : tuple of (int, int)
        Row and byte at which each piece begins; last the number of rows and bytes.
    """

    path: Path
    columns: tuple[str, ...]
    header: bytes
    pieces: tuple[tuple[int, int], ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.pieces[-1][0]

    def frames(
        self, start: int, stop: int, columns: Sequence[str] | None = None
    ) -> Iterator[pd.DataFrame]:
        """Yield the rows [start, stop) in order, some thousand at a time.

        Raises
        ------
        LogError
            If the file is damaged.
        """
        first = max(bisect_right(self.pieces, start, key=lambda p: p[0]) - 1, 0)
        with parsing(self.path), self.path.open("rb") as file:
            for k in range(first, len(self.pieces) - 1):
                (row, byte), (_, end) = self.pieces[k : k + 2]
                if row >= stop:
                    return
                file.seek(byte)
                frame = _parse(self.path, self.header, file.read(end - byte), self.columns, row)
                frame = frame.iloc[max(start - row, 0) : stop - row]
                yield frame if columns is None else frame[list(columns)]

    def arrays(self, start: int, stop: int, columns: Sequence[str]) -> Iterator[Array]:
        """Yield some columns of the rows [start, stop) as floats, each time (N, c).

        Raises
        ------
        LogError
            If the file is damaged.
        """
        for frame in self.frames(start, stop, columns):
            yield np.stack([to_floats(frame[c]) for c in columns], 1)


LongTable = ParquetTable | CsvTable


def scan_table(path: Path, digest: Any, each: Callable[[pd.DataFrame], None]) -> LongTable:
    """Read a file once from its first row to its last.

    Parameters
    ----------
    path : Path
    digest : hash
        Updated with every byte.
    each : callable(DataFrame)
        Called with every piece.

    Raises
    ------
    LogError
        If it is no table, or damaged.
    """
    if is_parquet(path):
        _hash_file(path, digest)
        table = open_parquet(path)
        for frame in table.frames(0, table.rows):
            each(frame)
        return table
    return _scan_csv(path, digest, each)


def open_parquet(path: Path) -> ParquetTable:
    """Return a Parquet file as a table; reads its footer only.

    Raises
    ------
    LogError
    """
    with parsing(path), _open_parquet(path) as file:
        meta = file.metadata
        edges = [0]
        for k in range(meta.num_row_groups):
            edges.append(edges[-1] + meta.row_group(k).num_rows)
        # The names as pandas has them: an index that was stored is no column.
        names = file.schema_arrow.empty_table().to_pandas().columns
        return ParquetTable(path, tuple(str(n) for n in names), tuple(edges))


def is_long(path: Path) -> bool:
    """Whether a CSV or Parquet file has too many values to be held in memory without a thought.

    Raises
    ------
    LogError
        If it is no table.
    """
    if is_parquet(path):
        table = open_parquet(path)
        return table.rows * len(table.columns) > LONG
    return path.stat().st_size > LONG * BYTES_PER_VALUE


def _hash_file(path: Path, digest: Any) -> None:
    with parsing(path), path.open("rb") as file:
        while piece := file.read(1 << 20):
            digest.update(piece)


def _scan_csv(path: Path, digest: Any, each: Callable[[pd.DataFrame], None]) -> CsvTable:
    with parsing(path), path.open("rb") as file:
        check_separator(path)
        columns = tuple(read_header(path))
        header, rest = _split_header(file.read(PIECE_BYTES))
        digest.update(header + rest)
        pieces, row, byte = [], 0, len(header)
        while True:
            more = file.read(PIECE_BYTES)
            digest.update(more)
            whole = rest + more
            cut = _last_line(whole) if more else len(whole)
            if not cut and len(whole) > MOST_PIECES * PIECE_BYTES:  # no line is that long
                cut = len(whole)
            if not more and not whole:
                break
            if cut:
                frame = _parse(path, header, whole[:cut], columns, row)
                each(frame)
                pieces.append((row, byte))
                row, byte = row + len(frame), byte + cut
            rest = whole[cut:]
            if not more:
                break
        pieces.append((row, byte))
    return CsvTable(path, columns, header, tuple(pieces))


def _split_header(start: bytes) -> tuple[bytes, bytes]:
    """Return the first line that is not blank with all before it, and the rest."""
    match = re.match(rb"(?:\xef\xbb\xbf)?\s*[^\r\n]*(?:\r\n|\r|\n|$)", start)
    at = match.end() if match else 0
    return start[:at], start[at:]


def _last_line(piece: bytes) -> int:
    """Return where the last line ends that is whole, as far as quotes can tell."""
    mark = b"\n" if b"\n" in piece else b"\r"
    cut = piece.rfind(mark) + 1
    if piece.count(b'"', 0, cut) % 2:  # a line break between quotes: cut before it
        cut = piece.rfind(mark, 0, piece.rfind(b'"', 0, cut)) + 1 or cut
    return cut


def _parse(
    path: Path, header: bytes, piece: bytes, columns: tuple[str, ...], row: int
) -> pd.DataFrame:
    try:
        frame = parse_csv(BytesIO(header + piece))
    except ValueError as error:  # of pandas, which need not be imported before
        if not re.search(r"(line|row) \d", str(error)):
            raise
        # The parser counts from the start of the piece.
        text = re.sub(r"(?<=line )\d+|(?<=row )\d+", lambda m: str(int(m[0]) + row), str(error))
        reason = " ".join(text.split())[:200].rstrip(".")
        raise LogError(f"{path} cannot be read as CSV: {reason}.") from None
    return frame.set_axis(list(columns), axis=1) if len(columns) == frame.shape[1] else frame
