"""Interpret names and units of columns as drivers, recorders and toolboxes write them.

`words.toml` lists words with their channels, and units with their factors. Units stand in a row
under the header or in the names.

A name is cut into words and numbers, ``/joint_states/panda_joint1/position`` into *joint, states,
panda, joint, 1, position*. It is a channel of a joint if it holds the joint's name or number and
one word for the channel. All its other words must be neutral. A command is no measurement.
"""

import re
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from identifiability.foundation.errors import LogError, with_article
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen

from .codes import Code

_TABLES = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))

#: Words of names by their meaning, and the quantities of each channel of a log.
WORDS: dict[str, str] = _TABLES["words"]
DIMENSIONS: dict[str, list[str]] = _TABLES["dimensions"]
SIDES: dict[str, str] = _TABLES["sides"]

#: Units by quantity, with their value in SI.
SIZES: dict[str, dict[str, float]] = _TABLES["units"]


def words_for(channel: str) -> Strings:
    """Return the words of a channel, in the order of the table."""
    return tuple(WORDS[channel].split())


#: Units by spelling: their quantity, and their value in SI.
UNITS = {
    name: (what, size)
    for what, sizes in SIZES.items()
    for written, size in sizes.items()
    for name in written.split()
}
UNITS |= {
    f"{name}{end}": (f"{what}{end.replace('sec', 's')}", size)
    for name, (what, size) in UNITS.items()
    if what in ("angle", "length")
    for end in ("/s", "/sec", "/s2", "/sec2")
}

#: Text of a column without a unit.
NONE = ("", "-", "–", "1", "none", "n/a")

#: Letters of a unit, and of the name of a column; and columns of a table, at most.
LONGEST_UNIT, LONGEST_NAME, MOST_COLUMNS = 200, 1000, 20_000

_BRACKETS = re.compile(r"\s*[\[(<]\s*([^\])>]*?)\s*[\])>]\s*$")


@frozen
class Unit:
    """A unit that a log states.

    Attributes
    ----------
    text : str
        Its spelling in the log.
    dimension : str
        Quantity that it measures.
    factor : float
        Its value in the SI unit.
    """

    text: str
    dimension: str
    factor: float

    def check(self, kind: str, column: str, source: str, joint: str) -> None:
        """Refuse a unit that does not suit a channel.

        Raises
        ------
        LogError
        """
        if self.dimension not in DIMENSIONS[kind]:
            what = _TABLES["called"].get(kind, "torque or force")
            remedy = "check which column is which, and rename it or repair the unit"
            if self.dimension == "current":
                renamed = f"{joint}.current [{self.text}]"
                remedy = f"name it '{renamed}' in the header, or under [columns] in the sidecar"
            raise LogError(
                f"{source}: column '{column}' is {with_article(what)}, but its unit is stated as "
                f"'{self.text}'; {remedy}."
            )


def find_unit(text: str) -> Unit | None:
    """Return the unit of a text, with or without brackets; None if it is no unit."""
    if len(text) > LONGEST_UNIT:
        return None
    inner = _BRACKETS.fullmatch(text)
    stated = (inner[1] if inner else text).strip()
    plain = re.sub(r"[\s·⋅*.^]", "", stated).replace("²", "2").replace("μ", "µ")
    plain = plain.replace("s-1", "/s").replace("s-2", "/s2").replace("//", "/")
    plain = re.sub(r"(?<=[a-z])-(?=[a-z])", "", plain)  # in-lb
    found = UNITS.get(plain) or UNITS.get(plain.lower() if len(plain) > 2 else plain)
    return Unit(stated, *found) if found else None


def is_no_unit(text: str) -> bool:
    """Return whether a cell of a row of units means a column without a unit."""
    if len(text) > LONGEST_UNIT:
        return False
    inner = _BRACKETS.fullmatch(text.strip())
    return (inner[1] if inner else text.strip()).casefold() in NONE


def check_names(source: str, names: Sequence[str]) -> None:
    """Refuse a table with more columns, or longer names, than a log has.

    Raises
    ------
    LogError
    """
    if len(names) > MOST_COLUMNS:
        raise LogError(Finding("columns.many", source, count=len(names), most=MOST_COLUMNS))
    longest = max(names, key=len, default="")
    if len(longest) > LONGEST_NAME:
        raise LogError(
            Finding(
                "columns.long", source, start=longest[:40], letters=len(longest), most=LONGEST_NAME
            )
        )


