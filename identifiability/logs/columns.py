"""Assign the columns of a table: joint, channel, and conversion to SI units.

Columns are assigned by names, by numbers (``q1`` … ``q6``, ``position[0]``), or by the user's map.
The log's units override those of the sidecar. Torque columns may hold currents or torques of
motors. Times may have any unit or be dates. An error about a missing column contains a remedy that
can be copied.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match, nearest
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import TIME_UNITS, Array, Strings, find_patterns, name_rule
from identifiability.foundation.quoting import option_for_shell, toml_key
from identifiability.foundation.values import frozen

from .checks import CHANNELS, COMMANDS, MOTIONS, MOTOR, to_floats
from .codes import Code, describe_codes, find_codes, show_codes
from .conventions import Conventions
from .names import (
    BARE,
    CHANNEL_WORDS,
    COMMANDED,
    DIMENSIONS,
    ESTIMATED,
    INDEX,
    KINDS,
    SIDES,
    SPELLED,
    UNITS,
    Column,
    Unit,
    find_unit,
    guess_column,
    last_unit,
    split_unit,
    take_joint,
    unread_unit,
    words_for,
    words_of,
)
from .questions import ask_which, propose_rules
from .rules import RULES

if TYPE_CHECKING:
    import pandas as pd

#: Channels that are angles or their rates, and one degree [rad].
ANGULAR = ("q", "dq", "ddq", "q_ref", "dq_ref", "q_m")
DEGREE = math.pi / 180

#: In the name of a column: torque in percent of the rated torque.
_SHARE = re.compile(r"(?i)%|(?<![a-z])(?:pct|percent)(?![a-z])")

#: A joint's name and a word for its channel.
_CHANNEL_LAST = re.compile(r"(?P<joint>.+?)(?P<between>[._\- ]+)(?P<kind>[A-Za-z]+)")
_CHANNELS_SAY = {*KINDS, *COMMANDED, "ff"}


@frozen
class Naming:
    """The columns that a log takes from a table.

    Attributes
    ----------
    columns : tuple of Column
        In the order of the table.
    joints : tuple of str
    notes : tuple of str
        Renamed columns and converted units, half a sentence each.
    locked : tuple of Column
        Positions of joints that are locked, which a log may contradict.
    made : tuple of str
        Torque columns filled with zeros, because only motion or commands are needed.
    commands : tuple of str
        Columns of commands that replace torque.
    codes : mapping of str to Code
        Codes that the table shows, by the kind of column.
    """

    columns: tuple[Column, ...]
    joints: Strings
    notes: Strings = ()
    locked: tuple[Column, ...] = ()
    made: Strings = ()
    commands: Strings = ()
    codes: Mapping[str, Code] = {}

    @property
    def time(self) -> Column:
        """The column of times."""
        return next(c for c in self.columns if c.name == "t")

    def timed(self, *notes: str, **changes: Any) -> Naming:
        """Return the same with a changed column of times, and notes."""
        time = replace(self.time, **changes)
        columns = tuple(time if c.name == "t" else c for c in self.columns)
        return replace(self, columns=columns, notes=(*self.notes, *notes))

    def without_commands(self, empty: Sequence[str]) -> Naming:
        """Return the same without some columns of commands, if others have values.

        Positions replace them, so that their joints move as measured.
        """
        if not 0 < 2 * len(empty) <= len(self.commands):
            return self
        positions = {c.joint: c for c in self.columns if c.kind == "q"}
        columns = [
            replace(positions[c.joint], kind=c.kind) if c.name in empty else c for c in self.columns
        ]
        return replace(self, columns=tuple(columns))


def name_columns(
    found: Sequence[str],
    source: str,
    known: Conventions,
    units: Mapping[str, str],
    first: Mapping[str, str],
) -> Naming:
    """Return the columns that a log takes from a table.

    If all documented names are present, no other names count. Without a robot only documented names
    are read.

    Parameters
    ----------
    found : sequence of str
        Their names in the table.
    source : str
        Name of the table in messages.
    known : Conventions
    units : mapping of str to str
        Units in the table's row of units.
    first : mapping of str to str
        Texts in the first row, by column.

    Raises
    ------
    LogError
        If there is no time, a needed column is missing, repeated or ambiguous, or its unit does not
        suit its channel.
    """
    names = {name: rename(name.strip(), known) for name in found}
    guesses = _guess(names, known)
    _refuse_twice(found, guesses, source)
    unread = _find_unread(names, guesses, source, known)
    idle = _idle_currents(guesses, known)
    guesses = [g for g in guesses if g.source not in idle]
    torque = _has_torque({c: n for c, n in names.items() if c not in idle}, guesses)
    needed = ("q",) if known.motion_alone and not torque else ("q", "tau")
    candidates = _find_candidates(guesses, known, needed, torque=torque)
    resolved, how = resolve_numbers(candidates, source, known, names, first)
    taken = _choose(resolved, names, known, source)
    commanding = resolve_commands(taken, names, source, known, torque=torque)
    needed = ("q",) if commanding else needed
    wanted = _all_there(taken, known, needed)
    _require_motors(taken, wanted, known, source)
    if not wanted and torque:
        wanted = _all_there({*taken, *_unmeasured(names, taken, known)}, known, needed)
    moved = () if wanted else _list_moved(taken, known)
    wanted = known.motors if moved else wanted
    if not wanted:
        _refuse_missing(names, taken, source, known)
    own = [
        g
        for n, g in taken.items()
        if n == "t"
        or (g.joint in wanted and g.kind in CHANNELS and not (moved and g.kind in MOTIONS))
        or (g.joint in moved and g.kind in MOTIONS)
    ]
    held = [g for g in taken.values() if g.joint in known.locked and g.kind == "q"]
    stated = {c.name: _find_stated(c, units) for c in own + held}
    counted = {c.joint for c in own if c.kind == "q" and stated[c.name] is None}
    columns = [_in_si(c, stated[c.name], source, known, counted) for c in own]
    columns, torque_notes = _convert_torque(columns, wanted, known, source)
    renamed = _tell(names, columns, wanted, how)
    timed = _state_time(resolved, taken["t"])
    notes = (
        *renamed,
        *timed,
        *_tell_angles((*moved, *wanted), known),
        *torque_notes,
        *([phrase("reading", "moved", motors=wanted)] if moved else ()),
        *([phrase("reading", "currents", columns=idle)] if idle else ()),
        *_tell_spare_currents(guesses, columns),
        *unread,
        *_tell_order(taken.values(), source, known),
    )
    locked = tuple(_in_si(c, stated[c.name], source, known) for c in held)
    commands = tuple(g.name for g in own if commanding and g.kind in COMMANDS)
    made = () if "tau" in needed else tuple(f"{j}.tau" for j in wanted)
    return Naming(
        tuple(columns),
        wanted,
        notes,
        locked=locked,
        made=made,
        commands=commands,
    )


def _find_unread(
    names: Mapping[str, str], guesses: Sequence[Column], source: str, known: Conventions
) -> list[Finding]:
    """Return a note on columns of torque or current that are not read.

    They name a joint, or another struct has a column of their name.
    """
    read = {g.source for g in guesses}
    ends = {x.rpartition(".")[2] for x in read if "." in x}  # of the struct that is read
    joints = (*known.motors, *known.joints)
    unread = []
    for column, name in names.items():
        plain = split_unit(name)[0]
        words = words_of(plain)
        measured = _has_torque({"": plain}, ()) and COMMANDED.isdisjoint(words)
        own = take_joint(words, joints)[0] or column.rpartition(".")[2] in ends
        if column not in read and measured and own:
            unread.append(f"'{column.strip()}'")
    return [Finding("unread", source, columns=unread)] if unread else []


def _idle_currents(guesses: Sequence[Column], known: Conventions) -> list[str]:
    """Return columns of currents without gains, if servos make torque of commands."""
    currents = [g for g in guesses if g.kind == "current"]
    gains = [known.torque.at("gain", g.joint) for g in currents]
    if known.servo is None or any(gains) or all(g.kind != "q_ref" for g in guesses):
        return []
    return [g.source for g in currents]


def _tell_spare_currents(guesses: Sequence[Column], taken: Sequence[Column]) -> Iterator[str]:
    """Yield a note on columns of currents that torque columns replace."""
    read = {c.joint: c.source for c in taken if c.kind == "tau"}
    currents = [g for g in guesses if g.kind == "current"]
    spare = [g.source for g in currents if read.get(g.joint, g.source) != g.source]
    if spare:
        yield phrase("reading", "spare", columns=spare)


def _refuse_twice(found: Sequence[str], guesses: Sequence[Column], source: str) -> None:
    """Refuse a table with a needed column that is there twice."""
    called = Counter(column.strip() for column in found)
    for column in sorted(g.source.strip() for g in guesses):
        if called[column] > 1:
            raise LogError(f"{source} has the column '{column}' more than once; keep one of them.")


def _find_candidates(
    guesses: Sequence[Column], known: Conventions, needed: Sequence[str], *, torque: bool
) -> list[Column]:
    """Return the columns of measurements, then those of commands.

    If there is torque, only commands with documented names count. Currents replace the torque of
    joints that have none.
    """
    every = known.commands or not torque
    commands = [g for g in guesses if g.kind in COMMANDS and (every or g.literal)]
    measured = [g for g in guesses if g.kind not in COMMANDS]
    if all(g.kind != "q" for g in measured):
        measured = [replace(g, kind="q") if g.kind == BARE else g for g in measured]
    has = {g.joint for g in measured if g.kind == "tau"}
    drives = known.motors if has & {*known.motors} else known.joints
    lacking = {*drives} - has if has else {g.joint for g in measured}
    if "" not in has:
        measured = [
            replace(g, kind="tau", current=True)
            if g.kind == "current" and g.joint in lacking
            else g
            for g in measured
        ]
    # act_elbow beside pos_elbow is an action.
    if known.servo is not None and not (torque or commands):
        acts = (g for g in measured if g.kind == BARE and "act" in words_of(g.source))
        commands = [replace(g, kind="q_ref") for g in acts]
    if _all_there({g.name for g in measured if g.literal}, known, needed):
        also = (*known.locked,)
        measured = [g for g in measured if g.literal or g.kind in MOTOR or g.joint in also]
    return [*measured, *commands]


def _guess(names: Mapping[str, str], known: Conventions) -> list[Column]:
    """Return the columns whose names identify their channel."""
    joints = tuple(dict.fromkeys((*known.motors, *known.joints, *known.locked)))
    if not known.joints:
        owners = [split_unit(n)[0].rpartition(".")[0] for n in names.values()]
        joints = tuple(dict.fromkeys(owners))
    guess = _guess_side if known.torque.has_side("both") else guess_column
    guesses = [guess(c, n, joints) for c, n in names.items()]
    return [g for g in guesses if g is not None and (known.joints or g.literal or g.name == "t")]


#: Ends of the names of channels on the two sides of a gear.
_ENDS = {"motor": "_m", "link": ""}


def _guess_side(source: str, name: str, joints: Sequence[str]) -> Column | None:
    """Return the column that a name describes if some are of motors and some of links.

    Parameters as of `guess_column`. Currents are those of motors.
    """
    plain = split_unit(name)[0]
    guess = guess_column(source, name, joints)
    if guess is not None and guess.literal:
        return guess
    if _owner(plain) in joints and _kind(plain) in MOTOR:
        guess = guess_column(source, name.replace("_m", ""), joints)
        return guess and replace(guess, kind=_kind(plain))
    words = take_joint(words_of(plain), joints)[1]
    for side, end in _ENDS.items():
        for word in {*SIDES[side].split()}.intersection(words):
            bare = re.sub(rf"(?i)(?<![a-z]){word}(?![a-z])", " ", name, count=1)
            guess = guess_column(source, bare, joints)
            if guess is not None and guess.kind in ("q", "tau"):
                return replace(guess, kind=guess.kind + end, literal=False)
    if guess is not None and guess.kind == "current":
        return replace(guess, kind="tau_m", current=True)
    return guess


def _has_torque(names: Mapping[str, str], guesses: Sequence[Column]) -> bool:
    """Return whether any column but commands names torque or current."""
    commands = {g.source for g in guesses if g.kind in COMMANDS}
    others = (words_of(f"{c} {n}") for c, n in names.items() if c not in commands)
    return any(KINDS.get(word) in ("tau", "current") for words in others for word in words)


def _all_there(names: Collection[str], known: Conventions, needed: Sequence[str]) -> Strings:
    """Return the motors or joints that a table has all that is needed of, or none."""
    found = known.joints or tuple(
        dict.fromkeys(_owner(n) for n in names if _kind(n) in ("q", "tau"))
    )
    for wanted in (known.motors, found):
        if wanted and {"t", *(f"{j}.{kind}" for j in wanted for kind in needed)} <= {*names}:
            return wanted
    return ()


def _list_moved(taken: Collection[str], known: Conventions) -> Strings:
    """Return the joints whose positions give those of coupled motors, which have the torque."""
    torque = {"t", *(f"{m}.tau" for m in known.motors)}
    positions = {f"{j}.q" for j in known.joints}
    return known.joints if known.motors and torque | positions <= {*taken} else ()


def _choose(
    guesses: Sequence[Column], names: Mapping[str, str], known: Conventions, source: str
) -> dict[str, Column]:
    """Return the one column of each channel of each joint, and of time.

    Raises
    ------
    LogError
        With one question about all channels for which there are several.
    """
    found: dict[str, list[Column]] = {}
    for guess in guesses:
        if guess.kind not in ("current", BARE):
            found.setdefault(guess.name, []).append(guess)
    out = {}
    several = {}
    for name, those in found.items():
        best = _preferred(those, names)
        if len(best) == 1:
            out[name] = best[0]
        elif those[0].kind not in ("dq", "ddq") and those[0].joint not in known.locked:
            several[name] = those  # velocities are computed then
    if several:
        raise LogError(ask_which(source, several))
    return out


def _preferred(columns: Sequence[Column], names: Mapping[str, str]) -> Sequence[Column]:
    """Return the columns of one channel that go before the others; all if none does.

    Those with the documented name go first, then those that the user renamed. Of several times,
    PlotJuggler's goes first, then the stamp of a ROS header: a recorder's clock jitters. Estimates
    go last.
    """
    literal = [g for g in columns if g.literal]
    stripped = [g for g in columns if names[g.source] != g.source.strip()]
    stamped = [g for g in columns if g.source == "__time"]
    stamps = [g for g in columns if g.kind == "t" and is_stamp(g.source)]
    measured = [g for g in columns if not ESTIMATED.intersection(words_of(g.source))]
    orders = (
        literal,
        stripped,
        stamped,
        stamps,
        measured,
    )
    return next((some for some in orders if some), columns)


def is_stamp(column: str) -> bool:
    """Return whether a column is the stamp of a ROS header."""
    return {"header", "stamp"}.issubset(words_of(column))


def _state_time(guesses: Sequence[Column], time: Column) -> list[str]:
    """Return a note on the selected column of time; empty if it is called `t`."""
    others = [f"'{g.source}'" for g in guesses if g.kind == "t" and g.source != time.source]
    if time.literal or not others:
        return []
    return [f"of several times '{time.source}' was taken, not {listing(others)}"]


def _unmeasured(
    names: Mapping[str, str], taken: Mapping[str, Column], known: Conventions
) -> list[str]:
    """Return the torques that a table lacks, for joints whose positions it has.

    The result is None if the table has no torque at all, or a column that may be one of them.
    """
    joints = known.motors if any(f"{m}.q" in taken for m in known.motors) else known.joints
    lacking = [j for j in joints if f"{j}.q" in taken and f"{j}.tau" not in taken]
    missing = [f"{j}.tau" for j in lacking]
    spelt = [n for n in _free(names, taken) if _kind(n) not in SPELLED or _kind(n) == "tau"]
    misspelt = any(nearest(name, spelt) is not None for name in missing)
    if len(lacking) == len(joints) or misspelt:
        return []
    return missing


def _free(names: Mapping[str, str], taken: Mapping[str, Column]) -> list[str]:
    """Return the columns that are not taken for anything."""
    used = {g.source for g in taken.values()}
    return [name for column, name in names.items() if column not in used]


def _require_motors(
    taken: Collection[str], wanted: Sequence[str], known: Conventions, source: str
) -> None:
    """Refuse a log without the torque of motors that the sidecar announces."""
    both = [j for j in wanted if known.torque.side_of(j) == "both"]
    missing = [f"{j}.tau_m" for j in both if f"{j}.tau_m" not in taken]
    if missing:
        map_motor = _map_word("OLD", missing[0])
        raise LogError(Finding("columns.motor", source, columns=missing, map=map_motor))


# Conversion of a column to SI units: by the unit of the log, or else of the sidecar.


def _find_stated(column: Column, units: Mapping[str, str]) -> Unit | None:
    """Return the unit that a column, its log or its header states."""
    own = units.get(column.source, "")
    return column.unit or find_unit(own) or split_unit(column.source.strip())[1]


def _in_si(
    column: Column,
    unit: Unit | None,
    source: str,
    known: Conventions,
    counted: Collection[str] = (),
) -> Column:
    """Return a column with its conversion to SI units.

    Parameters
    ----------
    column : Column
    unit : Unit, optional
        That is stated for it.
    source : str
        Of the log.
    known : Conventions
    counted : collection of str
        Joints whose position has no unit: the scale of their counts is not that of speeds with one.

    Raises
    ------
    LogError
        If it states an unknown unit, or one that does not suit its channel.
    """
    name = column.source.strip()
    kind = "current" if column.current else column.kind
    scale, zero = known.scales.get(column.joint, (1.0, 0.0)) if kind in ANGULAR else (1.0, 0.0)
    offset = -zero if kind in ("q", "q_ref") else 0.0
    if unit is not None:
        unit.check(kind, name, source, column.joint)
        # Counts have a size, and also a direction: speeds of the same drive share the direction.
        size = math.copysign(1.0, scale) if column.joint in counted else scale
        factor = size * unit.factor
        return replace(column, unit=unit, factor=factor, offset=offset / factor)
    unread = unread_unit(name, (*known.motors, *known.joints))
    is_scaled = kind in ANGULAR and column.joint in known.scales
    is_share = column.kind == "tau" and _SHARE.search(unread)  # a gain converts it
    if unread and not (is_scaled or is_share) and known.columns.apply(name) == name:
        raise LogError(_describe_unread(column, kind, unread, source))
    # A scale of ±1 states a direction, and degrees stay degrees; other scales are for ticks.
    degrees = kind in ANGULAR and column.joint in known.degrees and abs(scale) == 1.0
    factor = scale * DEGREE if degrees else scale
    return replace(column, factor=factor, offset=offset / factor)


def _describe_unread(column: Column, kind: str, unread: str, source: str) -> str:
    """Return the sentence that refuses an unknown unit, with the remedy."""
    name = column.source.strip()
    example = next(u for u, (what, _) in UNITS.items() if what == DIMENSIONS[kind][0])
    gain = (
        f"state one unit in N·m or N ([torque] gain = {{{toml_key(column.joint)} = …}} in "
        f"the sidecar) and add {_map_word(name, column.name)}"
    )
    return (
        f"{source}: the column '{name}' states the unit '{unread}', which is not known; "
        f"say in which one {column.name} is given, as in "
        f"{_map_word(name, f'{column.name} [{example}]')}, "
        f"or {gain if column.kind == 'tau' else 'correct the header'}."
    )


def _convert_torque(
    columns: Sequence[Column], joints: Sequence[str], known: Conventions, source: str
) -> tuple[list[Column], list[str]]:
    """Return columns with torque in N·m or N at the joints, and how it was read.

    Raises
    ------
    LogError
        If a current or a share of rated torque has no gain, or a motor's torque no ratio.
    """
    torque = known.torque
    both = [j for j in joints if torque.side_of(j) == "both"]
    if both:
        columns = _convert_motors(columns, both, known)
    given = {c.joint: c for c in columns if c.kind == "tau" and c.joint in {*joints} - {*both}}
    _refuse_other_names(given, known, source)
    free = {j: c for j, c in given.items() if torque.at("gain", j) is None}
    loose = [j for j, c in free.items() if _SHARE.search(c.source.replace(j, ""))]
    lacking = "columns.share"
    if not loose:
        loose = [j for j, c in free.items() if c.current]
        lacking = "columns.gain" if set(loose).isdisjoint(known.motors) else "columns.constant"
    if not loose:
        before = [j for j in given if j not in known.motors and torque.side_of(j) == "motor"]
        loose = [j for j in before if torque.at("ratio", j) is None]
        lacking = "columns.ratio"
    if loose:
        raise LogError(Finding(lacking, source, joints=loose, first=toml_key(loose[0])))
    factors = {j: torque.factor(j) for j in given}
    out = [
        replace(c, factor=c.factor * factors[c.joint]) if c is given.get(c.joint) else c
        for c in columns
    ]
    changed = {j: f"{j}: {f:.6g}" for j, f in factors.items() if f != 1.0 or given[j].current}
    currents = all(given[j].current for j in changed)
    what = "torques are currents times" if currents else "torques were multiplied by"
    said = listing(changed.values(), 4)
    notes = [f"{what} their gain, ratio and sign ({said})"] if changed else []
    links = [j for j in joints if torque.side_of(j) == "link"]
    if links:
        notes.append(phrase("reading", "link", joints=links))
    if both:
        notes.append(phrase("reading", "both", joints=both))
    return out, notes


def _refuse_other_names(given: Mapping[str, Column], known: Conventions, source: str) -> None:
    """Refuse gains or signs of which none is about a torque column of the log.

    A robot with a transmission has names of joints and of motors, and a log has those of one.
    """
    for key in ("gain", "sign") if known.motors and given else ():
        names = [*known.torque.table(key)]
        if names and {"", *given}.isdisjoint(names):
            raise LogError(Finding("columns.other", source, columns=[*given], key=key, names=names))


def _convert_motors(
    columns: Sequence[Column], joints: Collection[str], known: Conventions
) -> list[Column]:
    """Return columns with torque and position of motors as their joints see them.

    Gain and ratio of these joints are those of the motor's columns. A link torque keeps its unit,
    and the sign holds for both.
    """
    torque = known.torque
    out = []
    for c in columns:
        factor = 1.0
        if c.joint in joints and c.kind == "tau_m":
            factor = torque.factor(c.joint)
        elif c.joint in joints and c.kind == "tau":
            factor = torque.at("sign", c.joint) or 1.0
        elif c.joint in joints and c.kind == "q_m":
            factor = 1.0 / (torque.at("ratio", c.joint) or 1.0)
        out.append(replace(c, factor=c.factor * factor))
    return out


def _tell_angles(joints: Sequence[str], known: Conventions) -> list[str]:
    own = [f"{j}: {s:.6g}, {o:.6g}" for j, (s, o) in known.scales.items() if j in joints]
    told = f"positions were scaled and shifted as the sidecar says ({listing(own, 4)})"
    notes = [told] if own else []
    if any(j in known.degrees and j not in known.scales for j in joints):
        notes.append("angles were read as degrees")
    unused = [j for j in known.scales if j in known.joints and j not in joints]
    if unused and {*joints} <= {*known.motors}:
        notes.append(
            f"[columns] of {listing(unused, 4)} was not used, as the log has motors: state their "
            "zero and scale there, or the joints' positions at that zero as [transmission] offset"
        )
    return notes


def _tell(
    names: Mapping[str, str], own: Sequence[Column], wanted: Sequence[str], how: str
) -> list[str]:
    """Return notes on renamed columns and converted units, half a sentence each."""
    used = {c.source for c in own}
    left = [n for column, n in names.items() if column not in used and _kind(n) in CHANNELS]
    renamed = [f"{a.strip()} is {b}" for a, b in names.items() if a.strip() != b]
    undriven = [*dict.fromkeys(_owner(n) for n in left if _owner(n) not in wanted)]
    converted = [f"{c.name} from {c.unit.text}" for c in own if c.unit and c.unit.factor != 1.0]
    understood = [
        f"{'its index' if c.source == INDEX else repr(c.source)} as {c.name}"
        for c in own
        if not c.literal
    ]
    told = {
        "columns were renamed ({})": renamed,
        f"columns were read by the usual meaning of their names: {{}}{how}": understood,
        "columns of {}, which the robot does not drive, were left out": undriven,
        "values were converted to SI units, as the log states them: {}": converted,
    }
    return [text.format(listing(found, 4)) for text, found in told.items() if found]


# Columns that identify their joint by a number: ``q1`` … ``q6``, ``position[0]``.


def resolve_numbers(
    guesses: Sequence[Column],
    source: str,
    known: Conventions,
    names: Mapping[str, str],
    first: Mapping[str, str],
) -> tuple[list[Column], str]:
    """Return the guesses with joints instead of numbers, if the assignment is certain.

    Other columns may hold the joints' names (``name0``, as recorders of ROS write). Else the
    numbers count the robot's joints in its order, from 0 or from 1.

    Parameters
    ----------
    guesses : sequence of Column
    source : str
        Name of the table in messages.
    known : Conventions
    names : mapping of str to str
        Columns and their new names.
    first : mapping of str to str
        Texts in the first row.

    Returns
    -------
    guesses : list of Column
    how : str
        Explanation for a note, which follows the list of columns.

    Raises
    ------
    LogError
        If the numbers do not match the joints, or the numbers in the joints' names have another
        order.
    """
    told = [g for g in guesses if g.joint or g.kind == "t"]
    loose = [g for g in guesses if g not in told]
    labels = _labels(names, first) if loose else {}
    if labels:
        owners = {number: known.columns.apply(text) for number, text in labels.items()}
        out = [replace(g, joint=owners[g.number]) for g in loose if g.number in owners]
        how = " (the names that stand in the log say which joint it is)"
        return [*told, *out], how
    named = {g.name for g in told}
    found = []
    for kind in CHANNELS:
        own = [g for g in loose if g.kind == kind]
        if own and not {f"{j}.{kind}" for j in known.joints} <= named:
            found += _in_order(own, source, known)
    numbered = known.as_listed == known.joints and any(g.number >= 0 for g in found)
    return [*told, *found], " (in the robot's order)" if numbered else ""


def _tell_order(taken: Iterable[Column], source: str, known: Conventions) -> list[Finding]:
    """Return in which order numbers count joints, if the file has two."""
    counted: dict[str, list[str]] = {}
    numbered = (c for c in taken if c.number >= 0 and c.joint in known.joints)
    for column in sorted(numbered, key=lambda c: c.number):
        counted.setdefault(column.kind, []).append(column.joint)
    if not counted or known.as_listed == known.joints:
        return []
    each = []
    for kind, joints in counted.items():
        if kind in ("q", "q_ref", "tau"):
            each.append(phrase("order", kind, actuators=tuple(joints) == known.joints))
    return [Finding("order", source, each=each)]


def _labels(names: Mapping[str, str], first: Mapping[str, str]) -> dict[int, str]:
    """Return the names of joints in the first row, by their number."""
    words = {column: words_of(name) for column, name in names.items() if column in first}
    told = {c: w for c, w in words.items() if len(w) > 1 and w[-2] in words_for("name")}
    return {int(w[-1]): first[c].strip() for c, w in told.items() if w[-1].isdecimal()}


def _in_order(loose: Sequence[Column], source: str, known: Conventions) -> list[Column]:
    """Return guesses of one channel with the joints of the robot's order, if all are there."""
    numbers = {g.number for g in loose}
    kind = loose[0].kind
    if len(known.joints) == 1 and numbers == {-1}:
        return [replace(g, joint=known.joints[0]) for g in loose]
    if -1 in numbers:
        return []
    order = known.as_listed if known.by_file[kind not in MOTIONS] else known.joints
    order = known.listed if len(numbers) == len(known.listed) > len(order) else order
    start = min(numbers)
    count = len(order)
    own = [_number(joint) for joint in order]
    ordered = None in own or len({*own}) < count or own == sorted(own, key=lambda n: n or 0)
    if start in (0, 1) and numbers == set(range(start, start + count)) and ordered:
        return [replace(g, joint=order[g.number - start]) for g in loose]
    if kind not in ("q", "tau"):
        return []
    columns = [g.source for g in loose]
    lock = option_for_shell("--lock", known.joints[-1], always=True)
    lacks = f" If joints that are not in the log stand still, lock them: {lock}."
    fewer = lacks if len(numbers) < len(known.joints) else ""
    more = f", and {len(known.listed)} with all others" if len(known.listed) > count else ""
    raise LogError(
        f"{source} numbers its joints differently from the robot ({listing(columns)}; the "
        f"robot has {len(known.joints)}: {listing(known.joints)}{more}); say which is which, as in "
        f"{_map_word(columns[0], f'{known.joints[0]}.{kind}')}.{fewer}"
    )


