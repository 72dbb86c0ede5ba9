"""What is the user's own: the key that finished work is signed with, and the folder it lies in.

A pickle can run any program: what others bring is not believed.
"""

from __future__ import annotations

import os
import secrets
import shlex
import stat
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

from identifiability.foundation.errors import OutputError

#: Bytes of a key.
SIZE = 32


def key_path() -> Path:
    """Return where the key of this user is: in the folder for state of the XDG base directories."""
    stated = os.environ.get("XDG_STATE_HOME", "")
    state = Path(stated) if Path(stated).is_absolute() else Path.home() / ".local" / "state"
    return state / "identifiability" / "resume.key"


def user_key() -> bytes:
    """Return the user's key, which is made when it is first asked for, for the user alone.

    Raises
    ------
    OutputError
        If it can be neither read nor made, or others can read it.
    """
    try:
        path = key_path()
        try:
            return _read(path)
        except FileNotFoundError:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            fresh = path.with_name(f".{secrets.token_hex(8)}.tmp")
            try:
                descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(descriptor, "wb") as stream:
                    stream.write(secrets.token_bytes(SIZE))
                with suppress(FileExistsError):  # the first of several programs wins
                    path.hardlink_to(fresh)
            finally:
                fresh.unlink(missing_ok=True)
            return _read(path)
    except (OSError, RuntimeError) as error:  # RuntimeError: a user without a home
        reason = getattr(error, "strerror", None) or error
        raise OutputError(
            f"The key that finished work is signed with cannot be kept ({reason}); set "
            "XDG_STATE_HOME to a folder of your own, or leave --resume out."
        ) from None


def _read(path: Path) -> bytes:
    status = path.stat()
    others = stat.S_IMODE(status.st_mode) & (stat.S_IRWXG | stat.S_IRWXO)
    if hasattr(os, "getuid") and (status.st_uid != os.getuid() or others):
        raise OutputError(
            f"'{path}', which finished work is signed with, can be read by others; remove it, and "
            "a new one is made."
        )
    key = path.read_bytes()
    if len(key) != SIZE:
        raise OutputError(f"'{path}' is no key of {SIZE} bytes; remove it, and a new one is made.")
    return key


def open_private(folder: str | Path) -> Path:
    """Return the real place of a folder that only the user can write to; it is made if missing.

    Where users cannot be told apart (Windows) any folder will do.

    Raises
    ------
    OutputError
        If it cannot be made, belongs to somebody else, or others can write to it or put another
        one in its place.
    """
    folder = Path(folder)
    try:
        if folder.is_symlink() and not _trusts(folder.lstat()):
            raise _refusal(folder, "is a link of another user", "give a folder of your own")
        place = folder.resolve()
        for parent in (*reversed(place.parents), place):
            parent.mkdir(mode=0o700, exist_ok=True)
        _check(folder, place)
    except (OSError, RuntimeError, ValueError) as error:  # RuntimeError: links in a circle
        reason = getattr(error, "strerror", None) or error
        raise OutputError(
            f"'{folder}' cannot keep finished work: {reason}; give a folder."
        ) from None
    return place


def is_private(path: Path) -> bool:
    """Return whether a path is no link, belongs to the user, and nobody else can write to it."""
    status = path.lstat()
    return not stat.S_ISLNK(status.st_mode) and _owns(status) and not _others_write(status)


def _check(folder: Path, place: Path) -> None:
    status = place.stat()
    if not _owns(status):
        raise _refusal(folder, "belongs to another user", "give a folder of your own")
    if _others_write(status):
        remedy = f"run 'chmod 700 {shlex.quote(str(folder))}', or give another folder"
        raise _refusal(folder, "can be written to by others", remedy)
    for below, parent in pairwise((place, *place.parents)):
        status = parent.stat()
        # In a sticky folder, such as /tmp, others cannot rename what is not theirs.
        kept = status.st_mode & stat.S_ISVTX and _trusts(below.stat())
        if not _trusts(status) or (_others_write(status) and not kept):
            what = f"can be replaced by others, who can write to '{parent}'"
            raise _refusal(folder, what, "give a folder elsewhere, such as one in your home")


def _owns(status: os.stat_result) -> bool:
    """Return whether something belongs to the user, as far as users can be told apart."""
    return not hasattr(os, "getuid") or status.st_uid == os.getuid()


def _trusts(status: os.stat_result) -> bool:
    """Return whether something belongs to the user or to who can do everything anyway."""
    return _owns(status) or status.st_uid in (0, Path("/").stat().st_uid)


def _others_write(status: os.stat_result) -> bool:
    if not hasattr(os, "getuid"):
        return False
    group = status.st_mode & stat.S_IWGRP and not _alone_in(status.st_gid)
    return bool(status.st_mode & stat.S_IWOTH or group)


def _alone_in(group: int) -> bool:
    """Return whether a group is the user's private one, as many systems make one for each user."""
    import grp  # noqa: PLC0415 - not on Windows
    import pwd  # noqa: PLC0415

    try:
        user, found = pwd.getpwuid(os.getuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return found.gr_name == user.pw_name and set(found.gr_mem) <= {user.pw_name}


def _refusal(folder: Path, what: str, remedy: str) -> OutputError:
    return OutputError(
        f"'{folder}' {what}, and finished work that is kept there is run as a program: {remedy}."
    )
