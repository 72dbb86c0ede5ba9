"""Where a robot file is: a path, or a shipped robot's name; and which sidecar belongs to it."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

from identifiability.foundation.errors import RobotError, near_match

# Which sidecar belongs to a robot file: its own (arm.xml.toml), or one for its stem (arm.toml).
#
# Robot files that differ in their ending alone read one sidecar, unless one of them has its own.


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


# Where a robot file is: a path, or a shipped robot's name.


def shipped_folder() -> Path:
    """Return the folder of the shipped robots (inside a wheel, or beside a checkout)."""
    inside = Path(str(resources.files("identifiability"))) / "models"
    return inside if inside.is_dir() else inside.parent.parent / "models"


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    return sorted(p.parent.name for p in shipped_folder().glob("*/robot.[xu]*"))


def locate_robot(source: str | Path) -> Path:
    """Return the robot file that a path or a shipped name stands for.

    Raises
    ------
    RobotError
    """
    path = Path(source)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise RobotError(f"'{source}' cannot be a robot file: {error.strerror}.") from None
    folder = shipped_folder() / str(source)
    for name in ("robot.xml", "robot.urdf"):
        if str(source) in shipped_robots() and (folder / name).is_file():
            return folder / name
    if path.is_dir():
        raise RobotError(f"{path} is a folder; give the robot file (MJCF or URDF) in it.")
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )
