"""Interrupted work goes on where it ended: results of finished items are kept on disk.

They are signed by the user's own key: work that others bring is not believed.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import pickle
import secrets
import shlex
import stat
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache, partial
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import Engine, Item, Result
from identifiability.foundation.errors import OutputError
from identifiability.foundation.output import write_bytes

# What is the user's own: the key that finished work is signed with, and the folder it lies in.
#
# A pickle can run any program: what others bring is not believed.


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
            with TemporaryDirectory(dir=path.parent) as folder:
                fresh = Path(folder, path.name)
                fresh.touch(0o600)
                fresh.write_bytes(secrets.token_bytes(SIZE))
                with suppress(FileExistsError):  # the first of several programs wins
                    path.hardlink_to(fresh)
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


# Digests of program text, by which two runs, or two machines, know that they compute the same.


#: Packages whose version may change a result in its last bits.
NUMERICS = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee")


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a digest of a function: its name, bound arguments, program text and numerics."""
    parts = [f"{name} {find_version(name)}" for name in NUMERICS]
    while isinstance(function, partial):
        parts.append(content_digest((function.args, function.keywords)))
        function = function.func
    module, name = _module(function), getattr(function, "__qualname__", "")
    # Of a folder without __init__, the file.
    text = source_digest(root_module(function)) or source_digest(module)
    parts += [module, name, text, source_digest("identifiability")]
    if module == "__main__" or getattr(sys.modules.get(module), name, None) is not function:
        # A notebook's, a lambda's or an object's text and values are in no file.
        parts.append(hashlib.sha256(cloudpickle.dumps(function)).hexdigest())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def content_digest(held: Any) -> str:
    """Return a digest of any values, arrays among them."""
    import joblib  # noqa: PLC0415 - heavy

    return str(joblib.hash(held, "sha1"))


def root_module(function: Callable[..., Any]) -> str:
    """Return the package or module at whose root a function lives."""
    while isinstance(function, partial):
        function = function.func
    return _module(function).partition(".")[0]


def _module(function: Callable[..., Any]) -> str:
    """Return the module of a function; ufuncs of NumPy 2.0 know that of their type only."""
    return str(getattr(function, "__module__", None) or type(function).__module__)


@cache
def source_digest(name: str) -> str:
    """Return a digest of the text of a loaded package or module; empty if it has no files."""
    found = hashlib.sha256()
    try:
        path = Path(getattr(sys.modules.get(name), "__file__", None) or "")
        for f in sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]:
            found.update(f"{f.relative_to(path.parent).as_posix()}\n".encode() + f.read_bytes())
    except OSError:  # without a file, or inside an archive
        return ""
    return found.hexdigest()


@cache
def find_version(name: str) -> str:
    """Return the version of an installed package; empty if there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


# Interrupted work goes on where it ended: results of finished items are kept on disk.
#
# A result is found again only by the content of what led to it: the function with its arguments,
# the item, and the program text. A changed input or program is therefore new work, never an old
# answer.


_DIGEST = hashlib.sha256().digest_size


class Resumed(Engine):
    """An engine that keeps the results of finished items and does not do them again.

    Results are pickled, and a pickle can run any program: so each is signed with the user's own key
    (`user_key`), and a folder from somebody else, or from another machine, is work that was not
    done. The folder must be the user's own as well. Files are written whole or not at all; one that
    is damaged is done again. After an interruption at most the items that were under way are lost.

    What an item stands for must be part of it: of a file, not only its name but a digest of its
    content.

    Parameters
    ----------
    engine : Engine
        Does what is missing.
    folder : path
        Made if it does not exist, for the user alone. One folder serves any number of runs.

    Attributes
    ----------
    found, done : int
        Items whose results were there, and that had to be done, in all calls of `map` so far.

    Raises
    ------
    OutputError
        If the folder cannot be made, or others could have written to it.
    """

    def __init__(self, engine: Engine, folder: str | Path) -> None:
        self.engine = engine
        self.folder = open_private(folder)
        self._key = user_key()
        self.found = self.done = 0

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        program = fingerprint(function)
        paths = [self._path(program, item) for item in items]
        there = [self._read(path) is not None for path in paths]
        missing = [item for item, old in zip(items, there, strict=True) if not old]
        fresh = self.engine.map(function, missing)
        for item, path, old in zip(items, paths, there, strict=True):
            content = self._read(path) if old else None
            if content is not None:
                self.found += 1
                result: Result = pickle.loads(content)
            else:  # new, or damaged or removed since we looked
                result = next(self.engine.map(function, [item])) if old else next(fresh)
                self._keep(path, result)
            yield result

    def close(self) -> None:
        """End what the engine inside has started."""
        self.engine.close()

    def _path(self, program: str, item: Any) -> Path:
        key = hashlib.sha256(f"{program} {content_digest(item)}".encode()).hexdigest()
        return self.folder / key[:2] / f"{key}.result"

    def _keep(self, path: Path, result: Any) -> None:
        content = pickle.dumps(result, protocol=5)
        path.parent.mkdir(mode=0o700, exist_ok=True)
        path.unlink(missing_ok=True)  # nothing is written through a link
        write_bytes(path, self._sign(path, content) + content).chmod(0o600)
        self.done += 1

    def _sign(self, path: Path, content: bytes) -> bytes:
        """Return what stands before a content: it is believed under the name of its work only."""
        return hmac.digest(self._key, path.name.encode() + content, "sha256")

    def _read(self, path: Path) -> bytes | None:
        """Return the pickled result, or None if there is none that can be believed."""
        try:
            if not (is_private(path.parent) and is_private(path) and path.is_file()):
                return None
            whole = path.read_bytes()
        except OSError:
            return None
        signed, content = whole[:_DIGEST], whole[_DIGEST:]
        return content if hmac.compare_digest(signed, self._sign(path, content)) else None
