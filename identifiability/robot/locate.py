"""Where a robot file is: a path, or a shipped robot's name."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from identifiability.foundation.errors import RobotError, near_match
from identifiability.foundation.output import kept_aside


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
    left = kept_aside(path)
    if left is not None:
        raise RobotError(
            f"There is no robot file '{source}': a write of it was interrupted. Its old content is "
            f"'{left}'; write it again, or rename that."
        )
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )
