"""A folder to begin a study in: robot, sidecar, logs, a case file and a script."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from identifiability.foundation.errors import LogError, OutputError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Strings
from identifiability.foundation.options import Expected, FilePath, checked
from identifiability.foundation.output import check_writable, csv_text, write_together
from identifiability.foundation.presenter import present, presented
from identifiability.foundation.quoting import for_toml, toml_key
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.reader import check_there
from identifiability.robot import Robot
from identifiability.robot.locate import find_sidecar, locate_robot, shipped_robots
from identifiability.robot.table import write_table
from identifiability.workflows.case_file import FILE
from identifiability.workflows.inspect import template_frame

# `new_study`: copy or write the files of a new study.


#: Default robot of a study: the arm whose logs are shipped.
SHIPPED = "six-dof-arm"

#: Logs that a study has in its script.
RUNS = ("run1.csv", "run2.csv", "run3.csv")

#: Settings of a case by which its robot is read.
Recorded = Mapping[Literal["base", "time_unit", "angles", "torque_side"], str]

#: In the name of a log: the robot carries a load.
_LOADED = re.compile(
    r"(?i)(?<!no[_ -])(?<!without[_ -])(?<![a-z])(?:(?:pay)?load(?:ed)?|tool|weight)(?![a-z])"
)

#: Logs whose sidecar must say more, by the key of the sentence that refuses them.
_ASKED = {"columns.gain": "currents", "columns.servo": "commands"}


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
    fitted : tuple of str
        Logs that its case fits, seen from the folder.
    held_back : str or None
        The held-out log.
    has_logs : bool
        Whether these are there.
    loaded : tuple of str
        Logs that carry a load, by their names.
    notes : tuple of str
        Facts that a table of the robot, or the sidecar, lacks.
    """

    folder: Path
    robot: str
    written: tuple[Path, ...]
    fitted: Strings
    held_back: str | None
    has_logs: bool
    loaded: Strings = ()
    notes: Strings = ()

    @property
    def next_line(self) -> str:
        """The first command to type."""
        return present(self, "next_line")

    @property
    @presented
    def statement(self) -> str:
        """The files of the study, in one sentence."""
        raise NotImplementedError


@checked
def new_study(
    folder: FilePath,
    robot: Annotated[str | Path, Expected("a robot file, or a shipped robot's name")] = SHIPPED,
    logs: Annotated[Sequence[str | Path], Expected("a list of log files")] = (),
    recorded: Recorded | None = None,
) -> Study:
    """Make a folder to begin a study in.

    Parameters
    ----------
    folder : str or Path
        Folder to make: new, or empty.
    robot : str or Path
        MJCF or URDF file, copied with its sidecar; a table of Denavit and Hartenberg (TOML),
        converted to URDF and sidecar; or the name of a shipped robot, such as 3-rps.
    logs : sequence of path, optional
        Your own logs, which stay where they are: the case file names them. The last of several
        is held out. Logs whose name tells of a load or tool are those of `payload`.
    recorded : mapping, optional
        Settings of the case file, as of `Robot.load`: ``{"base": "fixed"}``.

    Raises
    ------
    OutputError
        If something is in the folder.
    LogError
        If a log is not there.
    RobotError
        If the robot cannot be read.
    """
    folder = Path(folder)
    if str(robot).lower().endswith(".toml"):
        with TemporaryDirectory() as made:
            notes = write_table(robot, Path(made) / "robot.urdf")
            made_study = new_study(folder, Path(made) / "robot.urdf", logs, recorded)
            return replace(made_study, notes=notes)
    source = locate_robot(robot)
    for log in logs:
        check_there(Path(log))
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OutputError(Finding("study.there", folder))
    check_writable(folder / source.name if folder.is_dir() else folder)
    shipped = str(robot) in shipped_robots()
    files = _shipped(source) if shipped else {source.name: source}
    sidecar = find_sidecar(source) or source.with_suffix(".toml")
    if sidecar.is_file():
        files[sidecar.name] = sidecar
    names = [os.path.relpath(log, folder) for log in logs] or list(RUNS)
    loaded = [name for name in names if _LOADED.search(Path(name).stem)]
    alone = [name for name in names if name not in loaded]
    if not alone:
        alone, loaded = names, []
    fitted, held_back = (alone[:-1], alone[-1]) if len(alone) > 1 else (alone, None)
    has_logs = bool(logs) or all(name in files for name in names)
    settings: Mapping[Any, Any] = recorded or {}
    known = Robot.load(source, **settings)
    case = _facts_of_case(known, source.name, fitted, held_back, loaded)
    stated = [f"{key} = {for_toml(x)}" for key, x in settings.items()]
    case["SETTINGS"] = "\n".join(["[settings]" if stated else "# [settings]", *stated])
    texts = {"study.py": _filled("study.py", {}), FILE: _filled(FILE, case)}
    if not has_logs or (logs and sidecar.name not in files):
        if not has_logs:
            texts["template.csv"] = csv_text(template_frame(known))
        if sidecar.name not in files:
            texts[sidecar.name] = _filled("sidecar.toml", _facts(known))
    whole = {name: path.read_bytes() for name, path in files.items()}
    whole |= {name: text.encode() for name, text in texts.items()}
    asked = _find_asked(known, logs)
    if asked:
        whole[sidecar.name] += _filled(f"{asked}.toml", _facts(known)).encode()
    new = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        write_together([(folder / name, content) for name, content in whole.items()])
    except BaseException:  # a full disk, Ctrl-C: half a study would be in the way of the next one
        if new:
            folder.rmdir()
        raise
    written = tuple(folder / name for name in whole)
    return Study(
        folder=folder,
        robot=source.name,
        written=written,
        fitted=tuple(fitted),
        held_back=held_back,
        loaded=tuple(loaded),
        has_logs=has_logs,
        notes=(phrase("study", asked, file=sidecar.name),) if asked else (),
    )


