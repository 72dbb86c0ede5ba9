"""Which column of a table is what: its joint and channel, whatever the table calls it.

By names, by numbers (``q1`` … ``q6``, ``position[0]``, ``qpos[7]``), or as the user maps them;
what is missing is said with the remedy ready to copy.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field, replace
from os.path import commonprefix
from typing import NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array, Renames
from identifiability.foundation.values import frozen
from identifiability.logs.aliases import (
    CHANNEL_WORDS,
    COMMANDED,
    INDEX,
    KINDS,
    SILENT,
    Guess,
    Unit,
    find_unit,
    guess_column,
    split_unit,
    take_joint,
    unread_unit,
    words_for,
    words_of,
)
from identifiability.logs.checks import CHANNELS, find_joints
from identifiability.logs.conventions import Conventions

# Sentences about columns that a log lacks, with the remedy ready to copy.


#: Pairs of names that a sentence proposes, at most.
MOST = 3


def several(source: str, name: str, what: str, columns: Sequence[str]) -> str:
    """Return the sentence on several columns that may be one."""
    return (
        f"{source} has several columns that may be {what}: {listing(columns, 6)}; say which it is, "
        f"as in --map '{columns[0].strip()}={name}'."
    )


def refuse_missing(
    names: Mapping[str, str],
    meant: Mapping[str, str],
    source: str,
    known: Conventions,
    works: Callable[[dict[str, str]], bool],
) -> NoReturn:
    """Refuse a log that lacks what is needed, and say what it has instead.

    Parameters
    ----------
    names : mapping of str to str
        Its columns and what they are renamed to.
    meant : mapping of str to str
        Columns that are understood, and what they are.
    source : str
        What sentences call the table.
    known : Conventions
    works : callable(dict) -> bool
        Whether the log could be read with another rule for its names.

    Raises
    ------
    LogError
    """
    taken = set(meant.values())
    columns = [meant.get(column, name) for column, name in names.items()]
    if "t" not in taken:
        find_joints(columns, source)  # it says which column may be the time
    missing = [j for j in known.joints if not {f"{j}.q", f"{j}.tau"} & taken]
    strange = _strangers([c for c in columns if c not in taken], known)
    if missing and strange:
        _refuse_strangers(missing, strange, source, known, len(missing) < len(known.joints))
    before = _before(columns)
    if before and works({f"{re.escape(before)}(.*)": r"\1"}):
        raise LogError(
            f"{source} has no columns for the actuated joints {listing(missing)}, but for others "
            f"whose names begin with '{before}'; if these are they, add --map "
            rf"'{re.escape(before)}(.*)=\1'."
        )
    half = [j for j in known.joints if f"{j}.q" in taken or f"{j}.tau" in taken]
    own = [n for n in columns if n.rpartition(".")[2] not in CHANNELS or _owner(n) in known.joints]
    if half:
        commands = [c for c in columns if {*words_of(c)} & {*COMMANDED} and _kind(c) == "tau"]
        if commands and not any(f"{j}.tau" in taken for j in known.joints):
            raise LogError(
                f"{source} has '{half[0]}.q' but no torque column '{half[0]}.tau'; "
                f"{listing(commands, 3)} tell by their names what was commanded, not what was "
                f"measured: if they are what you have, add --map '{commands[0]}={half[0]}.tau' and "
                "so on."
            )
        find_joints(own, source, known.joints)
    locks = propose_locks(missing, known.joints)
    told = " or '<joint>.cmd'" if known.servo else ""
    raise LogError(
        f"{source} has no columns for the actuated joint{'s' if len(missing) > 1 else ''} "
        f"{listing(missing)}; every actuated joint needs '<joint>.q' and '<joint>.tau'"
        f"{told}{locks or f'. It has the columns {listing(list(names))}'}."
    )


def may_be_torque(column: str, joint: str) -> bool:
    """Whether a column that is nothing else may be a joint's torque, misspelt or a command."""
    owner, _, kind = column.rpartition(".")
    if owner == joint:
        return kind not in CHANNELS
    words = {*words_of(column)}
    if {*words_of(joint)} <= words:
        return bool(words & {*COMMANDED} and _kind(column) == "tau") or not _kind(column)
    alike = bool(owner) and near_match(owner, [joint]).endswith("?")
    return alike and kind in ("tau", *CHANNEL_WORDS["tau"])


