"""Which sidecar belongs to a robot file: its own (arm.xml.toml), or one for its stem (arm.toml).

Robot files that differ in their ending alone read one sidecar, unless one of them has its own.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

#: Endings of robot files.
ENDINGS = (".urdf", ".xml", ".mjcf")


def own_sidecar(path: Path) -> Path:
    """Return where the sidecar is that belongs to one robot file alone."""
    return path.with_name(f"{path.name}.toml")


def find_sidecar(path: Path) -> Path | None:
    """Return the sidecar that a robot file is read with, if there is one."""
    places = (own_sidecar(path), path.with_suffix(".toml"))
    return next((place for place in places if place.is_file()), None)


def place_sidecar(path: Path, text: str | None, taken: Path | None = None) -> Path:
    """Return where to write a sidecar so that it changes what no other robot file says.

    Parameters
    ----------
    path : Path
        The robot file that is written.
    text : str or None
        Its sidecar; None if it needs none.
    taken : Path, optional
        A sidecar that must not be replaced.
    """
    own, shared = own_sidecar(path), path.with_suffix(".toml")
    others = (path.with_suffix(ending) for ending in ENDINGS if ending != path.suffix.lower())
    reads = any(p.is_file() and not own_sidecar(p).is_file() for p in others)
    if own.exists() or (taken is not None and taken.resolve() == shared.resolve()):
        return own
    if not reads:
        return shared
    there = tomllib.loads(shared.read_text(encoding="utf-8-sig")) if shared.is_file() else {}
    return shared if there == tomllib.loads(text or "") else own