def _number(joint: str) -> int | None:
    found = re.findall(r"\d+", joint)
    return int(found[-1]) if found else None


# Columns of commands, which replace torque if a table has none.


def resolve_commands(
    taken: dict[str, Column],
    names: Mapping[str, str],
    source: str,
    known: Conventions,
    *,
    torque: bool,
) -> bool:
    """Return whether commands replace torque; remove those that most joints lack.

    A joint without a command among joints with commands moves as measured.

    Raises
    ------
    LogError
        If a robot with servos has neither torque nor command, or the law of commands is not known.
    """
    if not known.joints or known.motion_alone:
        return False
    given = [c for c in taken.values() if c.kind in COMMANDS]
    told = [repr(c.source) for c in given if c.kind in ("q_ref", "dq_ref")]
    # Who has commands for most joints needs the servos first, whatever else is missing.
    if known.servo is None and not torque and 2 * len(told) >= len(known.joints):
        if known.base is None:
            raise LogError(Finding("columns.servo", source, commands=told))
        raise LogError(Finding("columns.stand", source, commands=told, body=known.base.body))
    lost = {}
    for kind in dict.fromkeys(c.kind for c in given):
        has = [c.joint for c in given if c.kind == kind]
        own = known.motors if {*has} & {*known.motors} else known.joints
        lost[kind] = [j for j in own if j not in has]
        if kind == "q_ref" and not torque and len(lost[kind]) <= len(has):
            moves = [j for j in lost[kind] if f"{j}.q" in taken]
            taken.update({f"{j}.q_ref": replace(taken[f"{j}.q"], kind=kind) for j in moves})
            lost[kind] = [j for j in lost[kind] if j not in moves]
        for joint in has if lost[kind] else ():
            del taken[f"{joint}.{kind}"]
    if torque:
        return False
    if known.servo is not None and not any(c.kind in COMMANDS for c in taken.values()):
        joints = next((j for j in lost.values() if j), known.joints)
        missing = [f"{j}.cmd" for j in joints]
        raise LogError(
            tell_missing(source, missing, known.joints, _free(names, taken), known.listed)
        )
    left = {c.kind for c in taken.values()}
    return known.servo is not None and not left.isdisjoint(("q_ref", "dq_ref"))


# Missing columns, with a remedy that can be copied.


def _refuse_missing(
    names: Mapping[str, str], taken: Mapping[str, Column], source: str, known: Conventions
) -> NoReturn:
    """Refuse a log that lacks needed columns, and list the columns that it has.

    Raises
    ------
    LogError
    """
    measured = {n: c for n, c in taken.items() if c.kind not in COMMANDS}
    own = (*known.joints, *known.motors)
    free = [n for n in _free(names, measured) if _kind(n) not in SPELLED or _owner(n) not in own]
    every = listing(list(names.values()))
    if "t" not in taken:
        likely = [n for n in free if n.casefold().startswith("time")]
        renames = _map_word([*likely, "OLD"][0], "t")
        raise LogError(
            Finding(
                "columns.time",
                source,
                columns=every,
                rename=renames,
            )
        )
    has = [*dict.fromkeys(c.joint for c in measured.values() if c.kind in ("q", "tau"))]
    wanted = known.motors if {*has} & {*known.motors} else known.joints or has or ["<joint>"]
    missing = [n for j in wanted for n in (f"{j}.q", f"{j}.tau") if n not in taken]
    if wanted == known.motors and {f"{j}.q" for j in known.joints} <= {*taken}:
        missing = [n for n in missing if _kind(n) == "tau"]
        wanted = ()  # no motor can be locked
    likely = [n for n in free if _may_be(n, missing) and "wrench" not in words_of(n)]
    raise LogError(tell_missing(source, missing, wanted, likely, known.listed))


