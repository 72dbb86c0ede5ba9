"""Write results so that a reader never finds half a file; files for the time of some work."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import platform
import secrets
import shutil
import stat
import sys
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from identifiability.foundation.errors import OutputError
from identifiability.foundation.options import FilePath, checked

if TYPE_CHECKING:
    from pandas import DataFrame


# Files and folders for the time of some work; what killed programs left of theirs is swept.
#
# Whether a program still works on what it began is told by a lock that ends with it (`flock`), not
# by its number: containers that share a folder and a host name count their programs each from one.


if sys.platform != "win32":  # where nothing is swept
    import fcntl

#: Locked by who puts files of its folder in their places: containers have hosts of their own.
_TURN = ".identifiability-turn.tmp"

#: What the system says where there is no room.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

#: How to open what is locked: a folder, too, and no link, nor a pipe that would be waited for.
_PLAIN = sum(getattr(os, name, 0) for name in ("O_CLOEXEC", "O_NOFOLLOW", "O_NONBLOCK"))


def host_mark() -> str:
    """Return eight letters that stand for this machine in names of files."""
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def hold(owner: Any, path: Path) -> bool:
    """Lock what was just made as long as its owner is there, and say whether it still is.

    Who sweeps may have locked it before, and removed it.
    """
    if sys.platform == "win32":
        return True
    with suppress(FileNotFoundError):
        descriptor = os.open(path, os.O_RDONLY | _PLAIN)
        weakref.finalize(owner, os.close, descriptor)
        with suppress(OSError):  # a file system without locks, on which nothing is swept
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        return path.exists()
    return False


def sweep(paths: Iterable[Path]) -> None:
    """Remove the user's own of some files and folders where nobody holds them."""
    if sys.platform == "win32":
        return
    for path in paths:
        with suppress(OSError):
            if path.lstat().st_uid != os.getuid():
                continue
            descriptor = os.open(path, os.O_RDONLY | _PLAIN)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if not os.path.samestat(os.fstat(descriptor), path.lstat()):
                    continue  # another has taken the name since; what it made is its own
                shutil.rmtree(path) if path.is_dir() else path.unlink()  # it follows no link
            finally:
                os.close(descriptor)


