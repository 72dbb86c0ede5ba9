"""Ways to spoil a result of finished work that a folder keeps."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hostile.case import Runs


def _cut(path: Path, _root: Path, rng: np.random.Generator) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: rng.integers(len(whole))])


def _turn(path: Path, _root: Path, rng: np.random.Generator) -> None:
    whole = bytearray(path.read_bytes())
    whole[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
    path.write_bytes(whole)


def _older(path: Path, _root: Path, _rng: np.random.Generator) -> None:
    path.write_bytes(b"identifiability result 1\n" + b"\0" * 32 + pickle.dumps(Runs()))


def _program(path: Path, _root: Path, _rng: np.random.Generator) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[:57] + pickle.dumps(Runs()))


def _swapped(path: Path, root: Path, _rng: np.random.Generator) -> None:
    others = [p for p in sorted((root / "work" / "kept").rglob("*.result")) if p != path]
    if others:
        path.write_bytes(others[0].read_bytes())


def _key(_path: Path, root: Path, _rng: np.random.Generator) -> None:
    shutil.rmtree(root / "state")
    (root / "state").mkdir(mode=0o700)


def _pipe(path: Path, _root: Path, _rng: np.random.Generator) -> None:
    path.unlink()
    os.mkfifo(path, 0o600)


def _link(path: Path, _root: Path, _rng: np.random.Generator) -> None:
    path.unlink()
    path.symlink_to("/dev/zero")


def _half_written(path: Path, _root: Path, _rng: np.random.Generator) -> None:
    from identifiability.foundation.output import host_mark  # noqa: PLC0415

    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    path.with_name(f".{host_mark()}-{ended.pid}-0123456789ab.tmp").write_bytes(b"half")
    path.unlink()


#: What is done to one kept result.
SPOILERS: dict[str, Callable[[Path, Path, np.random.Generator], None]] = {
    "cut": _cut,
    "a bit turned": _turn,
    "of an older version, a program": _older,
    "a program under a good signature": _program,
    "another item's": _swapped,
    "signed by somebody else": _key,
    "a pipe": _pipe,
    "a link to /dev/zero": _link,
    "half written by a program that was killed": _half_written,
}