#: Remedy if no remaining column could be a missing one.
RECORD = " Log what is missing, too: no mass follows from positions alone."


def tell_missing(
    source: str,
    missing: Sequence[str],
    wanted: Sequence[str],
    free: Sequence[str],
    listed: Sequence[str] = (),
) -> Finding:
    """Return the refusal of a log that lacks columns, with options that lock the joints.

    Parameters
    ----------
    source : str
        Name of the log in sentences.
    missing : sequence of str
        Columns that the log lacks.
    wanted : sequence of str
        Joints that a log needs columns of.
    free : sequence of str
        Columns that were taken for nothing.
    listed : sequence of str
        All joints of the robot file; no option may lock those that are not missing.
    """
    joints = list(dict.fromkeys(map(_owner, missing)))
    moving = [j for j in (*wanted, *listed) if j not in joints]
    patterns = find_patterns(joints, moving)
    options = [option_for_shell("--lock", text, always=True) for text in patterns]
    others = listing(dict.fromkeys(_owner(n) if _kind(n) in SPELLED else n for n in free))
    spelled = any(_CHANNELS_SAY.intersection(words_of(n)[-1:]) for n in free)
    first = joints[0] if spelled and len(missing) == 2 * len(joints) else missing[0]
    some = len(joints) < len(wanted)  # where all miss some, their names are others
    option = f"{_map_word('OLD', first)}, or name it under [columns] in the sidecar"
    maps = f" If one of {others} is it, add {option}." if free else RECORD
    options_in_order = _name_missing(missing, free)
    if options_in_order and not spelled:
        maps = f" {phrase('columns.missing', 'order', maps=options_in_order)}"
    if free and _kind(first) == "tau":
        maps += f" {phrase('columns.missing', 'currents')}"
    if _have_both_sides(free, joints):
        maps = f" {phrase('columns.missing', 'both')}"
    near = near_match(missing[0], [n for n in free if _may_name(n, _kind(missing[0]))])
    return Finding(
        "columns.missing",
        source,
        missing=listing(missing, 4),
        near=near,
        locks=f" Lock joints that do not move: {' '.join(options)}." if some else "",
        maps=maps,
    )


def _may_name(column: str, kind: str) -> bool:
    """Return whether a word of a column is, but for its spelling, one of a quantity."""
    known = CHANNEL_WORDS.get(kind)
    return known is None or any(nearest(word, known) for word in words_of(column))


def _may_be(name: str, missing: Sequence[str]) -> bool:
    """Return whether the unit in the name of a column suits one of the missing columns."""
    unit = split_unit(name)[1]
    kinds = {_kind(column) for column in missing}
    if unit is None or not kinds <= DIMENSIONS.keys():
        return True
    if "tau" in kinds:
        kinds.add("current")
    return any(unit.dimension in DIMENSIONS[kind] for kind in kinds)


def _name_missing(missing: Sequence[str], free: Sequence[str]) -> str:
    """Return options that rename free columns to missing ones, by their joints or in order.

    Nothing if there are not as many positions and torques of each. If all missing ones are of one
    kind, columns that begin as the first one does may be them.
    """
    rules = list[tuple[str, str]]()
    measured = [n for n in free if COMMANDED.isdisjoint(words_of(n))]
    for kind in ("q", "tau"):
        wanted = [_owner(n) for n in missing if _kind(n) == kind]
        likely = [n for n in measured if kind in map(KINDS.get, words_of(n))]
        if not likely and len(wanted) == len(missing):
            likely = [n for n in measured if words_of(n)[:1] == words_of(measured[0])[:1]]
        if len(wanted) != len(likely):
            return ""
        rules += _rename_in_turn(kind, wanted, likely)
    return " ".join(option_for_shell("--map", "=".join(rule), always=True) for rule in rules)


def _rename_in_turn(
    kind: str, wanted: Sequence[str], likely: Sequence[str]
) -> Iterator[tuple[str, str]]:
    """Yield rules that make columns those of as many joints, with the unit of the first."""
    named = {take_joint(words_of(n), wanted)[0]: n for n in likely}
    pairs = zip(wanted, likely, strict=True)
    columns = {j: [Column(named.get(j, n), kind, j, number=0)] for j, n in pairs}
    unit = last_unit(words_of("".join(likely[:1])))
    end = f" [{unit.text}]" if unit and unit.dimension in DIMENSIONS[kind] else ""
    for old, new in propose_rules(kind, columns):
        yield old, new + end


def _have_both_sides(names: Iterable[str], joints: Sequence[str]) -> bool:
    """Return whether columns are of torque on both sides of a gear, by their names."""
    guesses = (_guess_side(name, name, joints) for name in names)
    return {"tau", "tau_m"} <= {guess.kind for guess in guesses if guess is not None}


def _map_word(old: str, new: str) -> str:
    """Return the option that renames a column, as a sentence shows it."""
    return option_for_shell("--map", name_rule(old.strip(), new), always=True)


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def _kind(name: str) -> str:
    return name.rpartition(".")[2]


def rename(name: str, known: Conventions) -> str:
    """Return a column by its new name, or by its joint's."""
    renames = known.columns
    whole = renames.apply(name)
    if whole != name or not renames:
        return whole
    plain, _ = split_unit(name)
    parts = [renames.apply(part) for part in plain.split("/")]
    cut = _CHANNEL_LAST.fullmatch(parts[-1])
    owner, _, end = parts[-1].rpartition(".")
    if owner and _CHANNELS_SAY.issuperset(words_of(end)):
        parts[-1] = f"{renames.apply(owner)}.{end}"
    elif cut and cut["kind"].casefold() in _CHANNELS_SAY:
        parts[-1] = renames.apply(cut["joint"]) + cut["between"] + cut["kind"]
    return "/".join(parts) + name[len(plain) :]


