"""Files and folders for the time of some work; what killed programs left of theirs is swept.

Whether a program still works on what it began is told by a lock that ends with it (`flock`), not by
its number: containers that share a folder and a host name count their programs each from one.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import sys
import tempfile
import weakref
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

if sys.platform != "win32":  # where nothing is swept
    import fcntl

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
        held = os.open(path, os.O_RDONLY | _PLAIN)
        weakref.finalize(owner, os.close, held)
        with suppress(OSError):  # a file system without locks, on which nothing is swept
            fcntl.flock(held, fcntl.LOCK_EX)
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
            held = os.open(path, os.O_RDONLY | _PLAIN)
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path) if path.is_dir() else path.unlink()  # it follows no link
            finally:
                os.close(held)


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that goes with its ``with`` block, or with the program; sweep orphans."""
    name = f"identifiability-{host_mark()}-"
    sweep(Path(tempfile.gettempdir()).glob(f"{name}*-*"))
    while True:
        prefix = f"{name}{os.getpid()}-"
        folder = tempfile.TemporaryDirectory(prefix=prefix, ignore_cleanup_errors=True)
        if hold(folder, Path(folder.name)):
            return folder
