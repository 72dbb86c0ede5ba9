"""Write results so that a reader never finds half a file; files for the time of some work."""

from __future__ import annotations

import errno
import json
import math
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identifiability.foundation.errors import OutputError
from identifiability.foundation.findings import Finding
from identifiability.foundation.options import FilePath, checked

if TYPE_CHECKING:
    from pandas import DataFrame


# Files and folders for the time of some work; what killed programs left of theirs is swept.

#: What the system says where there is no room.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

#: What folders for a while are called, and files that are not in their place yet.
FOLDER, HALF = "identifiability-", ".identifiability-"

#: Days after which what nobody has touched is taken for left behind: folders, and half files.
FOLDERS_STAY, HALVES_STAY = 30, 1


def sweep(paths: Iterable[Path], days: float) -> None:
    """Remove the user's own of some files and folders that nobody has touched for so long."""
    for path in paths:
        with suppress(OSError):
            status = path.lstat()
            own = not hasattr(os, "getuid") or status.st_uid == os.getuid()
            if own and time.time() - status.st_mtime > timedelta(days=days).total_seconds():
                shutil.rmtree(path) if stat.S_ISDIR(status.st_mode) else path.unlink()


class _Folder(tempfile.TemporaryDirectory[str]):
    """A folder that goes with its ``with`` block; that there is no room in it is a sentence."""

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        super().__exit__(kind, error, trace)
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            told = {"why": _reason(error), "folder": tempfile.gettempdir()}
            raise OutputError(Finding("output.temporary", **told)) from None


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that goes with its ``with`` block, or with the program; sweep orphans."""
    sweep(Path(tempfile.gettempdir()).glob(f"{FOLDER}*"), FOLDERS_STAY)
    return _Folder(prefix=FOLDER, ignore_cleanup_errors=True)


# Write results so that a reader never finds half a file.


@checked
def check_writable(path: FilePath) -> Path:
    """Return the path if a file can be written there; called before a long computation.

    Raises
    ------
    OutputError
    """
    path = Path(path)
    try:
        mode, folder = _mode(path), real(path).parent
        wrong = {
            "folder": mode is not None and stat.S_ISDIR(mode),
            "special": mode is not None and not stat.S_ISREG(mode),
            "nowhere": not folder.is_dir(),
            "closed": not os.access(folder, os.W_OK),
            # Another run may put its file there at any time, and take none away.
            "protected": path.exists() and not os.access(path, os.W_OK),
        }
    except (OSError, ValueError) as error:
        raise OutputError(f"'{path}' cannot be written: {_reason(error)}.") from None
    for problem in (key for key, holds in wrong.items() if holds):
        raise OutputError(Finding(f"output.{problem}", path, folder=folder))
    return path


def _mode(path: Path) -> int | None:
    """Return the mode of what is there; None for nothing."""
    try:
        return path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


@checked
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
        *others, last = endings
        known = f"{', '.join(others)} or {last}" if others else last
        raise OutputError(f"'{path}' does not end in {known}, as what is written there does.")


def check_apart(outputs: Iterable[str | Path], inputs: Iterable[str | Path]) -> None:
    """Refuse to write over what is read, or one file twice.

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
    """Return where a path leads; one whose links go in a ring leads to itself."""
    return Path(os.path.realpath(path))


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)


def write_text(path: str | Path, text: str) -> Path:
    """Write a text file whole or not at all, replacing an older one only at the end.

    Raises
    ------
    OutputError
    """
    return write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | Path, content: bytes) -> Path:
    """Write a file whole or not at all.

    Raises
    ------
    OutputError
    """
    path = check_writable(path)
    target = real(path)  # a link stays a link
    temporary = _beside(target)
    try:
        _fill(temporary, content, target)
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"'{path}' cannot be written: {_reason(error)}.") from None
    finally:  # also after Ctrl-C; nothing is left there when the file is in its place
        _remove([temporary])
    return path


def write_together(files: Sequence[tuple[Path, bytes]]) -> None:
    """Write files that are of no use without each other: all of them or none.

    All are filled before the first is put in its place, the one that the others belong to last.

    Raises
    ------
    OutputError
    """
    targets = [real(check_writable(path)) for path, _ in files]
    fresh = [_beside(target) for target in targets]
    try:
        before = [target.read_bytes() if target.exists() else None for target in targets]
        for temporary, (_, content), target in zip(fresh, files, targets, strict=True):
            _fill(temporary, content, target)
        try:
            for temporary, target in zip(fresh, targets, strict=True):
                temporary.replace(target)
        except BaseException:  # also Ctrl-C: undo what was done
            _remove(t for t, old in zip(targets, before, strict=True) if old is None)
            for target, old in zip(targets, before, strict=True):
                if old is not None and target.read_bytes() != old:
                    target.write_bytes(old)
            raise
    except OSError as error:
        names = " and ".join(f"'{path}'" for path, _ in files)
        raise OutputError(f"{names} cannot be written: {_reason(error)}.") from None
    finally:
        _remove(fresh)


def _beside(target: Path) -> Path:
    """Return where a file is filled before it is put in its place; sweep what the killed left."""
    sweep(target.parent.glob(f"{HALF}*.tmp"), HALVES_STAY)
    return target.with_name(f"{HALF}{secrets.token_hex(6)}.tmp")


def _fill(temporary: Path, content: bytes, target: Path) -> None:
    """Write a file that is not in its place yet, with the rights of the one that it replaces."""
    with temporary.open("xb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    with suppress(FileNotFoundError):  # nothing there, or put aside by another run just now
        shutil.copymode(target, temporary)


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with suppress(OSError):
            path.unlink(missing_ok=True)


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
    text: str = frame.to_csv(index=False)
    return text


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


def write_json(path: str | Path, content: dict[str, Any]) -> Path:
    """Write a JSON file."""
    return write_text(path, json.dumps(plain(content), indent=2, ensure_ascii=False) + "\n")