def _kind(column: str) -> str:
    """Return the channel that a word of a name is about, if one is."""
    return next((KINDS[w] for w in words_of(column) if w in KINDS), "")


def _before(columns: Sequence[str]) -> str:
    """Return what the names of all channels begin with, up to a sign."""
    channels = [c for c in columns if {*words_of(c)} & {*KINDS}]
    shared = commonprefix(channels)  # noqa: RUF071 - letters are meant
    return re.sub(r"[^._/ -]*$", "", shared)


def _strangers(columns: Sequence[str], known: Conventions) -> list[str]:
    """Return the joints of other names that a log has positions and torques of."""
    has: dict[str, set[str]] = {}
    for name in columns:
        owner, _, kind = name.rpartition(".")
        if owner and kind in CHANNELS and owner not in (*known.joints, *known.motors):
            has.setdefault(owner, set()).add(kind)
            continue
        found = re.match(r"(.*?)[._/ ]*([A-Za-z]+)$", name)
        guess = guess_column(name, f"{found[2]}1", ()) if found and found[1] else None
        if guess is not None and found is not None:
            has.setdefault(found[1].rpartition("/")[2], set()).add(guess.kind)
    return [owner for owner, kinds in has.items() if {"q", "tau"} & kinds]


def _refuse_strangers(
    missing: Sequence[str], strange: Sequence[str], source: str, known: Conventions, some: bool
) -> NoReturn:
    """Refuse a log that calls joints otherwise, and propose which is which.

    Where it has `some` of the joints by their own names, the others are of another device.
    """
    rule, others = _pattern(missing, strange)
    near = [(s, n) for s in strange if (n := near_match(s, missing)[:-1]).endswith("'")]
    of = "joint" if len(missing) == 1 else "joints"
    tells = (
        f"{source} has no columns for the actuated {of} {listing(missing)}, but for "
        f"{listing(strange)}, which the robot does not have"
    )
    if rule:
        rest = " ".join(f"--lock {name}" for name in others)
        locks = f", and if {listing(others)} does not move, {rest}" if others else ""
        raise LogError(f"{tells}; if these are they, add --map '{rule}'{locks}.")
    if near and len(missing) == 1:
        name, match = near[0]
        raise LogError(
            f"{source}: the column '{name}.q' names a joint that the robot does not have{match}? "
            f"Its actuated joints are {listing(known.joints)}; if it is that one, add --map "
            f"'{name}={missing[0]}'."
        )
    if some:
        locks = propose_locks(missing, known.joints)
        raise LogError(
            f"{tells}; every actuated joint needs '<joint>.q' (and '<joint>.tau' where its torque "
            f"was measured){locks}."
        )
    pairs = zip(strange, missing, strict=False)
    example = " ".join(f"--map '{old}={new}'" for old, new in list(pairs)[:MOST])
    raise LogError(
        f"{tells}; every actuated joint needs '<joint>.q' and '<joint>.tau': say which is which, "
        f"as in {example}."
    )


def _pattern(missing: Sequence[str], strange: Sequence[str]) -> tuple[str, list[str]]:
    """Return the rule by which other names differ from the robot's in what surrounds a number.

    Returns
    -------
    rule : str
        Empty if there is none, or several.
    others : list of str
        Joints that it does not find.
    """
    ours, theirs = _by_shape(missing), _by_shape(strange)
    pairs = [
        (len(numbers), around, other)
        for around, numbers in ours.items()
        for other, has in theirs.items()
        if len(numbers) > 1 and numbers <= has
    ]
    most = [pair for pair in pairs if pair[0] == max(pairs)[0]]
    if len(most) != 1:
        return "", []
    _, (before, after), (was_before, was_after) = most[0]
    numbers = ours[before, after]
    digits = r"(\d)" if all(len(n) == 1 for n in numbers) else r"(\d+)"
    rule = f"{re.escape(was_before)}{digits}{re.escape(was_after)}={before}\\1{after}"
    return rule, [n for n in missing if n not in {f"{before}{k}{after}" for k in numbers}]


def _by_shape(names: Sequence[str]) -> dict[tuple[str, str], set[str]]:
    """Return the last number of each name, by what stands before and behind it."""
    found: dict[tuple[str, str], set[str]] = {}
    for name in names:
        cut = re.fullmatch(r"(.*?)(\d+)(\D*)", name)
        if cut:
            found.setdefault((cut[1], cut[3]), set()).add(cut[2])
    return found


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def propose_locks(missing: Sequence[str], wanted: Sequence[str]) -> str:
    """Return what to write where joints that a log does not have stand still, or nothing."""
    if len(missing) == len(wanted):  # foreign names are likelier
        return ""
    they, line = ("it does", "it") if len(missing) == 1 else ("they do", "them")
    options = " ".join(f"--lock {name}" for name in missing)
    names = ", ".join(f'"{name}"' for name in missing)
    return f". If {they} not move, lock {line}: {options}, or locked = [{names}] in the sidecar"


# Columns that tell their joint by a number: ``q1`` … ``q6``, ``position[0]``, ``qpos[7]``.


#: Arrays of MuJoCo; of several with torques the first that is there is taken.
ARRAYS = ("qpos", "qvel", "qacc", "qfrc_actuator", "actuator_force", "ctrl")
_ENTRY = re.compile(rf"(.*?)[./_ ]*(?<![A-Za-z])({'|'.join(ARRAYS)})[./_ ]*(.*)")
_BEFORE = {"data", "d", "mjdata", "mj", "sim", "state", "log"}


def find_entries(names: Mapping[str, str], known: Conventions) -> dict[str, Guess | None]:
    """Return the columns that are called as MuJoCo calls its arrays, and what they are; or None.

    Parameters
    ----------
    names : mapping of str to str
        Columns and what they are renamed to.
    known : Conventions
    """
    found: dict[str, tuple[str, str]] = {}
    for column, name in names.items():
        match = _ENTRY.fullmatch(split_unit(name)[0]) if known.entries else None
        if match:
            before = "" if _BEFORE.issuperset(words_of(match[1])) else match[1]
            found[column] = match[2], before.rpartition("/")[2] or match[3].strip("[]() ")
    out: dict[str, Guess | None] = {}
    for column, (array, key) in found.items():
        keys = {k for a, k in found.values() if a == array}
        from_one = "0" not in keys and "1" in keys and all(k.isdecimal() for k in keys)
        if from_one:
            key = str(int(key) - 1)  # noqa: PLW2901
        own = known.entries.get(f"{array}@{len(keys)}", known.entries.get(array, {}))
        entry = own.get(key)
        joint, _, kind = entry.column.rpartition(".") if entry else ("", "", "")
        unit = split_unit(names[column])[1]
        out[column] = Guess(column, kind, joint, -1, unit, entry=entry) if entry else None
    used = {}  # the first array that states a torque
    for column, (array, _) in found.items():
        guess = out[column]
        if guess is not None and guess.kind == "tau":
            used[column] = ARRAYS.index(array)
    return {c: g for c, g in out.items() if c not in used or used[c] == min(used.values())}


def settle_numbers(
    guesses: Sequence[Guess],
    source: str,
    known: Conventions,
    names: Mapping[str, str],
    first: Mapping[str, str],
) -> tuple[list[Guess], dict[str, str], str]:
    """Return the guesses with joints instead of numbers, as far as that is certain.

    Columns beside them may hold the joints' names (``name0``, as recorders of ROS write); else the
    numbers count the robot's joints in its order, from 0 or from 1.

    Parameters
    ----------
    guesses : sequence of Guess
    source : str
        What sentences call the table.
    known : Conventions
    names : mapping of str to str
        Columns and what they are renamed to.
    first : mapping of str to str
        Texts in the first row.

    Returns
    -------
    guesses : list of Guess
    labels : dict of str to str
        Columns with names of joints that were followed.
    how : str
        What a note says of it, to be added to a list of columns.

    Raises
    ------
    LogError
        If there are other numbers than joints, or the joints' own numbers have another order.
    """
    loose = [g for g in guesses if not g.joint and g.kind in CHANNELS]
    told = [g for g in guesses if g.joint or g.kind == "t"]
    of = {(g.joint, g.kind) for g in told}
    named = {joint for joint, _ in of if {(joint, "q"), (joint, "tau")} <= of}
    if not loose or named.issuperset(known.joints):
        return told, {}, ""
    labels = _labels(names, first)
    if labels:
        owners = {number: known.columns.apply(text) for number, (_, text) in labels.items()}
        out = [replace(g, joint=owners[g.number]) for g in loose if g.number in owners]
        followed = dict(labels.values())
        return [*told, *out], followed, " (the names that stand in the log say which joint it is)"
    if len(known.joints) == 1 and all(g.number < 0 for g in loose):
        return [*told, *(replace(g, joint=known.joints[0]) for g in loose)], {}, ""
    return [*told, *_in_order(loose, source, known)], {}, " (in the robot's order)"