def resolve_codes(naming: Naming, first: pd.DataFrame, known: Conventions) -> Naming:
    """Return the columns of a log, with the number codes that its first rows show.

    If they show none, the codes of other logs hold.
    """
    values = {c.name: to_floats(first[c.source]) for c in naming.columns if c.name != "t"}
    shown = show_codes(values)
    codes = find_codes(values, {**known.codes, **shown})
    columns = tuple(replace(c, code=codes.get(c.name)) for c in naming.columns)
    notes = (*naming.notes, *describe_codes(codes))
    return replace(naming, columns=columns, notes=notes, codes=shown)


# Unit of a log's times: seconds, fractions of them, or dates; taken only if it is certain.
#
# A unit that the sidecar, an option or the column states is taken. Else steps up to half a second
# are in seconds. Longer steps are in the one unit in which they are steps of a log of motion.


#: First samples that show which steps there are.
SHOWN = 20_000


def resolve_time(naming: Naming, first: pd.DataFrame, source: str, known: Conventions) -> Naming:
    """Return the columns of a log, with the conversion of its times to seconds.

    Parameters
    ----------
    naming : Naming
    first : DataFrame
        Its first rows.
    source : str
        Name of the table in messages.
    known : Conventions


    Raises
    ------
    LogError
        If the times may be in more than one unit.
    """
    time = naming.time
    given = first[time.source]
    dates = as_dates(given, 0)
    if dates is not None and len(dates):
        what = "durations" if given.dtype.kind == "m" else "dates"
        note = f"the times are {what}, and were read in seconds from the first"
        return naming.timed(note, dates=int(dates.iloc[0]), factor=1.0)
    t = to_floats(given)[:SHOWN] if given.dtype.kind not in "cb" else np.empty(0)
    if len(t) < 3 or not np.isfinite(t).all() or not np.median(np.diff(t)) > 0:
        return naming  # other checks report their errors
    unit = known.time_unit
    why = "as was said"
    if not unit and time.unit is None:  # the unit of the log is taken
        unit, why = _find_unit(t, source)
    factor = TIME_UNITS[unit] if unit else time.factor
    notes = [f"the times are in {unit}, {why}"] if unit and unit != "s" else []
    dated = _is_dated(t[0] * factor)
    if dated:
        notes.append("the times count from 1970, and were read from the first on")
    return naming.timed(*notes, factor=factor, offset=float(t[0]) if dated else 0.0)


