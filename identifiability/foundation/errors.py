"""Sentences for the user: the given input, the expected input, and the remedy."""

import difflib
import re
from collections.abc import Iterable

from .quoting import for_terminal
from .wording import worded

#: Longest quoted name before its middle is omitted, and lengths of its ends [letters].
_LONG, _HEAD, _TAIL = 240, 100, 60

#: Longest sentence before its middle is omitted [letters].
LONGEST = 4000


class IdentifiabilityError(Exception):
    """Bad input, with one sentence that tells the user how to correct it.

    Attributes
    ----------
    key : str
        Key of its sentence if that is a `Finding`; else empty.
    """

    def __init__(self, sentence: str = "") -> None:
        super().__init__(legible(sentence))
        self.key: str = getattr(sentence, "key", "")

    def __str__(self) -> str:
        """Return the sentence; in Python its remedy names keywords instead of options."""
        return worded(super().__str__())

    def _render_traceback_(self) -> list[str]:
        """Return the sentence alone, which a notebook shows without frames."""
        return [f"{type(self).__name__}: {self}"]


class RobotError(IdentifiabilityError):
    """The robot file or its sidecar cannot be used."""


class LogError(IdentifiabilityError):
    """A log cannot be used."""


class ModelError(IdentifiabilityError):
    """A model or a ladder of models cannot be used with this robot."""


class ClosureError(IdentifiabilityError):
    """The loops of a closed chain cannot be closed along a motion."""


class OutputError(IdentifiabilityError):
    """A result cannot be written."""


class EngineError(IdentifiabilityError):
    """The processes or the cluster that should do the work cannot be used."""


def legible(sentence: str) -> str:
    """Return a sentence whose quotations a terminal can print on one line.

    Text from files may hold line ends, other control characters and halves of letters, in any
    number.
    """
    line = for_terminal(sentence)
    line = re.sub(rf"[^' ]{{{_LONG},}}", lambda m: f"{m[0][:_HEAD]}…{m[0][-_TAIL:]}", line)
    if len(line) <= LONGEST:
        return line
    return f"{line[: LONGEST // 2]}…{line[-LONGEST // 3 :]}"


def near_match(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence: ``", did you mean 'x'?"`` with the nearest name, or ``"."``."""
    found = nearest(name, known)
    if found is None:
        return "."
    return f", did you mean '{found}'?"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name with a similar spelling; None if there is none."""
    # Case slips are the commonest typos and difflib counts them as full substitutions.
    folded = {k.casefold(): k for k in known}
    close = difflib.get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.6)
    return folded[close[0]] if close else None


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article, by its first letter: ``an acceleration``."""
    return f"{'an' if noun[:1] in 'aeiouAEIOU' else 'a'} {noun}"


#: Things that sentences list, in the plural and in the singular.
THINGS = {
    **{f"{noun}s": noun for noun in ("joint", "effect", "log", "column", "motor", "parameter")},
    **{f"{noun}s": noun for noun in ("change", "limit", "value")},
    **{"bodies": "body", "topics": "topic", "legs": "leg", "variables": "variable"},
}


def count_more(count: int, things: str = "") -> str:
    """Return ``and 2 more joints``: how many, of which things, a list leaves out."""
    noun = THINGS.get(things, "") if count == 1 else things
    return f"and {count} more {noun}".rstrip()


def listing(names: Iterable[str], most: int = 12, between: str = ", ", *, things: str = "") -> str:
    """Return the names as ``a, b, c``; beyond `most`, state the number of omitted things.

    Example
    -------
    >>> listing(["hip", "knee", "ankle"], 2, things="joints")
    'hip, knee and 1 more joint'
    """
    names = list(names)
    text = between.join(names[:most])
    if len(names) <= most:
        return text
    return f"{text} {count_more(len(names) - most, things)}"
