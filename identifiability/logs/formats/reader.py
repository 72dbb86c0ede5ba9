"""The list of formats: it finds the reader of a path, by its suffix or its content."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias
from zipfile import ZipFile

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, sentences
from identifiability.foundation.values import frozen
from identifiability.logs.form import Form

if TYPE_CHECKING:
    import pandas as pd

    from identifiability.logs.conventions import Conventions


#: The result of a reader: a table, its format, and the SHA-256 of its bytes.
Whole: TypeAlias = "tuple[pd.DataFrame, Form, str]"

Read: TypeAlias = "Callable[[Path, Conventions], Whole]"

#: Error if there is no file.
MISSING = "There is no log file '{}'; give a CSV or Parquet file."

#: Readable formats, for sentences.
READ = (
    "tables of text (.csv, .tsv, .txt …), Parquet, .npz, .mat, .xlsx, ROS bags (.mcap, .db3, .bag) "
    "and folders of LeRobot are read"
)


@frozen
class Reader:
    """A format.

    Attributes
    ----------
    kind : str
        Name of the format in messages.
    suffixes : tuple of str
        Of its files.
    read : callable(Path, Conventions) -> (DataFrame, Form, str)
        Returns the table, its format, and the hash of its bytes.
    sniff : callable(Path) -> bool
        Whether something without such a suffix is of this format.
    place : callable(Path) -> Path
        The file or folder of a path that names a part of it behind a colon.
    parts : callable(Path) -> list of Path
        The logs that a path names.
    """

    kind: str
    suffixes: tuple[str, ...]
    read: Read
    sniff: Callable[[Path], bool]
    place: Callable[[Path], Path]
    parts: Callable[[Path], list[Path]]


#: All formats, in the order in which they are asked.
READERS: list[Reader] = []


def reader(
    kind: str,
    *suffixes: str,
    sniff: Callable[[Path], bool] = lambda _: False,
    place: Callable[[Path], Path] = Path,
    parts: Callable[[Path], list[Path]] = lambda path: [path],
) -> Callable[[Read], Read]:
    """Register who reads a format; parameters as in `Reader`.

    Example
    -------
    ::

        @reader("HDF5", ".h5", ".hdf5")
        def read_hdf5(path, known):
            return frame_of(arrays_of(path), str(path)), PLAIN, hash_files(path)
    """

    def decorate(read: Read) -> Read:
        READERS.append(Reader(kind, suffixes, read, sniff, place, parts))
        return read

    return decorate


def find_reader(path: Path) -> Reader | None:
    """Return the reader of a path; None for text tables and Parquet."""
    suffix = path.suffix.lower()
    return next((r for r in READERS if suffix in r.suffixes or r.sniff(path)), None)


def find_parts(path: Path) -> list[Path]:
    """Return the logs that a path names: the episodes of a dataset, else one."""
    found = find_reader(path)
    if found is None:
        return [path]
    return found.parts(path)


def check_there(path: Path) -> None:
    """Refuse a path at which there is no log; nothing is read.

    Raises
    ------
    LogError
    """
    found = find_reader(path)
    place = path if found is None else found.place(path)
    try:
        there = place.exists()
        other = there and not place.is_file() and not place.is_dir()
    except OSError:  # no name of a file; its reader states why
        return
    if not there:
        raise LogError(MISSING.format(place))
    if other:  # a pipe would be waited for, a device has no end
        raise LogError(f"'{path}' is no file; give a CSV or Parquet file.")
    find_parts(path)


def check_suffix(path: Path) -> None:
    """Refuse a kind of file that is no log, by name.

    Raises
    ------
    LogError
    """
    what = sentences()["file.foreign"].get(path.suffix.lower())
    if what:
        raise LogError(Finding("file.foreign", path, what=what))


def check_text(path: Path, start: str) -> None:
    """Refuse a file that is no text, by its beginning.

    Raises
    ------
    LogError
    """
    if start.startswith("PAR1"):
        raise LogError(f"{path} is Parquet by its content; name it so: {path.stem}.parquet.")
    if "\0" in start:
        kind = f"a {path.suffix} file" if path.suffix else "a file without an ending"
        raise LogError(
            Finding(
                "file.kind",
                path,
                kind=kind,
                read=READ,
            )
        )


#: Unpacked size that any file may have, and the largest ratio to its size for larger files.
UNPACKED, TIMES = 64_000_000, 100


def check_unpacked(path: Path, unpacked: int, least: int = UNPACKED) -> None:
    """Refuse a file whose unpacked size is far above its size, before it is unpacked.

    Parameters
    ----------
    path : Path
    unpacked : int
        Counted bytes in memory.
    least : int
        Unpacked size that is always allowed [bytes].

    Raises
    ------
    LogError
    """
    size = path.stat().st_size
    if unpacked > max(least, TIMES * size):
        raise LogError(
            Finding("file.unpacked", path, size=size / 1e6, unpacked=unpacked / 1e6, times=TIMES)
        )


def count_zipped(path: Path) -> int:
    """Return the unpacked size of a ZIP archive by its directory [bytes]; readers stop there."""
    with ZipFile(path) as archive:
        return sum(entry.file_size for entry in archive.infolist())


def list_files(place: Path) -> list[Path]:
    """Return a file, or those in a folder in order of name."""
    if place.is_dir():
        return sorted(p for p in place.iterdir() if p.is_file())
    return [place]


def hash_files(place: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files in order of name."""
    digest = hashlib.sha256()
    for file in list_files(place):
        with file.open("rb") as stream:
            hashlib.file_digest(stream, lambda: digest)
    return digest.hexdigest()
