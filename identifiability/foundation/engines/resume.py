"""Interrupted work goes on where it ended: results of finished items are kept in a folder.

A result is found again only by the content of what led to it: the function with its arguments, the
item, the program text and the versions of numerics. A changed input is new work, never an old
answer.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import Engine, Item, Result
from identifiability.foundation.errors import OutputError
from identifiability.foundation.output import write_bytes

#: Packages whose version may change a result in its last bits.
NUMERICS = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee")


def fingerprint(function: Callable[..., Any], item: Any = None) -> str:
    """Return a digest of a function with its arguments, an item, program text and numerics."""
    import joblib  # noqa: PLC0415 - heavy

    parts: list[Any] = [item, *(find_version(name) for name in NUMERICS)]
    while isinstance(function, partial):
        parts.append((function.args, function.keywords))
        function = function.func
    texts = [source_digest(name) for name in ("identifiability", root_module(function))]
    # A function of a module is its name there; a notebook's, or a lambda, is its own text.
    return str(joblib.hash([*parts, *texts, cloudpickle.dumps(function)], "sha1"))


def root_module(function: Callable[..., Any]) -> str:
    """Return the package or module at whose root a function lives."""
    while isinstance(function, partial):
        function = function.func
    # Ufuncs of NumPy 2.0 know the module of their type only.
    return str(getattr(function, "__module__", "") or type(function).__module__).partition(".")[0]


@cache
def source_digest(name: str) -> str:
    """Return a digest of the text of a loaded package or module; empty if it has no files."""
    path = Path(getattr(sys.modules.get(name), "__file__", None) or "")
    files = sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]
    texts = [(f.relative_to(path.parent).as_posix(), f.read_bytes()) for f in files if f.is_file()]
    return hashlib.sha256(repr(texts).encode()).hexdigest() if texts else ""


@cache
def find_version(name: str) -> str:
    """Return the version of an installed package; empty if there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


class Resumed(Engine):
    """An engine that keeps the results of finished items and does not do them again.

    Files are written whole or not at all; one that is damaged is done again. After an interruption
    at most the items that were under way are lost. Results are pickles, which can run any program:
    the folder is the user's own, as scripts are. What an item stands for must be part of it: of a
    file, not only its name but a digest of its content.

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
        If the folder cannot be made, or others can write to it.
    """

    def __init__(self, engine: Engine, folder: str | Path) -> None:
        self.engine, self.folder = engine, Path(folder)
        self.found = self.done = 0
        problem = "it can be written to by everybody, and what is kept there is run as a program"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            mine = not self.folder.stat().st_mode & 0o002
        except (OSError, ValueError) as error:
            mine, problem = False, str(getattr(error, "strerror", None) or error)
        if not mine:
            raise OutputError(f"'{folder}' cannot keep finished work: {problem}; give a folder.")

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        paths = [self.folder / f"{fingerprint(function, item)}.result" for item in items]
        there = [_read(path) is not None for path in paths]
        missing = [item for item, old in zip(items, there, strict=True) if not old]
        fresh = self.engine.map(function, missing)
        for item, path, old in zip(items, paths, there, strict=True):
            content = _read(path) if old else None
            if content is None:  # new, or damaged or removed since we looked
                result = next(self.engine.map(function, [item])) if old else next(fresh)
                content = pickle.dumps(result, protocol=5)
                write_bytes(path, _sealed(path, content))
                self.done += 1
            else:
                self.found += 1
            yield pickle.loads(content)

    def close(self) -> None:
        """End what the engine inside has started."""
        self.engine.close()


def _sealed(path: Path, content: bytes) -> bytes:
    """Return a result with the digest of it and of its name before it."""
    return hashlib.sha256(path.name.encode() + content).digest() + content


def _read(path: Path) -> bytes | None:
    """Return the pickled result, or None if there is none, or only a part of it."""
    try:
        whole = path.read_bytes()
    except OSError:
        return None
    content = whole[hashlib.sha256().digest_size :]
    return content if whole == _sealed(path, content) else None