def are_units(row: Sequence[str]) -> bool:
    """Return whether a row states the units of its columns."""
    units = [find_unit(cell) for cell in row]
    return any(units) and all(u or is_no_unit(x) for u, x in zip(units, row, strict=True))


def bracketed(name: str) -> str:
    """Return the text in brackets at the end of a name; empty if there is none."""
    inner = _BRACKETS.search(name)
    return inner[1] if inner else ""


def split_unit(name: str) -> tuple[str, Unit | None]:
    """Return the name of a column, and the unit in brackets at its end.

    Example
    -------
    >>> split_unit("elbow.q [deg]")[0]
    'elbow.q'
    """
    inner = _BRACKETS.search(name)
    unit = find_unit(inner[1]) if inner else None
    if inner and unit:
        name = name[: inner.start()].strip()
    return name, unit


#: Words for each channel, and the channel of each word.
CHANNEL_WORDS = {kind: words_for(kind) for kind in ("q", "dq", "ddq", "tau", "current")}
KINDS = {word: kind for kind, words in CHANNEL_WORDS.items() for word in words}

#: Words for estimates; neutral words, which name neither a joint nor a channel; words for desired
#: values, and for time;
#: then further neutral words and words for desired values of commands.
ESTIMATED = frozenset(words_for("estimated"))
SILENT = ESTIMATED.union(words_for("silent"))
COMMANDED = frozenset(words_for("wanted"))
TIME_WORDS = frozenset(words_for("t"))
_IDLE = SILENT.union(words_for("silent of commands"))
_AHEAD = frozenset(words_for("tau_ff"))

#: Ends of the names that columns have here.
SPELLED = {kind: kind for kind in (*CHANNEL_WORDS, "q_ref", "dq_ref", "tau_ff")}
SPELLED |= {"cmd": "q_ref", "q_cmd": "q_ref", "dq_cmd": "dq_ref", "tau_cmd": "tau_ff"}

#: A column with only the name or number of a joint: a position, if there is no other.
BARE = "bare"

#: Channel of a command, by the channel in its name; without one it is a position.
_WANTED = {"q": "q_ref", "": "q_ref", "dq": "dq_ref", "tau": "tau_ff"}

_TIME_UNITS = tuple(name for name, (what, _) in UNITS.items() if what == "time")

#: Name of an index without a name in files of pandas.
INDEX = "__index_level_0__"


@frozen
class Column:
    """A column of a table: its joint, its channel and its conversion to SI units.

    Attributes
    ----------
    source : str
        Its name in the table.
    kind : str
        ``t``, a channel, ``current`` or `BARE`.
    joint : str
        Empty if a number identifies the joint, or nothing does.
    number : int
        Number in its name; −1 if there is none.
    unit : Unit or None
        The unit that the log states, if any.
    literal : bool
        Whether it has a documented name.
    current : bool
        Whether it holds the current of a motor instead of torque.
    factor, offset : float
        The SI value is factor × (value − offset).
    dates : int or None
        First date of a column of dates [ns since 1970]; None for numbers.
    code : Code or None
        How unsigned numbers encode signed ones; None if they do not.
    """

    source: str
    kind: str
    joint: str = ""
    number: int = -1
    unit: Unit | None = None
    literal: bool = False
    current: bool = False
    factor: float = 1.0
    offset: float = 0.0
    dates: int | None = None
    code: Code | None = None

    @property
    def name(self) -> str:
        """Return its documented name."""
        if self.joint:
            return f"{self.joint}.{self.kind}"
        return self.kind

    def scale(self, values: Array) -> Array:
        """Return values of the table, (N,), in SI units."""
        values = values if self.code is None else self.code.decode(values)
        values = values - self.offset if self.offset else values
        if self.factor == 1.0:
            return values
        return values * self.factor


def words_of(name: str) -> list[str]:
    """Return a name's words, in small letters, and numbers; two known words that are one, apart.

    Example
    -------
    >>> words_of("actualPosition_1"), words_of("Iststrom 2")
    (['actual', 'position', '1'], ['ist', 'strom', '2'])
    """
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    apart = re.sub(r"\bq_(d{1,2}ot)", r"q\1", apart)
    words = (w.casefold() for w in re.findall(r"[^\W\d_]+|\d+", apart))
    return [part for word in words for part in _compounds().get(word, (word,))]


@cache
def _compounds() -> dict[str, tuple[str, str]]:
    """Return pairs of known words by the compound that joins them, as in German names."""
    known = {w for words in WORDS.values() for w in words.split() if w.isalpha() and len(w) > 2}
    return {a + b: (a, b) for a in known for b in known if a + b not in known}


