"""Lines for the terminal that go on from a result: its robot and logs, read as they were read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields
from shlex import quote

from identifiability.foundation.result import Result
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import SettledPreparation
from identifiability.regression.reduction import LadderSource, ladder_path
from identifiability.robot import Robot
from identifiability.robot.locate import find_sidecar, shipped_folder

#: What of a preparation an option says; others are only said from Python.
OPTIONS = ("derivatives", "cutoff", "decimate")


def source_name(robot: Robot) -> str:
    """Return how a command names the robot, with what was said of it by options.

    It is the path that was given, or the name of a shipped robot.
    """
    shipped = robot.path.parent.parent == shipped_folder()
    name = robot.path.parent.name if shipped else quote(str(robot.path))
    other = robot.sidecar is not None and robot.sidecar != find_sidecar(robot.path)
    sidecar = [f"--sidecar {quote(str(robot.sidecar))}"] if other and robot.sidecar else []
    sidecar += [] if robot.base_option is None else [f"--set base={robot.base_option}"]
    locks = (f"{joint}={robot.locked[joint]:g}" for joint in robot.lock_option)
    return " ".join([name, *sidecar, *(f"--lock {quote(lock)}" for lock in locks)])


def export_line(robot: Robot, result: str = "{file}") -> tuple[str, str]:
    """Return what a fitted robot is exported for, and how: never over the file that it has."""
    name = "refitted.xml" if robot.path.name == "fitted.xml" else "fitted.xml"
    line = f"identifiability export {source_name(robot)} {result} --out {name}"
    return "Take the robot into a simulator:", line


def reading_options(robot: Robot) -> str:
    """Return the options by which a command reads logs as they were read; begins with a space."""
    own, said = robot.said, robot.said.columns.items()  # the sidecar is read again
    words = [f"--map {quote('='.join(x))}" for x in robot.columns.rules if x not in said]
    words += [f"--set time_unit={robot.time_unit}"] * (robot.time_unit != (own.time.unit or ""))
    words += [f"--set angles={robot.angles}"] * (robot.angles != own.angles)
    return "".join(f" {word}" for word in words)


def preparing_options(how: object) -> str:
    """Return the options by which logs are prepared as was asked; begins with a space."""
    if not isinstance(how, Preparation):
        return ""
    usual = {f.name: f.default for f in fields(Preparation)}
    if isinstance(how, SettledPreparation) and how.band is not None and how.band.reason:
        usual["cutoff"] = how.cutoff  # chosen, and chosen again by the same logs
    asked = {name: getattr(how, name) for name in OPTIONS if getattr(how, name) != usual[name]}
    texts = {n: x if isinstance(x, str) else f"{x:g}" for n, x in asked.items()}
    return "".join(f" --set {name}={text}" for name, text in texts.items())


def given_paths(logs: Iterable[Log | Dataset]) -> tuple[str, ...]:
    """Return the paths of logs as they were given; of those in memory what they are called."""
    return tuple(log.path or log.name for log in logs)


def name_logs(robot: Robot, paths: Iterable[str], option: str = "", how: object = None) -> str:
    """Return the logs of a command, each once, and how they are read.

    Parameters
    ----------
    robot : Robot
    paths : iterable of str
    option : str
        Stands before each of them.
    how : Preparation, optional
        What was asked for.
    """
    files = [f"{option} {quote(path)}".strip() for path in dict.fromkeys(paths)]
    return f"{' '.join(files)}{reading_options(robot)}{preparing_options(how)}"


def compare_line(robot: Robot, paths: Iterable[str], how: object) -> tuple[str, str]:
    """Return what logs are compared for, and how: the first with all others."""
    files = [*dict.fromkeys(paths)]
    more = "".join(f" --after {quote(path)}" for path in files[2:])
    two = name_logs(robot, files[:2], how=how)
    line = f"identifiability compare {source_name(robot)} {two}{more}"
    return "See what differs between the logs:", line


def held_back(samples: Sequence[Dataset], fitted: Sequence[Dataset] = ()) -> str:
    """Return the logs that were held back, as options; begins with a space.

    A part of a fitted log is none: it is set aside again by itself.
    """
    own = given_paths(fitted)
    paths = (path for path in dict.fromkeys(given_paths(samples)) if path not in own)
    return "".join(f" --validate {quote(path)}" for path in paths)


def on_file(result: Result, kind: str, name: str, make: str, use: str) -> str:
    """Return a command on a file of a result; what writes it comes before, where nobody has.

    Parameters
    ----------
    result : Result
    kind : {"json", "model"}
    name : str
        What the file is called if it is yet to be written.
    make, use : str
        Commands that end in the option and name of the file, and that have ``{file}`` for it.
    """
    there = result.written(kind)
    line = use.replace("{file}", quote(there or name))
    return line if there else f"{make} {name} && {line}"


def ladder_option(robot: Robot, source: LadderSource | None) -> str:
    """Return the ladder that was given, as an option; begins with a space."""
    if source is None or not source.origin.lower().endswith(".toml"):
        return ""
    given = str(ladder_path(robot)) != source.origin
    return f" --ladder {quote(source.origin)}" if given else ""
