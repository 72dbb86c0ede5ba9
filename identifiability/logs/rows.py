"""Rows of a log of any length: gone through some at a time, in memory or mapped from a file."""

import mmap
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from weakref import WeakSet

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, ArrayByName
from identifiability.foundation.values import Fields

#: Decisions about a long log are made on a number of windows with a number of samples each.
WINDOWS, WINDOW = 8, 16_384

#: Logs of more rows are long: these stay on the disk.
LONG = WINDOWS * WINDOW

#: Rows that are gone through at a time.
PIECE = 65_536

#: Where mapped rows lie unless TMPDIR names a folder: other temporary folders may be memory.
DISK = Path("/var/tmp")

_MAPS: WeakSet[mmap.mmap] = WeakSet()


def is_long(rows: int) -> bool:
    """Return whether `rows` rows stay on the disk, mapped from a file."""
    return rows > LONG


def spread_windows(rows: int) -> list[tuple[int, int]]:
    """Return the rows (start, stop) that decisions about a whole log are made on.

    All of them, or windows of a long log, evenly spaced from the first row to the last.
    """
    if rows <= WINDOWS * WINDOW:
        return [(0, rows)]
    starts = np.linspace(0, rows - WINDOW, WINDOWS).astype(int)
    return [(int(s), int(s) + WINDOW) for s in starts]


def divide_rows(rows: int, size: int = PIECE) -> Iterator[tuple[int, int]]:
    """Yield pieces (start, stop) of rows, in order: all rows, or about `size` of a long log.

    After each piece, the memory of mapped rows is released.
    """
    count = max(1, rows // size) if is_long(rows) else 1
    for start, stop in pairwise(np.linspace(0, rows, count + 1).astype(int).tolist()):
        yield start, stop
        forget()


def find_range(x: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest values of x (N, …) along its rows, (…) each."""
    lowest = []
    highest = []
    for a, b in divide_rows(len(x)):
        lowest.append(x[a:b].min(0, initial=np.inf))
        highest.append(x[a:b].max(0, initial=-np.inf))
    return np.min(lowest, axis=0), np.max(highest, axis=0)


def gather(pieces: Iterable[ArrayByName]) -> Fields:
    """Return arrays whose rows come piece by piece, by name; none if there are no pieces.

    Many rows go to files that have no name, and are mapped from there: they end with the arrays.

    Raises
    ------
    LogError
        If a disk is full.
    """
    kept = []
    files: Fields = {}
    rows = 0
    folder = os.environ.get("TMPDIR") or (DISK if DISK.is_dir() else None)
    with ExitStack() as stack:
        for piece in pieces:
            kept.append(piece)
            rows += len(next(iter(piece.values())))
            if is_long(rows):
                try:
                    for name in piece if not files else ():
                        files[name] = stack.enter_context(TemporaryFile(dir=folder))
                    for name, x in ((name, x) for part in kept for name, x in part.items()):
                        x.tofile(files[name])
                except OSError as error:
                    raise LogError(Finding("long.disk", folder, why=str(error))) from None
                last = {name: x[:0] for name, x in piece.items()}
                kept.clear()
                forget()
        if files:
            return {name: _mapped(file, rows, last[name]) for name, file in files.items()}
    one = len(kept) == 1
    names = kept[0] if kept else ()
    return {k: kept[0][k] if one else np.concatenate([p[k] for p in kept]) for k in names}


def _mapped(file: Any, rows: int, like: Array) -> Array:
    """Return the rows in a file that are like others."""
    shape = like.shape[1:]
    if 0 in shape:
        return np.empty((rows, *shape), like.dtype)
    stored = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    _MAPS.add(stored)
    return np.frombuffer(stored, like.dtype).reshape(rows, *shape)


def forget() -> None:
    """Release the memory of mapped rows, which stay on the disk."""
    for stored in tuple(_MAPS):
        stored.madvise(mmap.MADV_DONTNEED)
