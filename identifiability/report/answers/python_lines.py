"""Lines for the terminal as calls in Python, for notebooks."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from identifiability.foundation.answers import Answer
from identifiability.foundation.wording import (
    EFFECT,
    KEYWORDS,
    OF_PREPARATION,
    OF_ROBOT,
    SWITCHES,
    WRITERS,
    quoted,
)

#: Options that name files, also where a name looks like a number.
FILES = ("validate", "without", "start_from", "before", "after", "ladder", "limits", "model")

#: Options that name logs, and the variable of each in Python.
LOGS = {"validate": "unseen", "without": "unseen", "start_from": "logs", "after": ""}

#: Verbs that take several logs as one argument.
OF_LOGS = ("analyze", "prune", "diagnose", "calibrate", "inspect")

#: Method that writes the file of `--out`, by the verb.
OUT = {"diagnose": "write_model", "prune": "write_model", "excite": "write_motion"}

#: Name of a result that is no file.
RESULT = "the result"

#: Variable that a verb's result gets.
VARIABLES = {
    "diagnose": "missing",
    "prune": "pruned",
    "excite": "motion",
    "predict": "predicted",
    "payload": "load",
    "export": "exported",
}


def in_python(answer: Answer) -> Answer:
    """Return an answer whose lines for the terminal are calls in Python."""
    lines = tuple((purpose, python_lines(line)) for purpose, line in answer.commands)
    return replace(answer, commands=lines)


def python_lines(line: str) -> str:
    """Return the calls in Python that do what a line of the terminal does, one a line.

    Parameters
    ----------
    line : str
        ``identifiability VERB …``, several joined by ``&&``. Other lines are returned as they are.
    """
    calls = _split_commands(line)
    if any(words[:1] != ["identifiability"] for words in calls):
        return line
    return "\n".join(_call(words[1], *_split(words[2:])) for words in calls)


def lines_in_memory(lines: Sequence[str], verb: str) -> list[str]:
    """Return lines as calls in Python that use variables, if one names a log that is no file.

    If only the result is no file, the lines that do not name it stay as they are.

    Parameters
    ----------
    lines : sequence of str
    verb : str
        The verb of the result at hand. It is not run again: a variable holds the result.
    """
    every = [_read_calls(line) for line in lines]
    commands = [one for calls in every for one in calls]
    mixed = not any(_names_memory(given, options) for _, given, options in commands)
    shown = []
    for line, calls in zip(lines, every, strict=True):
        if mixed and not any(RESULT in given for _, given, _ in calls):
            shown.append(line)
            continue
        own, _, options = calls[0]
        again = len(calls) > 1 and own == verb
        if own == verb == "diagnose" and "next" in options:
            shown.append("\n".join(_next_motion(options)))
            continue
        told = [_call(*_with_variables(*one)) for one in calls[again:]]
        verbs = ", ".join(dict.fromkeys(one for one, *_ in calls[again:]))
        shown.append("\n".join([f"from identifiability import {verbs}", *told]))
    return shown


def _read_calls(line: str) -> list[tuple[str, list[str], dict[str, list[str]]]]:
    """Return the verb, the arguments and the options of each command of a line."""
    return [(words[1], *_split(words[2:])) for words in _split_commands(line)]


def _split_commands(line: str) -> list[list[str]]:
    """Return the words of each command of a line; names in quotes may hold ``&&``."""
    words = shlex.split(line)
    joined = [k for k, pair in enumerate(pairwise(words)) if pair == ("&&", "identifiability")]
    ends = [-1, *joined, len(words)]
    return [words[before + 1 : end] for before, end in pairwise(ends)]


def _names_memory(given: Sequence[str], options: dict[str, list[str]]) -> bool:
    """Return whether a command names a log or a ladder that is in memory."""
    named = (name for key in (*LOGS, "ladder") for name in options.get(key, ()))
    return any(_in_memory(name) for name in (*given[1:], *named) if name != RESULT)


def _in_memory(name: str) -> bool:
    """Return whether a name is that of an object in memory: no file, and without an ending."""
    place = Path(name.partition(":")[0])
    return name != "none" and not place.suffix and not _is_there(place)


def _is_there(place: Path) -> bool:
    """Return whether a path exists; a name that is too long for a file does not."""
    try:
        return place.exists()
    except OSError:
        return False


class _Variable(str):
    """The name of a variable, which has no quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def _with_variables(
    verb: str, given: Sequence[str], options: dict[str, list[str]]
) -> tuple[str, list[str], dict[str, list[str]]]:
    """Return a command with variables in place of the robot, and of logs and results in memory."""
    usual = {"predict": "unseen", "payload": "loaded"}.get(verb, "")
    words = [_variable(word, usual) for word in given[1:]]
    if verb in OF_LOGS and any(map(_in_memory, given[1:])):
        words = [_Variable("logs")]
    without = {"json"} | ({"out"} if verb in ("diagnose", "prune") else set())
    kept = {key: values for key, values in options.items() if key not in {*OF_ROBOT, *without}}
    for key, values in kept.items():
        if key in (*LOGS, "ladder") or (key == "model" and len(values) == 1):
            named = [_variable(value, LOGS.get(key, "")) for value in values]
            kept[key] = list(dict.fromkeys(named))
    return verb, [_Variable("robot"), *words], kept