class _Folder(tempfile.TemporaryDirectory[str]):
    """A folder that goes with its ``with`` block; that there is no room in it is a sentence."""

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        super().__exit__(kind, error, trace)
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            raise OutputError(
                f"What is needed for a while cannot be written: {_reason(error)}; make room in "
                f"'{tempfile.gettempdir()}', or let TMPDIR name another folder."
            ) from None


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that goes with its ``with`` block, or with the program; sweep orphans."""
    name = f"identifiability-{host_mark()}-"
    sweep(Path(tempfile.gettempdir()).glob(f"{name}*-*"))
    while True:
        prefix = f"{name}{os.getpid()}-"
        folder = _Folder(prefix=prefix, ignore_cleanup_errors=True)
        if hold(folder, Path(folder.name)):
            return folder
        folder.cleanup()  # who swept took it before it was held; else it is reported as left behind


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
        mode = _mode(path)
        if mode is not None and stat.S_ISDIR(mode):
            raise OutputError(f"'{path}' is a folder; give a file name to write to.")
        if mode is not None and not stat.S_ISREG(mode):
            raise OutputError(f"'{path}' is no regular file; give another name to write to.")
        folder = real(path).parent
        if not folder.is_dir():
            raise OutputError(f"The folder '{folder}' does not exist; create it or choose another.")
    except (OSError, ValueError) as error:
        raise OutputError(f"'{path}' cannot be written: {_reason(error)}.") from None
    if not os.access(folder, os.W_OK):
        raise OutputError(f"The folder '{folder}' is not writable; choose another.")
    if mode is not None:
        try:  # one question, as another run may put its file there at any time
            os.close(os.open(path, os.O_WRONLY))
        except FileNotFoundError:
            pass
        except OSError:
            raise OutputError(
                f"'{path}' is protected against writing; give another name."
            ) from None
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
        _held = _fill(temporary, content, target)
        temporary.replace(target)
    except OSError as error:
        raise OutputError(f"'{path}' cannot be written: {_reason(error)}.") from None
    finally:  # also after Ctrl-C; nothing is left there when the file is in its place
        _remove([temporary])
    return path


def write_together(files: Sequence[tuple[Path, bytes]]) -> None:
    """Write files that are of no use without each other: all of them or none.

    The last one is what the others belong to. Its old version is put aside first and the new one
    is put in its place last: whoever looks, even after a power cut, finds the old files, the new
    ones, or no main file (and the old one as ``<name>.<digits>.old``), but never a mixture.

    Raises
    ------
    OutputError
    """
    targets = [real(check_writable(path)) for path, _ in files]
    fresh = [_beside(target) for target in targets]
    aside: list[tuple[Path, Path]] = []
    placed: list[Path] = []
    turn = ExitStack()
    try:
        _held = [
            _fill(temporary, content, target)
            for temporary, (_, content), target in zip(fresh, files, targets, strict=True)
        ]
        turn.enter_context(_taking_turns(targets[-1].parent))
        for target in reversed(targets):
            if target.exists():
                name = target.with_name(f"{target.name}.{secrets.token_hex(4)}.old")
                aside.append((name, target))
                target.replace(name)
        for temporary, target in zip(fresh, targets, strict=True):
            placed.append(target)
            temporary.replace(target)
    except BaseException as error:  # also Ctrl-C: undo what was done, the main file last
        _remove(reversed(placed))
        for name, target in reversed(aside):
            if name.exists():
                name.replace(target)
        if isinstance(error, OSError):
            names = " and ".join(f"'{path}'" for path, _ in files)
            raise OutputError(f"{names} cannot be written: {_reason(error)}.") from None
        raise
    else:
        _remove(name for name, _ in aside)
    finally:
        turn.close()
        _remove(fresh)


@contextmanager
def _taking_turns(folder: Path) -> Iterator[None]:
    """Let one program at a time put files of a folder in their places, where there are locks."""
    path, descriptor = folder / _TURN, -1
    with suppress(OSError):  # a file system without locks, a program of another user
        while sys.platform != "win32":
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | _PLAIN, 0o600)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            with suppress(FileNotFoundError):  # who had it before has removed it
                if os.path.samestat(os.fstat(descriptor), path.stat()):
                    break
            os.close(descriptor)
            descriptor = -1
    try:
        yield
    finally:
        if descriptor >= 0:
            _remove([path])
            os.close(descriptor)


def kept_aside(path: Path) -> Path | None:
    """Return where an interrupted `write_together` left the old content of a file, if anywhere."""
    try:
        return next(iter(sorted(path.parent.glob(f"{escape(path.name)}.*.old"))), None)
    except (OSError, ValueError):  # no name of a file
        return None


def _beside(target: Path) -> Path:
    """Return where a file is filled before it is put in its place; sweep what the killed left."""
    host = host_mark()
    sweep([target.with_name(_TURN), *target.parent.glob(f".{host}-*-*.tmp")])
    return target.with_name(f".{host}-{os.getpid()}-{secrets.token_hex(6)}.tmp")


def _fill(temporary: Path, content: bytes, target: Path) -> BinaryIO:
    """Write a file that is not in its place yet, with the rights of the one that it replaces.

    Nobody sweeps it as long as what is returned is kept.
    """
    while True:
        with temporary.open("xb") as stream:
            if not hold(stream, temporary):
                continue
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        with suppress(FileNotFoundError):  # nothing there, or put aside by another run just now
            shutil.copymode(target, temporary)
        return stream


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
            raise OutputError(
                f"The column '{name}' would be run as a formula by a spreadsheet that opens the "
                "CSV; give the joint another name, or write Parquet."
            )
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