def start_of(naming: Naming) -> float | None:
    """Return the origin of a log's times in seconds since 1970; None if it is not known."""
    time = naming.time
    seconds = time.offset * time.factor if time.dates is None else time.dates * 1e-9
    return seconds if _is_dated(seconds) else None


def _is_dated(seconds: float) -> bool:
    """Return whether seconds can count from 1970."""
    return RULES.epoch[0] < seconds < RULES.epoch[1]


_POINTED = re.compile(r"^(\d{1,2})\.(\d{1,2})\.(\d{4})[T ]+")
_OF_A_DAY = re.compile(r"\d{1,2}:\d\d:\d\d(?:\.\d+)?")


def _as_iso(date: re.Match[str]) -> str:
    return f"{date[3]}-{int(date[2]):02d}-{int(date[1]):02d} "


def as_dates(given: pd.Series, start: int) -> pd.Series | None:
    """Return dates, durations, or texts of either, in ns after `start`, as integers.

    Texts may be in ISO 8601, dates with points (the day first), or times of a day. Fractions of a
    second may follow a comma. The result is None if some values are of another kind.
    """
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if given.dtype.kind not in "mMOUST" or pd.api.types.is_numeric_dtype(given):
        return None
    times = given
    if given.dtype.kind not in "mM":
        if not given.map(lambda x: isinstance(x, str)).all() or np.isfinite(to_floats(given)).any():
            return None
        texts = given.str.strip().str.replace(r"(?<=:\d\d),(?=\d+$)", ".", regex=True)
        texts = texts.str.replace(_POINTED, _as_iso, regex=True)
        times = pd.to_datetime(
            texts,
            format="ISO8601",
            errors="coerce",
            utc=True,
        )
        if times.isna().all() and texts.str.fullmatch(_OF_A_DAY).all():
            times = pd.to_timedelta(texts)
    if times.isna().any():
        return None
    if getattr(times.dtype, "tz", None) is not None:
        times = times.dt.tz_convert(None)
    kind = "timedelta64[ns]" if times.dtype.kind == "m" else "datetime64[ns]"
    return pd.Series(times.to_numpy(kind).astype(np.int64) - start)


def as_times(given: pd.Series, time: Column) -> pd.Series:
    """Return a column of times in seconds; unchanged if it does not hold times."""
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if time.dates is not None:
        dates = as_dates(given, time.dates)
        return given if dates is None else dates * 1e-9
    if time.factor == 1.0 and not time.offset:
        return given
    times = to_floats(given)
    if np.isnan(times).any():
        return given
    return pd.Series(time.scale(times))


def _find_unit(t: Array, source: str) -> tuple[str, str]:
    """Return the unit of times (N,) and why; nothing for seconds.

    Raises
    ------
    LogError
        If it may be more than one.
    """
    step = float(np.median(np.diff(t)))
    if step <= RULES.steps[1]:
        return "", ""
    fits = [u for u, size in TIME_UNITS.items() if RULES.steps[0] <= step * size <= RULES.steps[1]]
    fits = [u for u in fits if _is_dated(t[0] * TIME_UNITS[u])] or fits
    if not fits:  # other checks report their errors
        return "", ""
    each = [f"{u} ({1 / (step * TIME_UNITS[u]):.4g} Hz)" for u in fits]
    if len(fits) == 1:
        why = f"for they rise by {step:.6g} from sample to sample: {each[0]}"
        return fits[0], f"{why} (--set time_unit=s if they are seconds)"
    raise LogError(
        Finding(
            "clock.unit",
            source,
            step=step,
            units=" or ".join(each),
        )
    )
