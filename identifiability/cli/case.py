"""The case file of a command: which words it replaces, and lines to type without these words."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identifiability.foundation.quoting import option_for_shell, path_for_shell
from identifiability.foundation.values import Fields

if TYPE_CHECKING:
    from identifiability.workflows.case_file import CaseFile

#: The case file that the command reads its robot, logs and settings from.
CASE: ContextVar[CaseFile | None] = ContextVar("CASE", default=None)

#: The commands by their names.
COMMANDS: ContextVar[Mapping[str, Any]] = ContextVar("COMMANDS")

#: Files that a verb writes. A line may name others than the case does.
WRITTEN = ("json", "out")


def defaults_of_case(case: CaseFile, verb: str, *, has_logs: bool) -> Fields:
    """Return the values of a verb's arguments, and of its files, that a case states.

    Parameters
    ----------
    case : CaseFile
    verb : str
    has_logs : bool
        Whether logs were typed, which replace all logs of the case.
    """
    held_out = [path for path in case.held_out if path != "none"]
    result = case.place(case.entry.result)
    said: Fields = {"robot": case.robot, "result": result}
    if verb == "analyze":
        said |= {"json": result}
    if verb == "export":
        said["out"] = case.place(f"fitted{Path(case.robot).suffix}")
    if verb == "excite":
        said |= {"out": case.place("next.json"), "start_from": case.logs}
    if verb == "simulate":
        planned = case.place("next.json")
        motion = planned if Path(planned).is_file() else "random"
        said |= {"motion": motion, "out": case.place("simulated.csv")}
    if has_logs:
        return said
    if verb == "payload":
        loaded = {"logs": case.loaded, "without": case.logs}
        return said | loaded if case.loaded else said
    if verb == "compare":
        for name, paths in (("before", case.logs), ("after", held_out)):
            if paths:
                said |= {name: paths[0], f"more_{name}": paths[1:]}
        return said
    logs = held_out or case.logs if verb == "predict" else case.logs
    validate = held_out if verb in ("export", "inspect") else case.held_out
    return said | {"logs": logs, "validate": validate}


def shorten_line(line: str) -> str:
    """Return a line to type without words that the case file of the command states.

    Parameters
    ----------
    line : str
        One command, or several with ``&&`` between them.
    """
    case = CASE.get()
    if case is None or "$'" in line:  # Python does not read this kind of quotes
        return line
    parts = line.split(" && ")
    try:
        return " && ".join(_shorten_command(case, p, alone=len(parts) == 1) for p in parts)
    except ValueError:  # a path holds the sign between commands
        return line


def _shorten_command(case: CaseFile, line: str, *, alone: bool) -> str:
    """Return one command without words that a case states; the same if its inputs differ.

    Parameters
    ----------
    case : CaseFile
    line : str
    alone : bool
        Whether no later command reads its files, so that they may have the names of the case.
    """
    _, verb, *words = shlex.split(line)
    command = COMMANDS.get()[verb]
    typed, _, _ = command.make_parser(command.context_class(command)).parse_args(args=words)
    said = {"sidecar": case.sidecar, "lock": case.entry.lock}
    said |= defaults_of_case(case, verb, has_logs=False)
    names = [p.name for p in command.params]
    inputs = {name: x for name, x in said.items() if name in names and name not in WRITTEN}
    if any(_as_words(typed.get(name)) != _as_words(x) for name, x in inputs.items()):
        return line
    placed = {p.name for p in command.params if p.param_type_name == "argument"} - set(inputs)
    if any(_as_words(typed.get(name)) for name in placed):  # words that the case does not state
        return line
    given = case.settings.items()
    settings = {f"{key}={x if isinstance(x, str) else f'{x:g}'}" for key, x in given}
    rest = {name: x for name, x in typed.items() if name not in inputs}
    rest["set"] = [text for text in typed.get("set") or () if text not in settings]
    for name in WRITTEN:
        if name in said and (alone or _as_words(typed.get(name)) == _as_words(said[name])):
            rest.pop(name, None)
    folder = [] if case.folder == Path() else [path_for_shell(case.folder)]
    return " ".join(["identifiability", verb, *folder, *_options(command.params, rest)])


def _as_words(value: Any) -> list[str]:
    """Return the value of an option as it is typed: paths in one form, and no value as no word."""
    words = value if isinstance(value, (list, tuple)) else [value]
    return [str(Path(word)) for word in words if isinstance(word, str) and word != "none"]


def _options(params: Iterable[Any], typed: Mapping[str, Any]) -> list[str]:
    """Return options as words of a shell.

    Parameters
    ----------
    params : iterable of Parameter
        Of the command.
    typed : mapping
        Value of each option by its name.
    """
    words = []
    for param in params:
        value = typed.get(param.name)
        if value is True:
            words.append(param.opts[0])
        values = value if isinstance(value, (list, tuple)) else [value]
        texts = [x for x in values if isinstance(x, str)]
        words += [option_for_shell(param.opts[0], text) for text in texts]
    return words
