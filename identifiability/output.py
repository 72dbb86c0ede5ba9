"""Write results so that a reader never finds half a file."""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

from identifiability.errors import OutputError


def check_writable(path: str | Path) -> Path:
    """Return the path if a file can be written there; called before a long computation.

    Raises
    ------
    OutputError
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"'{path}' is a folder; give a file name to write to.")
    parent = path.parent
    if not parent.is_dir():
        raise OutputError(f"The folder '{parent}' does not exist; create it or choose another.")
    if not os.access(parent, os.W_OK):
        raise OutputError(f"The folder '{parent}' is not writable; choose another.")
    return path


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
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise OutputError(f"'{path}' cannot be written: {error.strerror}.") from None
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"'{path}' cannot be written: {error.strerror}.") from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return path


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