def _labels(names: Mapping[str, str], first: Mapping[str, str]) -> dict[int, tuple[str, str]]:
    """Return column and text of the names of joints, by their number."""
    found = {}
    for column, name in names.items():
        words = words_of(name)
        if (
            column in first
            and len(words) > 1
            and words[-2] in words_for("name")
            and words[-1].isdecimal()
        ):
            found[int(words[-1])] = (column, first[column].strip())
    return found


def _in_order(loose: Sequence[Guess], source: str, known: Conventions) -> list[Guess]:
    """Return the guesses with the joints of the robot's order."""
    numbers = {kind: {g.number for g in loose if g.kind == kind} for kind in CHANNELS}
    count = len(known.joints)
    needed = [kind for kind in ("q", "tau") if numbers[kind]]
    if not needed or -1 in numbers["q"] | numbers["tau"]:
        return []
    start = min(numbers[needed[0]])
    all_of_them = set(range(start, start + count))
    if start not in (0, 1) or any(numbers[kind] != all_of_them for kind in needed):
        columns = [g.source for g in loose if g.kind in needed]
        raise LogError(
            f"{source} numbers its joints otherwise than the robot has them ({listing(columns)}; "
            f"the robot has {count}: {listing(known.joints)}); say which is which, as in "
            f"--map '{columns[0].strip()}={known.joints[0]}.{needed[0]}'."
        )
    own = [_number(joint) for joint in known.joints]
    if None not in own and len({*own}) == count and own != sorted(own, key=lambda n: n or 0):
        columns = [g.source for g in loose if g.kind == "q"]
        raise LogError(
            f"{source} numbers its joints ({listing(columns)}), and the robot's order, "
            f"{listing(known.joints)}, is not that of its own numbers; say which is which, as in "
            f"--map '{columns[0].strip()}={known.joints[0]}.q'."
        )
    return [
        replace(g, joint=known.joints[g.number - start])
        for g in loose
        if numbers[g.kind] == all_of_them
    ]


def _number(joint: str) -> int | None:
    found = re.findall(r"\d+", joint)
    return int(found[-1]) if found else None


# Which column of a table is what: its joint and channel, whatever the table calls it.


#: A unit of each channel, for sentences.
EXAMPLES = {"t": "ms", "q": "deg", "q_ref": "deg", "dq": "deg/s", "ddq": "deg/s2", "tau": "Nm"}
EXAMPLES |= {"dq_ref": "deg/s", "tau_ff": "Nm"}
EXAMPLES |= {"current": "A"}

#: A joint's name and a word for its channel.
_CHANNEL_LAST = re.compile(r"(?P<joint>.+?)(?P<between>[._\- ]+)(?P<kind>[A-Za-z]+)")
_CHANNELS_SAY = {*KINDS, *COMMANDED, "ff"}


@frozen
class Column:
    """One column of a log.

    Attributes
    ----------
    name : str
        ``t``, ``<joint>.q`` …
    source : str
        What the table calls it.
    factor : float
        From its values to SI units.
    offset : float
        What is taken from its values before.
    dates : int or None
        Of times that are dates, the first one [ns since 1970]; None for numbers.
    current : bool
        Whether it is the current of a motor, in the place of a torque.
    low, high : float
        Of its values, beyond which they act no further.
    """

    name: str
    source: str
    factor: float = 1.0
    offset: float = 0.0
    dates: int | None = None
    current: bool = False
    low: float = -np.inf
    high: float = np.inf

    @property
    def is_time(self) -> bool:
        """Whether it holds times that are no seconds."""
        return self.name == "t" and (self.factor, self.offset, self.dates) != (1.0, 0.0, None)

    def scale(self, values: Array) -> Array:
        """Return values of the table, (N,), in SI units."""
        values = values - self.offset if self.offset else values
        if self.low > -np.inf or self.high < np.inf:
            values = np.clip(values, self.low, self.high)
        return values if self.factor == 1.0 else values * self.factor


@frozen
class Naming:
    """What a log takes from a table.

    Attributes
    ----------
    columns : tuple of Column
        In the order of the table.
    joints : tuple of str
    notes : tuple of str
        What is read otherwise than literally, half a sentence each.
    locked : tuple of Column
        Positions of joints that are locked, which a log may contradict.
    labels : mapping of str to str
        Columns of text that say which joint the others are about, with that text.
    """

    columns: tuple[Column, ...]
    joints: tuple[str, ...]
    notes: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    locked: tuple[Column, ...] = ()


