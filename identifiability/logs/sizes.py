"""How large a log may be, so that one without end is a sentence and not all the memory."""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from identifiability.foundation.errors import LogError

#: Columns of any log.
MOST_COLUMNS = 5_000

#: Of files of arrays and sheets, which are read at once: bytes as they are unpacked, bytes of a
#: sheet (some 75,000 samples of six joints), values, and parts.
MOST_BYTES, MOST_SHEET_BYTES = 250_000_000, 50_000_000
MOST_VALUES, MOST_PARTS = 30_000_000, 1_000

#: Bytes of what describes a workbook or a bag beside its data.
MOST_DESCRIBED = 2_000_000

#: Where a cell or a row of a sheet is.
_PLACE = re.compile(rb"""\br\s*=\s*["']([A-Z]*)(\d+)""")

_INSTEAD = "write Parquet, which is read piece by piece"


def check_columns(path: Path | str, count: int) -> None:
    """Refuse a log with more columns than any robot has.

    Raises
    ------
    LogError
    """
    if count > MOST_COLUMNS:
        raise LogError(
            f"{path} has {count} columns; logs of up to {MOST_COLUMNS} are read: give those of the "
            "robot's joints alone."
        )


def check_values(path: Path | str, count: int) -> None:
    """Refuse a container of more values than are held in memory.

    Raises
    ------
    LogError
    """
    if count > MOST_VALUES:
        raise LogError(
            f"{path} holds {count} values; up to {MOST_VALUES} are read from such a file: "
            f"{_INSTEAD}."
        )


def check_archive(path: Path, content: bytes, most: int | None = None) -> None:
    """Refuse an archive (.npz, .xlsx) that unpacks to more than is held in memory.

    Raises
    ------
    LogError
    """
    with zipfile.ZipFile(BytesIO(content)) as archive:
        parts = archive.infolist()
    if len(parts) > MOST_PARTS:
        raise LogError(f"{path} has {len(parts)} parts; files of up to {MOST_PARTS} are read.")
    _check_unpacked(path, sum(part.file_size for part in parts), most or MOST_BYTES)


def check_sheets(path: Path, content: bytes) -> None:
    """Refuse a workbook that says of itself more than it holds, or has cells far out.

    Raises
    ------
    LogError
    """
    with zipfile.ZipFile(BytesIO(content)) as archive:
        for part in archive.infolist():
            data = part.filename.startswith(("xl/worksheets/", "xl/sharedStrings", "xl/media/"))
            if not data and part.file_size > MOST_DESCRIBED:
                raise LogError(
                    f"{path}: its part '{part.filename}' is larger than "
                    f"{MOST_DESCRIBED // 10**6} MB; save the sheet alone as CSV."
                )
            if part.filename.startswith("xl/worksheets/"):
                _check_places(path, archive.read(part))


def _check_places(path: Path, sheet: bytes) -> None:
    """Refuse a sheet with cells far out: what reads it fills all that is in between."""
    height = width = 1
    for letters, digits in set(_PLACE.findall(sheet)):
        column = 0
        for letter in letters[:4]:
            column = 26 * column + letter - 64
        width, height = max(width, column), max(height, int(digits[:9]))
    check_columns(path, width)
    check_values(path, width * height)


def check_elements(path: Path, content: bytes) -> None:
    """Refuse a MATLAB file (version 5) that unpacks to more than is held in memory.

    Raises
    ------
    LogError
    """
    unpacked = 0
    for element in _compressed(content):
        unpacking, left = zlib.decompressobj(), element
        while left and unpacked <= MOST_BYTES:
            unpacked += len(unpacking.decompress(left, 1_000_000))
            left = unpacking.unconsumed_tail
        _check_unpacked(path, unpacked, MOST_BYTES)


def _compressed(content: bytes) -> Iterator[bytes]:
    """Yield the compressed elements of a MATLAB file; its own reader says what is damaged."""
    order = ">" if content[126:128] == b"MI" else "<"
    at = 128
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        if kind == 15:
            yield content[at + 8 : at + 8 + size]
        at += 8 + size


def _check_unpacked(path: Path, size: int, most: int) -> None:
    if size > most:
        raise LogError(
            f"{path} unpacks to more than {most // 10**6} MB, up to which such files are read: "
            f"{_INSTEAD}."
        )
