r"""Ask one question about all columns of a log that may be the same, with options that settle it.

Logs write such columns joint by joint, as ``elbow.tau_measured`` and ``elbow.tau_feedback``. One
pattern answers for all joints: ``--map '(.+)\.tau_measured=\1.tau'``.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile

from identifiability.foundation.errors import listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Renames
from identifiability.foundation.quoting import option_for_shell

from .names import Column

#: Parts of a name: letters, digits, or signs between them.
_PARTS = re.compile(r"[A-Za-z]+|\d+|[^A-Za-z\d]+")

#: A rule of ``--map``: a column or a regular expression, and its name here.
MapRule = tuple[str, str]


def ask_which(source: str, candidates: Mapping[str, Sequence[Column]]) -> Finding:
    """Return the question which columns are meant, with one command that answers it.

    Parameters
    ----------
    source : str
        Name of the table in sentences.
    candidates : mapping of str to sequence of Column
        By the name that a log has for a channel, ``elbow.tau`` or ``t``, the columns it may be.
    """
    channels: dict[str, dict[str, Sequence[Column]]] = {}
    for columns in candidates.values():
        channels.setdefault(columns[0].kind, {})[columns[0].joint] = columns
    questions = [_question(kind, joints) for kind, joints in channels.items()]
    rules = [rule for kind, joints in channels.items() for rule in propose_rules(kind, joints)]
    options = [option_for_shell("--map", "=".join(rule), always=True) for rule in rules]
    return Finding(
        "columns.several",
        source,
        options=" ".join(options),
        channels="; ".join(questions),
        count=len(candidates),
    )


def _question(kind: str, joints: Mapping[str, Sequence[Column]]) -> str:
    """Return the possible columns of a channel, for its first joint, and the number of joints."""
    joint, columns = next(iter(joints.items()))
    what = "the time" if kind == "t" else f"'{joint}.{kind}'"
    names = listing([c.source for c in columns], 6)
    more = f" (and so for {len(joints)} joints)" if len(joints) > 1 else ""
    return f"{what}: {names}{more}"


def propose_rules(kind: str, joints: Mapping[str, Sequence[Column]]) -> list[MapRule]:
    """Return rules of ``--map`` that take the first candidate of every joint.

    Parameters
    ----------
    kind : str
        The channel.
    joints : mapping of str to sequence of Column
        Candidates by joint; the time has the joint "".
    """
    if kind == "t":
        return [(_literal(joints[""][0].source.strip()), "t")]
    first = {joint: columns[0].source.strip() for joint, columns in joints.items()}
    numbered = all(c.number >= 0 for columns in joints.values() for c in columns)
    for rule, names in _patterns(kind, first, numbered=numbered):
        others = {c.source.strip() for columns in joints.values() for c in columns[1:]}
        if _settles(rule, names, others):
            return [rule]
    return [(_literal(column), f"{joint}.{kind}") for joint, column in first.items()]


def _patterns(
    kind: str, columns: Mapping[str, str], *, numbered: bool
) -> Iterator[tuple[MapRule, dict[str, str]]]:
    """Yield rules with one group for the joint, and the names that they give to columns."""
    if len(columns) < 2:
        return
    before, middles, after = split_names([*columns.values()])
    if not all(middles):
        return
    digits = all(m.isdecimal() for m in middles)
    group = r"(\d+)" if digits else "(.+)"
    old = f"{re.escape(before)}{group}{re.escape(after)}"
    for start, end in _new_ends(kind, [*columns], middles, numbered=numbered and digits):
        joint = r"\g<1>" if end[:1].isdecimal() else r"\1"
        new = f"{_plain(start)}{joint}{_plain(end)}"
        names = [f"{start}{m}{end}" for m in middles]
        yield (old, new), dict(zip(columns.values(), names, strict=True))


def _new_ends(
    kind: str, joints: Sequence[str], middles: Sequence[str], *, numbered: bool
) -> Iterator[tuple[str, str]]:
    """Yield the parts before and after the group in the new names of columns."""
    head, _, tail = joints[0].partition(middles[0])
    if [f"{head}{m}{tail}" for m in middles] == [*joints]:
        yield head, f"{tail}.{kind}"
    if numbered:  # joints in the robot's order
        yield f"{kind}_", ""


def split_names(names: Sequence[str]) -> tuple[str, list[str], str]:
    """Return the common start of names, their different parts, and their common end.

    Example
    -------
    >>> split_names(["left_arm.tau", "right_arm.tau"])
    ('', ['left', 'right'], '_arm.tau')
    """
    parts = [_PARTS.findall(name) for name in names]
    head = _common_start(parts)
    rests = [x[len(head) :] for x in parts]
    tail = _common_start([x[::-1] for x in rests])[::-1]
    middles = ["".join(x[: len(x) - len(tail)]) for x in rests]
    return "".join(head), middles, "".join(tail)


def _common_start(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the first items that all rows have in common."""
    places = zip(*rows, strict=False)
    alike = takewhile(lambda items: len({*items}) == 1, places)
    return [items[0] for items in alike]


def _settles(rule: MapRule, names: Mapping[str, str], others: set[str]) -> bool:
    """Return whether a rule gives columns their names and leaves the other candidates alone."""
    try:
        rules = Renames.of(dict([rule]))
    except ValueError:
        return False
    renamed = all(rules.apply(column) == name for column, name in names.items())
    return renamed and all(rules.apply(column) == column for column in others)


def _plain(text: str) -> str:
    """Return a text with escaped backslashes, for the replacement of a rule."""
    return text.replace("\\", r"\\")


def _literal(column: str) -> str:
    """Return a column name as the left side of a rule."""
    try:
        re.compile(column)
    except re.error:
        return re.escape(column)
    return column