def name_columns(
    found: Sequence[str],
    source: str,
    known: Conventions,
    units: Mapping[str, str] | None = None,
    first: Mapping[str, str] | None = None,
    *,
    currents: Collection[str] = (),
    made: Collection[str] = (),
    proposed: bool = False,
) -> Naming:
    """Return what a log takes from the columns of a table.

    Parameters
    ----------
    found : sequence of str
        What the table calls them.
    source : str
        What sentences call the table.
    known : Conventions
    units : mapping of str to str, optional
        Units of the table's own row of them.
    first : mapping of str to str, optional
        Texts in the first row, by column.
    currents : collection of str
        Those of them that are motor currents in the place of torques.
    made : collection of str
        Those of which nothing is said, as nobody gave them.
    proposed : bool
        Whether this only tries if a log could be read with a rule that nobody gave.

    Raises
    ------
    LogError
        If there is no time, a column that is needed is missing, there twice or ambiguous, or its
        unit is none of its channel's.
    """
    names = {name: rename(name.strip(), known) for name in found}
    notes = _tell_renamed(names)
    twice = [n for n, count in Counter(c.strip() for c in found).items() if count > 1]
    if known.joints and not twice and not _needed(list(names.values()), known):
        return _name_otherwise(
            names, source, known, notes, units or {}, first or {}, proposed=proposed, made=made
        )
    columns = [
        Column(rename(name.strip(), known), name, current=name in currents) for name in found
    ]
    kept = _needed([c.name for c in columns], known)
    if kept:
        others = [c for c in columns if c.name != "t" and _owner(c.name) not in kept]
        columns = [c for c in columns if c not in others]
        notes += _tell_left([_owner(c.name) for c in others if _is_channel(c.name)])
    joints = find_joints([c.name for c in columns], source)
    wanted = {"t", *(f"{j}.{kind}" for j in joints for kind in CHANNELS)}
    columns = [c for c in columns if c.name in wanted]
    stated = {
        c.source: find_unit((units or {}).get(c.source, "")) or split_unit(c.source)[1]
        for c in columns
    }
    _refuse_unread([c for c in columns if stated[c.source] is None], source, known)
    naming = Naming(tuple(columns), tuple(joints), tuple(notes), locked=_find_locked(names, known))
    return _in_units(naming, stated, source)


def _find_locked(names: Mapping[str, str], known: Conventions) -> tuple[Column, ...]:
    """Return the columns that hold the positions of locked joints, and in which unit."""
    every = (*known.motors, *known.joints, *known.locked)
    guesses = [guess_column(c, n, every) for c, n in names.items()] if known.locked else []
    return tuple(
        Column(f"{g.joint}.q", g.source, g.unit.factor if g.unit else 1.0)
        for g in guesses
        if g is not None and g.kind == "q" and g.joint in known.locked
    )


