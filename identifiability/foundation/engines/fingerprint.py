"""Digests of program text, by which two runs, or two machines, know that they compute the same."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from importlib import metadata, util
from pathlib import Path
from typing import Any

import cloudpickle
import joblib

#: Packages whose version may change a result in its last bits.
NUMERICS = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee")


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a digest of a function: its name, bound arguments, program text and numerics."""
    parts = [f"{name} {find_version(name)}" for name in NUMERICS]
    while isinstance(function, partial):
        parts.append(str(joblib.hash((function.args, function.keywords), "sha1")))
        function = function.func
    module, name = _module(function), getattr(function, "__qualname__", "")
    # Of a folder without __init__, the file.
    text = source_digest(module.partition(".")[0]) or source_digest(module)
    parts += [module, name, text, source_digest("identifiability")]
    if module == "__main__" or getattr(sys.modules.get(module), name, None) is not function:
        # A notebook's, a lambda's or an object's text and values are in no file.
        parts.append(hashlib.sha256(cloudpickle.dumps(function)).hexdigest())
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def root_module(function: Callable[..., Any]) -> tuple[str, Path | None]:
    """Return the package or module at whose root a function lives, and its file if it has one."""
    while isinstance(function, partial):
        function = function.func
    name = _module(function).partition(".")[0]
    file = getattr(sys.modules.get(name), "__file__", None)
    return name, None if file is None else Path(file)


def _module(function: Callable[..., Any]) -> str:
    """Return the module of a function; ufuncs of NumPy 2.0 know that of their type only."""
    return str(getattr(function, "__module__", None) or type(function).__module__)


@cache
def source_digest(name: str) -> str:
    """Return a digest of the program text of a package or module; empty if it has no files."""
    file = getattr(sys.modules.get(name), "__file__", None)
    if file is None and name not in sys.modules:
        with suppress(ImportError, ValueError):
            file = getattr(util.find_spec(name), "origin", None)
    if file is None:
        return ""
    path = Path(file)
    files = sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]
    found = hashlib.sha256()
    try:
        for f in files:
            found.update(f"{f.relative_to(path.parent).as_posix()}\n".encode() + f.read_bytes())
    except OSError:  # inside an archive
        return ""
    return found.hexdigest()


@cache
def find_version(name: str) -> str:
    """Return the version of an installed package; empty if there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""