def _variable(name: str, usual: str) -> str:
    """Return the variable that holds a log, a model or a result; the name itself if it is a file.

    Parameters
    ----------
    name : str
    usual : str
        Variable of a log; empty for one by the name of the log.
    """
    place = Path(name)
    if name == RESULT:
        return _Variable("result")
    if _in_memory(name):
        return _Variable(usual or re.sub(r"\W|^(?=\d)", "_", name))
    if place.suffix not in (".json", ".toml") or _is_there(place):
        return name
    made = {"model": "missing", "diagnose": "missing", "pruned": "pruned", "prune": "pruned"}
    return _Variable(made.get(place.stem, "result"))


def _call(verb: str, given: Sequence[str], options: dict[str, list[str]]) -> str:
    """Return the call of a verb, and the calls that write its files."""
    robot = _robot(given[:1], options)
    keywords = _keywords(options, verb)
    if verb == "new":
        verb = "new_study"
        arguments = [repr(word) for word in given]
    elif verb in OF_LOGS:
        arguments = [robot, _files(given[1:])]
    else:
        out = [options["out"][0]] if verb == "export" and "out" in options else []
        arguments = [robot, *map(repr, [*given[1:], *out])]
    if verb == "calibrate":
        arguments = [f"analyze({', '.join(filter(None, arguments))})"]
    result = VARIABLES.get(verb, "result")
    call = f"{result} = {verb}({', '.join(filter(None, [*arguments, *keywords]))})"
    return "\n".join([call, *_writers(verb, result, options), *_next_motion(options)])


def _next_motion(options: dict[str, list[str]]) -> list[str]:
    """Return the calls that find the motion of `--next` of a diagnosis."""
    return [
        line
        for path in options.get("next", ())
        for line in (
            "from identifiability.workflows.excite import find_next",
            "motion = find_next(missing)",
            f"motion.to_json({path!r})",
        )
    ]


def _split(words: Sequence[str]) -> tuple[list[str], dict[str, list[str]]]:
    """Return the arguments, and the values of each option; settings are options, too."""
    given: list[str] = []
    options: dict[str, list[str]] = {}
    rest = iter(words)
    for word in rest:
        if not word.startswith("--"):
            given.append(word)
            continue
        option, joined, value = word.removeprefix("--").partition("=")
        name = option.replace("-", "_")
        if not joined:
            value = "True" if name in SWITCHES else next(rest, "")
        if name == "set":
            name, _, value = value.partition("=")
        effects = name == "model" and not value.endswith(".toml")
        options.setdefault(name, []).extend(re.findall(EFFECT, value) if effects else [value])
    return given, options


def _robot(given: Sequence[str], options: dict[str, list[str]]) -> str:
    """Return the robot as an argument: its path, or the call that loads it as it was read."""
    told = []
    for name in OF_ROBOT:
        if name not in options:
            continue
        values = options[name]
        pairs = dict(value.partition("=")[::2] for value in values)
        if name == "map":
            told.append(f"columns={pairs!r}")
        elif name == "lock":
            held = {joint: float(at) for joint, at in pairs.items() if at}
            told.append(f"lock={held or values!r}")
        else:
            told.append(f"{name}={values[0]!r}")
    path = repr(given[0]) if given else ""
    if told:
        return f"Robot.load({', '.join([path, *told])})"
    return path


def _keywords(options: dict[str, list[str]], verb: str) -> list[str]:
    """Return the keywords of a call."""
    told = []
    prepared = [f"{k}={quoted(options[k][0])}" for k in OF_PREPARATION if k in options]
    if prepared:
        told.append(f"preparation=Preparation({', '.join(prepared)})")
    apart = {*OF_ROBOT, *OF_PREPARATION, *WRITERS, "out", "next", "workers", "rate", "periods"}
    apart |= {"patch"}
    for name, values in options.items():
        if name in apart:
            continue
        single = len(values) == 1 and name not in FILES
        value = quoted(values[0], name) if single else _files(values)
        value = repr(values) if name == "parameter" else value
        told.append(f"{KEYWORDS.get(name, name)}={value}")
    if verb == "export" and "patch" in options:
        told.append("form='patch'")
    return told


def _writers(verb: str, result: str, options: dict[str, list[str]]) -> list[str]:
    """Return the calls that write the files of a result."""
    writers = dict(WRITERS)
    if verb in OUT:
        writers["out"] = OUT[verb]
    if verb in ("predict", "simulate"):
        writers["out"] = "write"
    if verb == "excite" and options.get("out", [""])[0].endswith(".json"):
        writers["out"] = "to_json"
    names = [name for name in writers if name in options]
    return [f"{result}.{writers[name]}({options[name][0]!r})" for name in names]


def _files(names: Sequence[str]) -> str:
    """Return names of files as Python writes them: one, or a list; empty if there are none."""
    if len(names) == 1:
        return repr(names[0])
    return repr(list(names)) if names else ""