def _name_otherwise(
    names: Mapping[str, str],
    source: str,
    known: Conventions,
    notes: list[str],
    units: Mapping[str, str],
    first: Mapping[str, str],
    *,
    proposed: bool,
    made: Collection[str],
) -> Naming:
    """Return what columns usually are that are called otherwise than they should be."""
    guesses = []
    entries = find_entries(names, known)
    own = (*known.motors, *known.joints, *known.locked)
    for column, name in names.items():
        plain, unit = split_unit(name)
        if column in entries:
            entry = entries[column]
            guesses += [entry] if entry else []
        elif plain == "t" or (_is_channel(plain) and _owner(plain) in own):
            owner, _, kind = plain.rpartition(".")
            guesses.append(Guess(column, kind, owner, -1, unit))
        else:
            guess = guess_column(column, name, own)
            guesses += [guess] if guess else []
    if not any(g.kind == "q" for g in guesses):
        guesses += _bare(names, own)
    if not any(g.kind == "tau" for g in guesses):
        guesses = [
            replace(g, kind="tau", current=g.kind == "current") if g.kind == "current" else g
            for g in guesses
        ]
    times = [g for g in guesses if g.kind == "t"]
    exact = [g for g in times if names[g.source] in ("t", "__time")]
    if len(times) > 1 and len(exact) != 1:
        raise LogError(several(source, "t", "the time", [g.source for g in times]))
    time = (exact or times)[:1]
    settled, labels, how = settle_numbers(guesses, source, known, names, first)
    taken = _choose(settled, known, source)
    wanted = _needed(["t", *taken], known)
    if time and not wanted:
        wanted = _needed(["t", *taken, *_unmeasured(names, taken, known)], known)
    if not time or not wanted:
        refuse_missing(
            names,
            {g.source: "t" for g in time} | {g.source: name for name, g in taken.items()},
            source,
            known,
            lambda rule: not proposed and _works(list(names), source, known, rule),
        )
    chosen = {
        f"{j}.{c}": taken[f"{j}.{c}"] for j in wanted for c in CHANNELS if f"{j}.{c}" in taken
    }
    chosen = {"t": time[0], **chosen}
    order = {column: k for k, column in enumerate(names)}
    ordered = sorted(chosen.items(), key=lambda item: order[item[1].source])
    columns = tuple(_column(name, g) for name, g in ordered)
    renamed = [
        c
        for c in columns
        if c.source not in made and c.name not in (names[c.source], split_unit(names[c.source])[0])
    ]
    called = [
        f"{'its index' if c.source == INDEX else repr(c.source)} as {c.name}" for c in renamed
    ]
    if called:
        notes = [
            *notes,
            f"columns were taken for what their names usually mean: {listing(called, 4)}{how}",
        ]
    geared = [f"'{c.source}' by {c.factor:.6g}" for c in columns if c.factor != 1.0]
    if geared:
        notes = [*notes, f"values were multiplied by the gears of the file: {listing(geared, 4)}"]
    left = [_owner(n) for n in names.values() if _is_channel(n) and _owner(n) not in wanted]
    left = [n for n in left if n not in (_owner(c.source.strip()) for c in columns)]
    stated = {
        g.source: g.unit or find_unit(units.get(g.source, "")) or split_unit(g.source)[1]
        for g in chosen.values()
    }
    _refuse_unread([c for c in columns if stated[c.source] is None], source, known)
    locked = [_column(n, g) for n, g in taken.items() if n.endswith(".q")]
    locked = [
        replace(c, factor=c.factor * (unit.factor if (unit := taken[c.name].unit) else 1.0))
        for c in locked
        if _owner(c.name) in known.locked
    ]
    naming = Naming(columns, tuple(wanted), (*notes, *_tell_left(left)), labels, tuple(locked))
    return _in_units(naming, stated, source)


def _bare(names: Mapping[str, str], joints: Sequence[str]) -> list[Guess]:
    """Return positions in columns that are called as a joint, or its number, and nothing else."""
    found = []
    for column, name in names.items():
        plain, unit = split_unit(name)
        joint, rest = take_joint(words_of(plain), joints)
        numbers = [int(w) for w in rest if w.isdecimal()]
        others = [w for w in rest if not w.isdecimal()]
        if SILENT.issuperset(others) and len(numbers) + bool(joint) == 1 and (joint or others):
            found.append(Guess(column, "q", joint, next(iter(numbers), -1), unit))
    return found


def _refuse_unread(columns: Sequence[Column], source: str, known: Conventions) -> None:
    """Refuse columns that state a unit which is not known.

    Raises
    ------
    LogError
    """
    for column in columns:
        name = column.source.strip()
        unit = unread_unit(name, (*known.motors, *known.joints))
        if unit and name not in dict(known.columns.rules):
            kind = "t" if column.name == "t" else column.name.rpartition(".")[2]
            example = EXAMPLES["current" if column.current else kind]
            raise LogError(
                f"{source}: the column '{name}' states the unit '{unit}', which is not known; say "
                f"in which one {column.name} is given, as in --map '{name}="
                f"{column.name} [{example}]'{_or_gain(column)}."
            )


def _or_gain(column: Column) -> str:
    owner, _, kind = column.name.rpartition(".")
    if kind != "tau":
        return ", or correct the header"
    return (
        f", or give what one of it is in N·m or N ([torque] gain = {{{owner} = …}} in the sidecar) "
        f"with --map '{column.source.strip()}={column.name}'"
    )


def _column(name: str, guess: Guess) -> Column:
    if guess.entry is None:
        return Column(name, guess.source, current=guess.current)
    entry = guess.entry
    return Column(name, guess.source, entry.factor, low=entry.low, high=entry.high)


