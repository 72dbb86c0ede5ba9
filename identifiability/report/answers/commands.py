"""Lines for the terminal that go on from a result: its robot and logs, read as they were read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from hashlib import sha256

from identifiability.foundation.names import find_patterns
from identifiability.foundation.quoting import for_shell, option_for_shell, path_for_shell
from identifiability.foundation.result import Result
from identifiability.foundation.wording import OF_PREPARATION
from identifiability.logs.formats.lerobot import join_episodes
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import CommonPreparation
from identifiability.regression.reduction import LadderSource, ladder_path
from identifiability.robot import Robot
from identifiability.robot.locate import find_sidecar, shipped_folder
from identifiability.workflows.predict import Fit
from identifiability.workflows.provenance import given_paths


def robot_word(robot: Robot) -> str:
    """Return the robot as one word of a command: its path, or the name of a shipped robot."""
    shipped = robot.path.parent.parent == shipped_folder()
    if shipped:
        return for_shell(robot.path.parent.name)
    return path_for_shell(robot.path)


def _locks(robot: Robot) -> list[str]:
    """Return the values of ``--lock`` that lock joints as they were; one for joints alike."""
    at = {joint: f"{robot.locked[joint]:g}" for joint in robot.lock_option}
    out: list[str] = []
    for position in dict.fromkeys(at.values()):
        own = [joint for joint in at if at[joint] == position]
        others = [joint for joint in (*robot.home_table, *robot.locked) if joint not in own]
        out += [f"{text}={position}" for text in find_patterns(own, others)]
    return out


def source_name(robot: Robot) -> str:
    """Return the robot of a command with its sidecar, base and locks as options."""
    words = [robot_word(robot)]
    if robot.sidecar is not None and robot.sidecar != find_sidecar(robot.path):
        words.append(f"--sidecar {path_for_shell(robot.sidecar)}")
    if robot.base_option is not None:
        words.append(f"--set base={robot.base_option}")
    words += [option_for_shell("--lock", lock) for lock in _locks(robot)]
    return " ".join(words)


def export_line(robot: Robot, result: str) -> str:
    """Return the line that exports a fitted robot, and never over the robot's file.

    Parameters
    ----------
    robot : Robot
    result : str
        JSON of the result, as a word of a shell.
    """
    name = "refitted.xml" if robot.path.name == "fitted.xml" else "fitted.xml"
    return f"export {source_name(robot)} {result} --out {name}"


def reading_options(robot: Robot) -> str:
    """Return the options by which a command reads logs in the same way; begins with a space."""
    own, said = robot.said, robot.said.columns.items()  # the sidecar is read again
    rules = [rule for rule in robot.columns.rules if rule not in said]
    words = [option_for_shell("--map", "=".join(rule)) for rule in rules]
    words += [f"--set time_unit={robot.time_unit}"] * (robot.time_unit != (own.time.unit or ""))
    words += [f"--set angles={robot.angles}"] * (robot.angles != own.angles)
    side = robot.torque.side
    if isinstance(side, str) and side != own.torque.side:
        words.append(f"--set torque_side={side}")
    return "".join(f" {word}" for word in words)


def preparing_options(how: object) -> str:
    """Return the options of the requested preparation of logs; begins with a space."""
    if not isinstance(how, Preparation):
        return ""
    usual = {f.name: f.default for f in fields(Preparation)}
    if isinstance(how, CommonPreparation) and how.band is not None and how.band.reason:
        usual["cutoff"] = how.cutoff  # chosen, and chosen again by the same logs
    asked = {
        name: getattr(how, name) for name in OF_PREPARATION if getattr(how, name) != usual[name]
    }
    texts = {n: x if isinstance(x, str) else f"{x:g}" for n, x in asked.items()}
    return "".join(f" --set {name}={text}" for name, text in texts.items())


def name_logs(robot: Robot, paths: Iterable[str], option: str = "", how: object = None) -> str:
    """Return the logs of a command, each once, and how they are read.

    Parameters
    ----------
    robot : Robot
    paths : iterable of str
    option : str
        Text in front of each of them.
    how : Preparation, optional
        The requested preparation.
    """
    every = join_episodes(dict.fromkeys(paths))
    files = [f"{option} {path_for_shell(path)}".strip() for path in every]
    return f"{' '.join(files)}{reading_options(robot)}{preparing_options(how)}"


def compare_line(robot: Robot, paths: Iterable[str], how: object, ladder: str = "") -> str:
    """Return the line that compares the first log with all others.

    `ladder` is the option that names the model, as `ladder_option` writes it.
    """
    files = [*dict.fromkeys(paths)]
    more = "".join(f" --after {path_for_shell(path)}" for path in join_episodes(files[2:]))
    first = path_for_shell(files[0])
    second = name_logs(robot, files[1:2], how=how)
    return f"compare {source_name(robot)} {first} {second}{more}{ladder}"


def held_back(samples: Sequence[Dataset], fitted: Sequence[Dataset] = ()) -> str:
    """Return the logs that were held back, as options; begins with a space.

    A part of a fitted log is none: it is set aside again by default.
    """
    own = given_paths(fitted)
    return validate_options(path for path in given_paths(samples) if path not in own)


def validate_options(paths: Iterable[str]) -> str:
    """Return the options that hold logs out, each once; begins with a space."""
    every = join_episodes(dict.fromkeys(paths))
    return "".join(f" --validate {path_for_shell(path)}" for path in every)


def diagnose_lines(fit: Fit) -> list[str]:
    """Return the lines that find the effects that a fitted model lacks, and refit with them.

    They fit the logs of the fit. There are none if it lacks no effect.
    """
    fitted, unseen = fit.sides
    if not (fitted and fit.missing):
        return []
    logs = f"{name_logs(fit.robot, fitted)}{validate_options(unseen)}"
    given = f"{source_name(fit.robot)} {logs}"
    return [
        f"diagnose {given} --out model.toml --report missing.html",
        f"analyze {given} --ladder model.toml --json refit.json",
    ]


def on_file(result: Result, kind: str, name: str, make: str, use: Callable[[str], str]) -> str:
    """Return a command on a file of a result, after the command that writes it if there is none.

    Parameters
    ----------
    result : Result
    kind : {"json", "model"}
    name : str
        Name of the file if it is yet to be written.
    make : str
        Command that writes it; its last word is the option for the file.
    use : callable
        Takes the file as a word of a shell and returns the command.
    """
    there = result.written(kind)
    line = use(path_for_shell(there or name))
    if there:
        return line
    return f"{make} {name} && identifiability {line}"


def ladder_option(robot: Robot, source: LadderSource | None) -> str:
    """Return the ladder that was given, as an option; begins with a space.

    A ladder that equals the file next to the robot file is found without an option.
    """
    if source is None or source.origin == "default":
        return ""
    if not source.origin.lower().endswith(".toml"):
        return " --ladder missing" if source.origin.endswith("result") else " --ladder ladder"
    beside = ladder_path(robot)
    if beside is not None and sha256(beside.read_bytes()).hexdigest() == source.sha256:
        return ""
    return f" --ladder {path_for_shell(source.origin)}"
