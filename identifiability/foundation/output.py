"""Write results so that a reader never finds half a file; files for the time of some work."""

from __future__ import annotations

import json
import math
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import OutputError
from .findings import Finding
from .options import FilePath, checked
from .values import Json

if TYPE_CHECKING:
    from pandas import DataFrame


#: Prefix of temporary folders, and of files that are not complete yet.
FOLDER, HALF = "identifiability-", ".identifiability-"


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that goes with its ``with`` block, or with the program."""
    return tempfile.TemporaryDirectory(prefix=FOLDER, ignore_cleanup_errors=True)


@checked
def check_writable(path: FilePath) -> Path:
    """Return the path if a file can be written there; called before a long computation.

    Raises
    ------
    OutputError
    """
    path = Path(path)
    try:
        folder = real(path).parent
        there = path.exists()
        special = there and not path.is_file()
        may_write = os.access(folder, os.W_OK)
        wrong = {
            "folder": path.is_dir(),
            "special": special,
            "nowhere": not folder.is_dir(),
            "closed": not may_write,
            # Another run may add its file there at any time, but removes none.
            "protected": there and not os.access(path, os.W_OK),
        }
    except (OSError, ValueError) as error:
        raise OutputError(f"'{path}' cannot be written: {_reason(error)}.") from None
    for problem in (key for key, holds in wrong.items() if holds):
        raise OutputError(Finding(f"output.{problem}", path, folder=folder))
    return path


def check_ending(path: FilePath, *endings: str) -> None:
    """Refuse a file whose name ends as if it were of another format.

    Parameters
    ----------
    path : path-like
    *endings : str
        Those of the format, as ``".html"``; letter case does not matter.

    Raises
    ------
    OutputError
    """
    if Path(path).suffix.lower() not in endings:
        known = ", ".join(endings[:-1]) + " or " * (len(endings) > 1) + endings[-1]
        raise OutputError(f"'{path}' does not end in {known}; give one of these endings.")


def check_apart(outputs: Iterable[str | Path], inputs: Iterable[str | Path]) -> None:
    """Refuse to overwrite an input, and to write one file twice.

    Raises
    ------
    OutputError
    """
    taken = [real(path) for path in inputs]
    for path in outputs:
        place = real(path)
        if place in taken:
            raise OutputError(f"'{path}' is an input or another output; give it its own name.")
        taken.append(place)


def real(path: str | Path) -> Path:
    """Return the target of a path; links in a ring lead to the path itself."""
    return Path(os.path.realpath(path))


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file whole or not at all, replacing an older one only at the end.

    Raises
    ------
    OutputError
    """
    # A path may hold bytes that are no UTF-8; HTML, JSON and CSV show them as escapes.
    return write_bytes(path, text.encode("utf-8", "backslashreplace"))


def write_bytes(path: str | Path, content: bytes) -> Path:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
    """
    write_together([(Path(path), content)])
    return Path(path)


def write_together(files: Sequence[tuple[Path, bytes]]) -> None:
    """Write files that are of no use without each other, or one.

    All files are complete before the first is put in its place. The main file comes last.

    Raises
    ------
    OutputError
    """
    targets = [real(check_writable(path)) for path, _ in files]  # a link stays a link
    fresh = [target.with_name(f"{HALF}{secrets.token_hex(6)}.tmp") for target in targets]
    try:
        for temporary, (_, content), target in zip(fresh, files, targets, strict=True):
            _sweep(target.parent)
            with temporary.open("xb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            with suppress(FileNotFoundError):  # nothing there, or put aside by another run just now
                shutil.copymode(target, temporary)
        for temporary, target in zip(fresh, targets, strict=True):
            temporary.replace(target)
    except OSError as error:
        names = " and ".join(f"'{path}'" for path, _ in files)
        raise OutputError(f"{names} cannot be written: {_reason(error)}.") from None
    finally:  # also after Ctrl-C; nothing remains there once the files are in place
        for temporary in fresh:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _sweep(folder: Path) -> None:
    """Remove partial files that killed programs left in a folder at least a day ago."""
    for left in folder.glob(f"{HALF}*.tmp"):
        with suppress(OSError):
            # A day, in seconds.
            if time.time() - left.stat().st_mtime > 86_400:
                left.unlink()


def csv_text(frame: DataFrame) -> str:
    """Return a table as CSV.

    Raises
    ------
    OutputError
        If a spreadsheet would run the name of a column as a formula; names come from robot files.
    """
    for name in map(str, frame.columns):
        if name.startswith(("=", "+", "-", "@", "\t", "\r")):
            raise OutputError(Finding("output.formula", name))
    return str(frame.to_csv(index=False))


def plain(value: Any) -> Any:
    """Return a value that JSON can hold: arrays as lists, infinite and NaN numbers as null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def write_json(path: str | Path, content: Json) -> Path:
    """Write a JSON file."""
    return write_text(path, json.dumps(plain(content), indent=2, ensure_ascii=False) + "\n")
