"""`Finding`: an observation or an action, by key; `findings.toml` has the sentences of all keys.

A finding *is* its sentence, so code that only shows it can treat it as text. Code that needs its
kind reads its key, and never a part of its text.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from functools import cache
from pathlib import Path
from string import Formatter
from typing import TYPE_CHECKING, Any

from .errors import THINGS, listing
from .values import Json

if TYPE_CHECKING:
    from .answers import Table


class Level(StrEnum):
    """How grave a finding is."""

    INFO = "info"
    HINT = "hint"
    DOUBT = "doubt"
    REFUSAL = "refusal"


class _Filler(Formatter):
    """Fills the holes of a sentence.

    ``{names}`` lists at most four names, ``{names:9}`` at most nine. ``{names:and}`` and
    ``{names:and 3}`` join them by "and". ``{n:one|many}`` goes by a number, or the length of a
    list; ``{n:# sample}`` counts. ``{x:3%}`` is a share in percent with three digits,
    ``{x:padded%}`` one that keeps its zeros, and ``{x:#3}`` a number with three digits. Where a
    list leaves some out, it counts them: by its own name, as in ``{joints}``, or by another of the
    `THINGS`, as in ``{names:and 3 joints}``.
    """

    things = ""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        self.things = field_name if field_name in THINGS else ""
        return super().get_field(field_name, args, kwargs)

    def format_field(self, value: Any, format_spec: str) -> str:
        many = isinstance(value, (list, tuple))
        if "|" in format_spec:
            one, others = format_spec.split("|")
            if (len(value) if many else value) == 1:
                return one
            return others
        head, _, noun = format_spec.partition(" ")
        if not (head.startswith(("and", "#")) or head.endswith("%")):
            if many:
                return listing(value, int(head or 4), things=noun or self.things)
            return format(value, format_spec)
        from . import rounding  # noqa: PLC0415 - SciPy

        if head == "and":
            most, _, things = noun.partition(" ")
            return rounding.join(list(value), int(most or 6), things or self.things)
        if head == "#":
            return rounding.format_count(len(value) if many else value, noun)
        if head.startswith("#"):
            return rounding.format_number(value, int(head[1:]))
        if head == "padded%":
            return rounding.error_text(value)
        return rounding.percent(value, int(head[:-1] or 2))


def fill(text: str, holes: Mapping[str, Any]) -> str:
    """Return a sentence with its holes filled.

    Example
    -------
    >>> fill("{names:and 3 joints} move", {"names": ["hip", "knee", "ankle", "toe"]})
    'hip, knee and 2 more joints move'
    """
    return _Filler().vformat(text, (), holes)


@cache
def sentences() -> Mapping[str, Mapping[str, str]]:
    """Return the one table of sentences: by key ``level``, ``says``, ``means``, ``do`` and parts.

    ``done`` states for the ledger how a check treated the rows that it names. ``decides`` marks
    findings that are always printed.
    """
    return tomllib.loads(Path(__file__).with_name("findings.toml").read_text(encoding="utf-8"))


def phrase(key: str, part: str, /, **numbers: Any) -> str:
    """Return a part of the sentences of a key with its holes filled."""
    return fill(sentences()[key][part].strip(), numbers)


class Finding(str):
    """A sentence with its key, its subject and its numbers.

    Attributes
    ----------
    key : str
        Its kind, a key of `sentences`.
    subject : str
        Log, joint or file that it is about; empty if it is about all.
    numbers : mapping
        Values in its sentence; the ledger shows ``rows`` and ``columns`` as changed.

    Example
    -------
    >>> found = Finding("wraps", "a.csv", where=["'elbow.q' at 2 rows"], rows=2)
    >>> found.key, found.level.value, found.done
    ('wraps', 'info', 'read as going on')
    """

    __slots__ = ("key", "numbers", "subject")
    key: str
    subject: str
    numbers: Mapping[str, Any]

    def __new__(cls, key: str, subject: object = "", /, **numbers: Any) -> Finding:
        """Fill the sentence of a key, ``{subject}`` with the subject."""
        return _again(
            phrase(key, "says", subject=subject, **numbers),
            key,
            str(subject),
            numbers,
        )

    def again(self, text: str) -> Finding:
        """Return the same finding with another text."""
        return _again(text, self.key, self.subject, self.numbers)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (str(self), self.key, self.subject, dict(self.numbers))

    @property
    def level(self) -> Level:
        """Return its severity."""
        return Level(sentences()[self.key].get("level", Level.REFUSAL))

    @property
    def decides(self) -> bool:
        """Return whether it changes a decision: it is always printed, and lowers the answers."""
        return "decides" in sentences()[self.key]

    @property
    def told(self) -> bool:
        """Return whether it is always printed, but does not lower the answers, as a choice does."""
        return "told" in sentences()[self.key]

    @property
    def done(self) -> str:
        """Return the action as a participle; empty if there was none."""
        return str(sentences()[self.key].get("done", ""))

    def to_dict(self) -> Json:
        """Return it for JSON."""
        plain = {k: list(x) if isinstance(x, tuple) else x for k, x in self.numbers.items()}
        return {"key": self.key, "level": self.level.value, "subject": self.subject, **plain}


def _again(text: str, key: str, subject: str, numbers: Mapping[str, Any]) -> Finding:
    """Return a finding with its text."""
    self = str.__new__(Finding, text)
    self.key = key
    self.subject = subject
    self.numbers = numbers
    return self


def of_key(texts: Iterable[str], *keys: str) -> list[Finding]:
    """Return the findings of some keys among sentences; all findings if no key is given."""
    found = [text for text in texts if isinstance(text, Finding)]
    return [x for x in found if not keys or x.key in keys]


def joints_with_play(texts: Iterable[str]) -> list[str]:
    """Return the joints whose gear has play, as findings state."""
    return [joint for x in of_key(texts, "odd_joint") for joint in x.numbers["play"]]


def merge_subjects(found: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings, of those that differ in their subject alone one that names all subjects."""
    alike: dict[tuple[str, str], list[Finding]] = {}
    for one in found:
        rest = one.replace(one.subject, "", 1) if one.subject else str(one)
        alike.setdefault((one.key, rest or str(one)), []).append(one)
    return tuple(map(_of_all_subjects, alike.values()))


def _of_all_subjects(found: Sequence[Finding]) -> Finding:
    first = found[0]
    subjects = list(dict.fromkeys(one.subject for one in found))
    if len(subjects) == 1:
        return first
    return Finding(first.key, listing(subjects, 4), **first.numbers)


def ledger(said: Iterable[str], *, every: bool = False) -> tuple[Table, ...]:
    """Return the table of actions of the checks on the rows of logs; none without actions.

    Parameters
    ----------
    said : iterable of str
        Hints and notes of a result; only findings count.
    every : bool
        Whether findings without an action are rows, too.
    """
    from .answers import Column, Table  # noqa: PLC0415 - pandas

    columns = [Column(title) for title in ("check", "of", "rows", "columns", "what was done")]
    rows = []
    for found in of_key(said):
        if every or found.done:
            touched = listing(found.numbers.get("columns", ()), 4)
            count = str(found.numbers.get("rows", ""))
            rows.append((found.key, found.subject, count, touched, found.done or "reported"))
    if rows:
        return (Table.of("Changes made to the logs", columns, rows),)
    return ()
