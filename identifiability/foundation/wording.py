"""Remedies in the words of the reader: options at a terminal, keywords in Python.

A sentence is written once, with the options of the command line. `worded` gives it to its reader.
"""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Options of the command line that are switches.
SWITCHES = ("quick", "forward", "posterior", "force", "patch", "bending")

#: Settings and options that `Robot.load` takes, by the keyword.
OF_ROBOT = ("sidecar", "map", "lock", "base", "time_unit", "angles", "torque_side")

#: Settings of the preparation of logs that the command line and case files have.
OF_PREPARATION = ("derivatives", "cutoff", "decimate")

#: Options whose Python keyword has another name.
KEYWORDS = {"parameter": "parameters", "format": "form", "map": "columns"}

#: An effect in a list with commas, which also stand between the numbers of its shape.
EFFECT = r"(?:[^,\s]|,(?=[\d.+-]))+"

#: Methods that write a file, by the option. `--out` depends on the verb.
WRITERS = {"report": "write_report", "json": "to_json"}

#: Names of columns and joints, one or several options in turn.
_PAIR = r"(?:'[^']*'|[^\s,;)`]+)"
_PAIRS = re.compile(rf"(?<![\w-])--(map|lock) {_PAIR}(?: --\1 {_PAIR})*")

#: Verbs before an option make a call: ``payload --mass`` is ``payload(mass=…)``.
_OPTION = re.compile(
    r"(?:(?:identifiability )?\b(?P<verb>analyze|prune|diagnose|excite|predict|export|payload) )?"
    r"(?<![\w-])--(?P<name>[a-z][a-z-]*)"
    r"(?:[ =](?P<value>'[^']*'|[A-Z0-9][^\s,;)`]*|(?<=set )[^\s,;)`]*))?"
)

_AT_TERMINAL = ContextVar("_AT_TERMINAL", default=False)


@contextmanager
def at_terminal() -> Iterator[None]:
    """Leave options in sentences for a while: a terminal, a page or a file shows them."""
    before = _AT_TERMINAL.set(True)
    try:
        yield
    finally:
        _AT_TERMINAL.reset(before)


def by_reader(text: str, python: Callable[[str], str]) -> str:
    """Return a text unchanged at a terminal, and in Python as a function words it."""
    return text if _AT_TERMINAL.get() else python(text)


def worded(sentence: str) -> str:
    """Return a sentence for its reader: unchanged at a terminal, with keywords in Python."""
    return by_reader(sentence, in_python)


def in_python(sentence: str) -> str:
    """Return a sentence with keywords of Python in place of options of the command line.

    Examples
    --------
    >>> print(in_python("Use --set cutoff=4, or `payload --mass`."))
    Use preparation=Preparation(cutoff=4), or `payload(mass=…)`.
    """
    return _OPTION.sub(_keyword, _PAIRS.sub(_pairs, sentence))


def _pairs(found: re.Match[str]) -> str:
    """Return options for columns or locked joints as one keyword: a mapping, or a list."""
    name = found[1]
    values, end = _without_stop(found[0])
    given = [text.strip("'") for text in re.findall(rf"--{name} ({_PAIR})", values)]
    pairs = dict(text.partition("=")[::2] for text in given)
    if name == "map":
        return f"Robot.load(…, columns={pairs!r}){end}"
    inside = ", ".join(f"{joint!r}: {quoted(at)}" for joint, at in pairs.items())
    locked = f"{{{inside}}}" if all(pairs.values()) else repr(given)
    return f"Robot.load(…, lock={locked}){end}"


def _without_stop(text: str) -> tuple[str, str]:
    """Return a text without the stops at its end, and these: the end of a sentence is no value."""
    kept = text.rstrip(".")
    return kept, text[len(kept) :]


def _keyword(found: re.Match[str]) -> str:
    """Return the keyword of an option, in a call if its verb precedes it."""
    name = found["name"].replace("-", "_")
    verb = found["verb"]
    value, end = _without_stop(found["value"] or "")
    value = value.strip("'")
    if name in WRITERS:
        return f"{verb + ' ' if verb else ''}{WRITERS[name]}(…){end}"
    if name == "set":
        name, _, value = value.partition("=")
    value = "True" if name in SWITCHES else value or "…"
    keyword = f"{KEYWORDS.get(name, name)}={quoted(value, name)}"
    if name in OF_PREPARATION:
        keyword = f"preparation=Preparation({keyword})"
    elif name in OF_ROBOT:
        keyword = f"Robot.load(…, {keyword})"
    if verb:
        return f"{verb}({keyword}){end}"
    return f"{keyword}{end}"


def quoted(text: str, option: str = "") -> str:
    """Return a value as Python writes it: numbers, a truth value or a text; ``…`` if unknown.

    Of the option ``fixed``, ``exact`` is true.

    Examples
    --------
    >>> print(quoted("2e-3"), quoted("0,-0.1,0.2"), quoted("link,7"))
    2e-3 (0, -0.1, 0.2) 'link,7'
    """
    number = r"-?\d+(\.\d+)?(e-?\d+)?"
    if re.fullmatch(rf"{number}(,{number})+", text):
        return f"({text.replace(',', ', ')})"
    if option == "fixed" and text == "exact":
        return "True"
    if re.fullmatch(number, text) or text in ("True", "False", "…"):
        return text
    return repr(text)
