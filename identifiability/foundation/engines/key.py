"""The user's own key, by which finished work is signed: work that others bring is not believed."""

from __future__ import annotations

import os
import secrets
import stat
from contextlib import suppress
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