def guess_column(source: str, name: str, joints: Sequence[str]) -> Column | None:
    """Return the column that a name describes; None if the name is not clear.

    If the name has a word for a desired value, the column is a command.

    Parameters
    ----------
    source, name : str
        Its name in the table, and after renaming.
    joints : sequence of str
        Of the robot.
    """
    plain, unit = split_unit(name)
    owner, _, end = plain.rpartition(".")
    if plain == "t" or (owner in joints and end in SPELLED):
        return Column(source, SPELLED.get(end, "t"), owner, -1, unit, literal=True)
    if unit is None and unread_unit(name, joints):  # the quantity can be recognised all the same
        plain = name[: name.rindex(bracketed(name)) - 1]
    parts = [p for p in plain.split("/") if p]
    words = words_of(" ".join(parts[-2:]))
    above = words_of(" ".join(parts[:-2]))
    time = _guess_time(source, words, unit)
    if time is not None:
        return time
    joint, rest = take_joint(words, joints)
    ending = last_unit(rest)
    if unit is None and ending is not None:
        unit = ending
        rest = rest[:-1]
    kinds = {KINDS[w] for w in rest if w in KINDS}
    numbers = [w for w in rest if w.isdecimal()]
    wanted = (COMMANDED | _AHEAD).intersection([*rest, *above])
    silent = _IDLE if wanted or "current" in kinds else SILENT  # all are of motors
    kind = next(iter(kinds), "tau" if _AHEAD & wanted else "")
    kind = _WANTED.get(kind, "") if wanted else kind
    if not kind and bool(joint) + len(numbers) == 1 and (joint or len(rest) > 1):
        kind = BARE
    others = {*rest}.difference(KINDS, numbers, silent, wanted)
    if others or not kind or len(kinds) > 1 or len(numbers) > (not joint):
        return None
    number = int(numbers[0]) if numbers and len(numbers[0]) < 4 else -1
    return Column(source, kind, joint, number, unit)


def last_unit(words: Sequence[str]) -> Unit | None:
    """Return the unit that the last word of a name is; one letter is none by itself."""
    last = "".join(words[-1:])
    known = last in ("rad", "deg", "nm", "mm") or last == "n" != words[0]
    return find_unit(last.replace("n", "N")) if known else None


def unread_unit(name: str, joints: Sequence[str]) -> str:
    """Return the text in brackets at the end of a name if it seems an unknown unit; else empty.

    Numbers, names of joints and neutral words are not units.

    Example
    -------
    >>> unread_unit("elbow.q [gon]", ["elbow"]), unread_unit("position [elbow]", ["elbow"])
    ('gon', '')
    """
    text = bracketed(name)
    if not text or find_unit(text) or is_no_unit(text):
        return ""
    said = [w for w in take_joint(words_of(text), joints)[1] if not w.isdecimal()]
    plain = {*SILENT, *KINDS, *TIME_WORDS}.issuperset(said) and (said or words_of(text))
    return "" if plain else text


def _guess_time(source: str, words: list[str], unit: Unit | None) -> Column | None:
    """Return a column of time."""
    if source == INDEX:
        return Column(source, "t")
    if unit is None and len(words) > 1 and words[-1] in _TIME_UNITS:
        unit = find_unit(words[-1])
        words = words[:-1]
    left = [w for w in words if w not in SILENT and w != "header"]
    if unit is not None and unit.dimension != "time":
        return None
    if left and TIME_WORDS.issuperset(left):
        return Column(source, "t", unit=unit)
    return None


def take_joint(words: list[str], joints: Sequence[str]) -> tuple[str, list[str]]:
    """Return the joint whose name is among some words, and the remaining words.

    Neutral words may be missing from a name, as in "FL_hip" for "FL_hip_joint", if a word remains.
    """
    for brief in (False, True):
        found = []
        for joint in joints:
            name = [w for w in words_of(joint) if not (brief and w in SILENT)]
            at = [k for k in range(len(words)) if words[k : k + len(name)] == name]
            if at and name and not (brief and all(map(str.isdecimal, name))):
                found.append((len(name), at[0], joint))
        if found:
            size, k, joint = max(found, key=lambda f: f[0])
            # Names that differ only in case or signs cannot be distinguished.
            alike = sum(length == size for length, *_ in found) > 1
            if alike:
                return "", ["?"]
            return joint, words[:k] + words[k + size :]
    return "", list(words)
