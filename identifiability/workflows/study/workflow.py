"""`new_study`: copy or write what a study begins with."""

from __future__ import annotations

import json
import shutil
from importlib import resources
from pathlib import Path
from string import Template
from typing import Annotated

from identifiability.foundation.errors import OutputError
from identifiability.foundation.options import Expected, FilePath, checked
from identifiability.foundation.output import check_writable, csv_text, write_text
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.locate import locate_robot, shipped_robots
from identifiability.workflows.inspect.machine import template_frame

#: What a study begins with where nothing is said: the arm whose logs are shipped.
SHIPPED = "six-dof-arm"

#: Logs that a study has, in its script and its Makefile.
RUNS = ("run1.csv", "run2.csv", "run3.csv")


@frozen(kw_only=True)
class Study:
    """A folder to begin a study in.

    Attributes
    ----------
    folder : Path
    robot : str
        Name of the robot file in it.
    written : tuple of Path
        Its files.
    has_logs : bool
        Whether there are logs to begin with.
    """

    folder: Path
    robot: str
    written: tuple[Path, ...]
    has_logs: bool

    @property
    def next_line(self) -> str:
        """The first command to type."""
        if self.has_logs:
            *fitted, held = RUNS
            given = f"{self.robot} {' '.join(fitted)} --validate {held} --report report.html"
            return f"cd {self.folder} && identifiability analyze {given}"
        return f"cd {self.folder} && identifiability inspect {self.robot}"

    @property
    def statement(self) -> str:
        """What is there, and what to do next."""
        if self.has_logs:
            told = "with simulated logs, so that everything in it runs at once"
        else:
            told = (
                f"without logs: record {', '.join(RUNS)} with the columns of template.csv, or name "
                "your own in study.py and Makefile"
            )
        return f"{self.folder} is a study of {self.robot}, {told}. Begin with: {self.next_line}"


@checked
def new_study(
    folder: FilePath,
    robot: Annotated[str | Path, Expected("a robot file, or a shipped robot's name")] = SHIPPED,
) -> Study:
    """Make a folder to begin a study in.

    Parameters
    ----------
    folder : str or Path
        New, or empty.
    robot : str or Path
        MJCF or URDF file, which is copied with its sidecar, or a shipped robot's name.

    Raises
    ------
    OutputError
        If something is in the folder.
    RobotError
        If the robot cannot be read.
    """
    folder, source = Path(folder), locate_robot(robot)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(
            f"{folder} is there already and nothing is written over; give a new folder."
        )
    check_writable(folder / source.name if folder.is_dir() else folder)
    shipped = str(robot) in shipped_robots()
    files = _shipped(source) if shipped else {source.name: source}
    sidecar = source.with_suffix(".toml")
    if sidecar.is_file():
        files[sidecar.name] = sidecar
    has_logs = all(name in files for name in RUNS)
    told = {"ROBOT": source.name, "SIDECAR": sidecar.name}
    texts = {
        "study.py": _filled("study.py", told),
        "Makefile": _filled("Makefile", told),
    }
    if not has_logs:
        known = Robot.load(source)
        texts["template.csv"] = csv_text(template_frame(known))
        if sidecar.name not in files:
            texts[sidecar.name] = _filled("sidecar.toml", {**told, **_facts(known)})
    folder.mkdir(parents=True, exist_ok=True)
    for name, path in files.items():
        shutil.copyfile(path, folder / name)
    written = [write_text(folder / name, text) for name, text in texts.items()]
    return Study(
        folder=folder,
        robot=source.name,
        written=(*(folder / name for name in files), *written),
        has_logs=has_logs,
    )


def _shipped(source: Path) -> dict[str, Path]:
    """Return the files of a shipped robot by name: robot, ladder, trajectories, logs."""
    beside = [source, *source.parent.glob("ladder.toml"), *source.parent.glob("*.json")]
    return {path.name: path for path in [*beside, *sorted(source.parent.glob("logs/*.csv"))]}


def _filled(name: str, told: dict[str, str]) -> str:
    text = resources.files(__package__).joinpath(f"files/{name}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(told)


def _facts(robot: Robot) -> dict[str, str]:
    """Return what a sidecar begins with."""
    return {
        "NAME": json.dumps(robot.title, ensure_ascii=False),
        "ACTUATED": json.dumps(list(robot.joints), ensure_ascii=False),
        "FIRST": next(iter(robot.joints), "joint"),
    }
