"""Robot files that differ in their ending alone read one sidecar, so it must fit all of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

from identifiability.foundation.errors import OutputError

#: Endings of robot files.
ENDINGS = (".urdf", ".xml", ".mjcf")


def check_shared(path: Path, text: str) -> None:
    """Refuse a sidecar that would change what another robot file of the same stem says.

    Parameters
    ----------
    path : Path
        The robot file that is written.
    text : str
        Its sidecar; empty if it has none.

    Raises
    ------
    OutputError
    """
    beside = path.with_suffix(".toml")
    others = [path.with_suffix(e) for e in ENDINGS if e != path.suffix.lower()]
    other = next((p for p in others if p.is_file()), None)
    if other is None:
        return
    there = tomllib.loads(beside.read_text(encoding="utf-8-sig")) if beside.is_file() else {}
    if there != tomllib.loads(text):
        raise OutputError(
            f"'{beside}' would be the sidecar of '{other}' too, which is there and needs another; "
            f"give '{path.name}' a name that differs in more than its ending, or move '{other}' "
            "away."
        )