def _find_asked(known: Robot, logs: Sequence[str | Path]) -> str:
    """Return what the logs hold in place of torque and no number of the sidecar turns into it."""
    for log in logs:
        try:
            Log.read(log, Conventions.of(known))
        except LogError as error:  # the verbs say what else a log lacks
            if error.key in _ASKED:
                return _ASKED[error.key]
    return ""


def _facts_of_case(
    known: Robot,
    robot: str,
    fitted: Sequence[str],
    held_back: str | None,
    loaded: Sequence[str],
) -> dict[str, str]:
    """Return the values of a new case file, as TOML."""
    held_out = [] if held_back is None else [held_back]
    body = max(known.bodies, key=lambda body: known.nominal[f"{body}.m"])
    mass = known.nominal[f"{body}.m"]
    return {
        "ROBOT": for_toml(robot),
        "LOGS": for_toml(list(fitted)),
        "HELD_OUT": for_toml(held_out),
        "LOADED": f"loaded = {for_toml(list(loaded))}" if loaded else '# loaded = ["loaded.csv"]',
        "BODY": toml_key(body),
        "MASS": f"[{0.95 * mass:.2g}, {1.05 * mass:.2g}]",
    }


def _shipped(source: Path) -> dict[str, Path]:
    """Return the files of a shipped robot by name: robot, ladder, trajectories, logs."""
    beside = [source, *source.parent.glob("ladder.toml"), *source.parent.glob("*.json")]
    logs = sorted(source.parent.glob("logs/*.csv"))
    return {path.name: path for path in [*beside, *logs]}


def _filled(name: str, told: dict[str, str]) -> str:
    text = resources.files(__package__).joinpath(f"files/{name}.txt").read_text(encoding="utf-8")
    return Template(text).substitute(told)


def _facts(robot: Robot) -> dict[str, str]:
    """Return the values of a new sidecar, as TOML."""
    first = next(iter(robot.joints), "joint")
    slides = first in robot.motor_joints and robot.is_prismatic(robot.dof_index(first))
    return {
        "NAME": for_toml(robot.title),
        "ACTUATED": for_toml(robot.joints),
        "FIRST": toml_key(first),
        "JOINTS": ", ".join(f"{toml_key(joint)} = …" for joint in robot.joints),
        "RANGE": "[-0.1, 0.1]" if slides else "[-1, 1]",
        "SPEED": "0.1" if slides else "1",
    }
