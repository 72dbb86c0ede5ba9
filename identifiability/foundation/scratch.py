"""Folders for the time of some work; what killed programs left of theirs is swept."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

_OURS = re.compile(r"identifiability-([0-9a-f]{8})-(\d+)-\w+")


def host_mark() -> str:
    """Return eight letters that stand for this machine in names of files."""
    return hashlib.sha256(platform.node().encode()).hexdigest()[:8]


def is_gone(program: int) -> bool:
    """Return whether no program of this machine has a number, as far as that can be told."""
    if os.name != "posix":
        return False
    try:
        os.kill(program, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):  # somebody else's, or no number of a program
        return False
    return False


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that goes with its ``with`` block, or with the program; sweep orphans."""
    for path in Path(tempfile.gettempdir()).glob(f"identifiability-{host_mark()}-*"):
        found = _OURS.fullmatch(path.name)
        with suppress(OSError):
            own = not hasattr(os, "getuid") or path.lstat().st_uid == os.getuid()
            if found is not None and own and is_gone(int(found[2])):
                shutil.rmtree(path, ignore_errors=True)  # it follows no link
    name = f"identifiability-{host_mark()}-{os.getpid()}-"
    return tempfile.TemporaryDirectory(prefix=name, ignore_cleanup_errors=True)
