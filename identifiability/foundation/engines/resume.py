"""Interrupted work goes on where it ended: results of finished items are kept on disk.

A result is found again only by the content of what led to it: the function with its arguments, the
item, and the program text. A changed input or program is therefore new work, never an old answer.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import joblib

from identifiability.foundation.engines.fingerprint import fingerprint
from identifiability.foundation.engines.mapping import Engine, Item, Result
from identifiability.foundation.engines.private_folder import is_private, open_private
from identifiability.foundation.output import write_bytes

_MAGIC = b"identifiability result 1\n"
_DIGEST = hashlib.sha256().digest_size


class Resumed(Engine):
    """An engine that keeps the results of finished items and does not do them again.

    Results are pickled, and a pickle can run any program: the folder must be the user's own, and
    what others wrote there is not read. Each file has a checksum and is written whole or not at
    all; a damaged one is done again. After an interruption at most the items that were under way
    are lost.

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
        self.found = self.done = 0

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        program = fingerprint(function)
        paths = [self._path(program, item) for item in items]
        there = [_read(path) is not None for path in paths]
        missing = [item for item, old in zip(items, there, strict=True) if not old]
        fresh = self.engine.map(function, missing)
        for item, path, old in zip(items, paths, there, strict=True):
            content = _read(path) if old else None
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
        key = hashlib.sha256(f"{program} {joblib.hash(item, 'sha1')}".encode()).hexdigest()
        return self.folder / key[:2] / f"{key}.result"

    def _keep(self, path: Path, result: Any) -> None:
        content = pickle.dumps(result, protocol=5)
        path.parent.mkdir(mode=0o700, exist_ok=True)
        write_bytes(path, _MAGIC + hashlib.sha256(content).digest() + content).chmod(0o600)
        self.done += 1


def _read(path: Path) -> bytes | None:
    """Return the pickled result, or None if there is none that can be believed."""
    try:
        if not (is_private(path.parent) and is_private(path)):
            return None
        whole = path.read_bytes()
    except OSError:
        return None
    start = len(_MAGIC) + _DIGEST
    content = whole[start:]
    good = whole[:start] == _MAGIC + hashlib.sha256(content).digest()
    return content if good else None