def _unmeasured(
    names: Mapping[str, str], taken: Mapping[str, Guess], known: Conventions
) -> list[str]:
    """Return the torques that a table lacks of joints whose positions it has.

    None where it has no torque of any joint, or a column that may be one of them.
    """
    joints = known.motors if any(f"{m}.q" in taken for m in known.motors) else known.joints
    lacking = [j for j in joints if f"{j}.q" in taken and f"{j}.tau" not in taken]
    used = {g.source for g in taken.values()}
    others = [name for column, name in names.items() if column not in used]
    if len(lacking) == len(joints) or any(may_be_torque(c, j) for c in others for j in lacking):
        return []
    return [f"{j}.tau" for j in lacking]


def _choose(guesses: Sequence[Guess], known: Conventions, source: str) -> dict[str, Guess]:
    """Return the one column of each channel of each joint."""
    found: dict[str, list[Guess]] = {}
    for guess in guesses:
        if guess.joint and guess.kind in CHANNELS:
            found.setdefault(f"{guess.joint}.{guess.kind}", []).append(guess)
    out = {}
    for name, those in found.items():
        literal = [g for g in those if split_unit(g.source.strip())[0] == name]
        if len(those) > 1 and len(literal) != 1:
            if name.endswith((".q", ".tau")) and _owner(name) not in known.locked:
                raise LogError(several(source, name, f"'{name}'", [g.source for g in those]))
            continue  # velocities are computed then
        out[name] = (literal or those)[0]
    return out


def _in_units(naming: Naming, stated: Mapping[str, Unit | None], source: str) -> Naming:
    """Return the naming with the units that the log states."""
    converted, columns = [], []
    for column in naming.columns:
        unit = stated.get(column.source)
        if unit is not None:
            kind = "t" if column.name == "t" else column.name.rpartition(".")[2]
            kind = "current" if column.current else kind
            unit.check(kind, column.source.strip(), source)
            if unit.factor != 1.0:
                converted.append(f"{column.name} from {unit.text}")
                factor = column.factor * unit.factor
                column = replace(column, factor=factor)  # noqa: PLW2901
        columns.append(column)
    told = f"values were converted to SI units, as the log states them: {listing(converted, 4)}"
    notes = (*naming.notes, told) if converted else naming.notes
    return replace(naming, columns=tuple(columns), notes=notes)


def rename(name: str, known: Conventions) -> str:
    """Return a column by its new name, or by its joint's."""
    whole = known.columns.apply(name)
    if whole != name or not known.columns:
        return whole
    plain, _ = split_unit(name)
    parts = [known.columns.apply(part) for part in plain.split("/")]
    cut = _CHANNEL_LAST.fullmatch(parts[-1])
    owner, _, end = parts[-1].rpartition(".")
    if owner and _CHANNELS_SAY.issuperset(words_of(end)):
        parts[-1] = f"{known.columns.apply(owner)}.{end}"
    elif cut and cut["kind"].casefold() in _CHANNELS_SAY:
        parts[-1] = known.columns.apply(cut["joint"]) + cut["between"] + cut["kind"]
    return "/".join(parts) + name[len(plain) :]


def _works(found: Sequence[str], source: str, known: Conventions, rule: Mapping[str, str]) -> bool:
    """Whether a log can be read with another rule for its names."""
    columns = Renames.of(rule).before(known.columns)
    try:
        name_columns(found, source, replace(known, columns=columns), proposed=True)
    except LogError:
        return False
    return True


def _needed(names: Sequence[str], known: Conventions) -> tuple[str, ...]:
    """Return the motors or joints of the robot that a table has all that is needed of, or none."""
    for wanted in (known.motors, known.joints):
        needed = {"t", *(f"{j}.{kind}" for j in wanted for kind in ("q", "tau"))}
        if wanted and needed <= set(names):
            return wanted
    return ()


def _tell_renamed(names: Mapping[str, str]) -> list[str]:
    renamed = [f"{old.strip()} is {new}" for old, new in names.items() if old.strip() != new]
    return [f"columns were renamed ({listing(renamed, 3)})"] if renamed else []


def _tell_left(owners: Sequence[str]) -> list[str]:
    left = list(dict.fromkeys(owners))
    if not left:
        return []
    return [f"columns of {listing(left, 6)}, which the robot does not drive, were left out"]


def _is_channel(name: str) -> bool:
    owner, _, kind = name.rpartition(".")
    return bool(owner) and kind in CHANNELS
