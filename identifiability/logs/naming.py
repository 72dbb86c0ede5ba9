"""Which column of a table is what: its joint and channel, whatever the table calls it.

By names, by numbers (``q1`` … ``q6``, ``position[0]``, ``qpos[7]``), or as the user maps them;
what is missing is said with the remedy ready to copy.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from typing import NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.aliases import (
    BARE,
    COMMANDED,
    INDEX,
    KINDS,
    SPELLED,
    Guess,
    find_unit,
    guess_column,
    split_unit,
    unread_unit,
    words_for,
    words_of,
)
from identifiability.logs.checks import CHANNELS, COMMANDS
from identifiability.logs.conventions import Conventions
from identifiability.robot.parts import Entry

#: A unit of each channel, for sentences.
EXAMPLES = {"t": "ms", "q": "deg", "q_ref": "deg", "dq": "deg/s", "ddq": "deg/s2", "tau": "Nm"}
EXAMPLES |= {"dq_ref": "deg/s", "tau_ff": "Nm", "current": "A"}

#: A joint's name and a word for its channel.
_CHANNEL_LAST = re.compile(r"(?P<joint>.+?)(?P<between>[._\- ]+)(?P<kind>[A-Za-z]+)")
_CHANNELS_SAY = {*KINDS, *COMMANDED, "ff"}

#: What sentences call what every joint needs.
_WORDS = {"q": "position", "tau": "torque"}


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
    low, high : float
        Of its values, beyond which they act no further.
    unit : str
        As the log states it; empty if it does not.
    current : bool
        Whether it is the current of a motor, in the place of a torque.
    """

    name: str
    source: str
    factor: float = 1.0
    offset: float = 0.0
    dates: int | None = None
    low: float = -np.inf
    high: float = np.inf
    unit: str = ""
    current: bool = False

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
    made : tuple of str
        Torque for which zeros stand, where motion or commands are all that a table is to hold.
    commands : tuple of str
        Columns of commands that stand for torque.
    labels : mapping of str to str
        Columns of text that say which joint the others are about, with that text.
    """

    columns: tuple[Column, ...]
    joints: tuple[str, ...]
    notes: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    locked: tuple[Column, ...] = ()
    made: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()


def name_columns(
    found: Sequence[str],
    source: str,
    known: Conventions,
    units: Mapping[str, str] | None = None,
    first: Mapping[str, str] | None = None,
) -> Naming:
    """Return what a log takes from the columns of a table.

    Where all documented names are there, no others count; without a robot only these are read.

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

    Raises
    ------
    LogError
        If there is no time, a column that is needed is missing, there twice or ambiguous, or its
        unit is none of its channel's.
    """
    names = {name: rename(name.strip(), known) for name in found}
    guesses = _guess(names, known)
    _refuse_repeated(found, guesses, source)
    torque = _has_torque(names, guesses)
    needed = ("q",) if known.motion_alone and not torque else ("q", "tau")
    every = known.commands or not torque  # beside torque those alone that are called as here
    commands = [g for g in guesses if g.kind in COMMANDS and (every or g.literal)]
    measured = [g for g in guesses if g.kind not in COMMANDS]
    if not any(g.kind == "q" for g in measured):
        measured = [replace(g, kind="q") if g.kind == BARE else g for g in measured]
    if not any(g.kind == "tau" for g in measured):
        measured = [replace(g, kind="tau", current=True) if g.kind == "current" else g
                    for g in measured]  # fmt: skip
    literal = [g for g in measured if g.literal]
    if _all_there({g.name for g in literal}, known, needed):
        measured = [g for g in measured if g.literal or g.joint in known.locked]
    settled, labels, how = settle_numbers([*measured, *commands], source, known, names, first or {})
    taken = _choose(settled, known, source)
    commanding = settle_commands(taken, names, source, known, torque=torque)
    needed = ("q",) if commanding else needed
    wanted = _all_there(taken, known, needed)
    if not wanted and torque:
        wanted = _all_there({*taken, *_unmeasured(names, taken, known)}, known, needed)
    if not wanted:
        _refuse_missing(names, taken, source, known)
    own = [g for n, g in taken.items() if n == "t" or (g.joint in wanted and g.kind in CHANNELS)]
    held = [g for g in taken.values() if g.joint in known.locked and g.kind == "q"]
    columns, locked = (
        tuple(_column(g, units or {}, source, known) for g in those) for those in (own, held)
    )
    return Naming(
        columns,
        wanted,
        tuple(_tell(names, own, columns, wanted, how)),
        labels,
        locked,
        made=() if "tau" in needed else tuple(f"{j}.tau" for j in wanted),
        commands=tuple(g.name for g in own if commanding and g.kind in COMMANDS),
    )


def _guess(names: Mapping[str, str], known: Conventions) -> list[Guess]:
    """Return what columns are, as far as their names say so."""
    joints = (*known.motors, *known.joints, *known.locked)
    if not known.joints:
        joints = tuple({split_unit(n)[0].rpartition(".")[0]: 0 for n in names.values()})
    entries = find_entries(names, known)
    guesses = [entries[c] if c in entries else guess_column(c, n, joints) for c, n in names.items()]
    return [g for g in guesses if g is not None and (known.joints or g.literal)]


def _refuse_repeated(found: Sequence[str], guesses: Sequence[Guess], source: str) -> None:
    called = Counter(column.strip() for column in found)
    for column in sorted(g.source.strip() for g in guesses):
        if called[column] > 1:
            raise LogError(f"{source} has the column '{column}' more than once; keep one of them.")


def _has_torque(names: Mapping[str, str], guesses: Sequence[Guess]) -> bool:
    """Whether any column that is no command tells by its name that it is torque or current."""
    commands = {g.source for g in guesses if g.kind in COMMANDS}
    others = (words_of(f"{c} {n}") for c, n in names.items() if c not in commands)
    return any(KINDS.get(word) in ("tau", "current") for words in others for word in words)


def _all_there(
    names: Collection[str], known: Conventions, needed: Sequence[str]
) -> tuple[str, ...]:
    """Return the motors or joints that a table has all that is needed of, or none."""
    found = known.joints or tuple(
        dict.fromkeys(_owner(n) for n in names if _kind(n) in ("q", "tau"))
    )
    for wanted in (known.motors, found):
        if wanted and {"t", *(f"{j}.{kind}" for j in wanted for kind in needed)} <= {*names}:
            return wanted
    return ()


def _choose(guesses: Sequence[Guess], known: Conventions, source: str) -> dict[str, Guess]:
    """Return the one column of each channel of each joint, and of time."""
    found: dict[str, list[Guess]] = {}
    for guess in guesses:
        if guess.kind not in ("current", BARE):
            found.setdefault(guess.name, []).append(guess)
    out = {}
    for name, those in found.items():
        literal = [g for g in those if g.literal] or [g for g in those if g.source == "__time"]
        if len(those) > 1 and len(literal) != 1:
            if those[0].kind in ("dq", "ddq") or those[0].joint in known.locked:
                continue  # velocities are computed then
            columns = [g.source for g in those]
            raise LogError(
                f"{source} has several columns that may be "
                f"{'the time' if name == 't' else repr(name)}: {listing(columns, 6)}; say which it "
                f"is, as in --map '{columns[0].strip()}={name}'."
            )
        out[name] = (literal or those)[0]
    return out


def _unmeasured(
    names: Mapping[str, str], taken: Mapping[str, Guess], known: Conventions
) -> list[str]:
    """Return the torques that a table lacks of joints whose positions it has.

    None where it has no torque of any joint, or a column that may be one of them.
    """
    joints = known.motors if any(f"{m}.q" in taken for m in known.motors) else known.joints
    lacking = [j for j in joints if f"{j}.q" in taken and f"{j}.tau" not in taken]
    free = _free(names, taken)
    if len(lacking) == len(joints) or any(_may_be_torque(c, j) for c in free for j in lacking):
        return []
    return [f"{j}.tau" for j in lacking]


def _free(names: Mapping[str, str], taken: Mapping[str, Guess]) -> list[str]:
    """Return the columns that are not taken for anything."""
    used = {g.source for g in taken.values()}
    return [name for column, name in names.items() if column not in used]


def _may_be_torque(column: str, joint: str) -> bool:
    """Whether a column that is nothing else may be a joint's torque, misspelt or a command."""
    kinds = {KINDS[w] for w in words_of(column) if w in KINDS}
    if {*words_of(joint)} <= {*words_of(column)}:
        return _kind(column) not in SPELLED and kinds <= {"tau"}
    owner = _owner(column)
    return bool(owner) and kinds == {"tau"} and near_match(owner, [joint]).endswith("?")


def _column(guess: Guess, units: Mapping[str, str], source: str, known: Conventions) -> Column:
    """Return a column with what makes SI units of its values, as far as the log says it.

    Raises
    ------
    LogError
        If it states a unit that is not known, or none of its channel's.
    """
    name = guess.source.strip()
    unit = guess.unit or find_unit(units.get(guess.source, "")) or split_unit(name)[1]
    kind = "current" if guess.current else guess.kind
    entry = guess.entry or Entry(guess.name)
    column = Column(guess.name, guess.source, entry.factor, low=entry.low, high=entry.high)
    if unit is not None:
        unit.check(kind, name, source)
        column = replace(column, factor=column.factor * unit.factor, unit=unit.text)
    unread = "" if unit else unread_unit(name, (*known.motors, *known.joints))
    if unread and name not in dict(known.columns.rules):
        gain = (
            f"give what one of it is in N·m or N ([torque] gain = {{{guess.joint} = …}} in the "
            f"sidecar) with --map '{name}={guess.name}'"
        )
        raise LogError(
            f"{source}: the column '{name}' states the unit '{unread}', which is not known; "
            f"say in which one {guess.name} is given, as in --map '{name}={guess.name} "
            f"[{EXAMPLES[kind]}]', or {gain if guess.kind == 'tau' else 'correct the header'}."
        )
    return replace(column, current=guess.current)


def _tell(
    names: Mapping[str, str],
    own: Sequence[Guess],
    columns: Sequence[Column],
    wanted: Sequence[str],
    how: str,
) -> list[str]:
    """Return what is read otherwise than literally, half a sentence each."""
    renamed = [f"{old.strip()} is {new}" for old, new in names.items() if old.strip() != new]
    called = [
        f"{'its index' if g.source == INDEX else repr(g.source)} as {g.name}"
        for g in own
        if not g.literal
    ]
    geared = [f"'{g.source}' by {g.entry.factor:.6g}" for g in own
              if g.entry is not None and g.entry.factor != 1.0]  # fmt: skip
    converted = [f"{c.name} from {c.unit}" for c in columns if c.unit and c.factor != 1.0]
    used = {g.source for g in own}
    left = dict.fromkeys(
        owner
        for column, name in names.items()
        if column not in used and (owner := _owner(name)) not in wanted and _kind(name) in CHANNELS
    )
    told = {
        f"columns were renamed ({listing(renamed, 3)})": renamed,
        f"columns were taken for what their names usually mean: {listing(called, 4)}{how}": called,
        f"values were multiplied by the gears of the file: {listing(geared, 4)}": geared,
        f"columns of {listing(left, 6)}, which the robot does not drive, were left out": left,
        "values were converted to SI units, as the log states them: "
        f"{listing(converted, 4)}": converted,
    }
    return [text for text, found in told.items() if found]


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
        own = known.entries.get(f"{array}@{len(keys)}", known.entries.get(array, {}))
        from_one = "0" not in keys and "1" in keys and all(k.isdecimal() for k in keys)
        entry = own.get(str(int(key) - 1) if from_one else key)
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
    told = [g for g in guesses if g.joint or g.kind == "t"]
    loose = [g for g in guesses if g not in told]
    labels = _labels(names, first) if loose else {}
    if labels:
        owners = {number: known.columns.apply(text) for number, (_, text) in labels.items()}
        out = [replace(g, joint=owners[g.number]) for g in loose if g.number in owners]
        how = " (the names that stand in the log say which joint it is)"
        return [*told, *out], dict(labels.values()), how
    named = {g.name for g in told}
    found: list[Guess] = []
    for kind in CHANNELS:
        own = [g for g in loose if g.kind == kind]
        if own and not {f"{j}.{kind}" for j in known.joints} <= named:
            found += _in_order(own, source, known)
    numbered = any(g.number >= 0 for g in found)
    return [*told, *found], {}, " (in the robot's order)" if numbered else ""


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
    """Return guesses of one channel with the joints of the robot's order, if all are there."""
    numbers = {g.number for g in loose}
    count, kind = len(known.joints), loose[0].kind
    if count == 1 and numbers == {-1}:
        return [replace(g, joint=known.joints[0]) for g in loose]
    if -1 in numbers:
        return []
    start = min(numbers)
    columns = [g.source for g in loose]
    why = f"the robot has {count}: {listing(known.joints)}"
    whole = start in (0, 1) and numbers == set(range(start, start + count))
    own = [_number(joint) for joint in known.joints]
    ordered = None in own or len({*own}) < count or own == sorted(own, key=lambda n: n or 0)
    if whole and ordered:
        return [replace(g, joint=known.joints[g.number - start]) for g in loose]
    if kind not in ("q", "tau"):
        return []
    if whole:
        why = f"the robot's order, {listing(known.joints)}, is not that of its own numbers"
    raise LogError(
        f"{source} numbers its joints otherwise than the robot has them ({listing(columns)}; "
        f"{why}); say which is which, as in --map '{columns[0].strip()}={known.joints[0]}.{kind}'."
    )


def _number(joint: str) -> int | None:
    found = re.findall(r"\d+", joint)
    return int(found[-1]) if found else None


# Columns of commands: whether they stand for torque, which a table lacks then.


def settle_commands(
    taken: dict[str, Guess],
    names: Mapping[str, str],
    source: str,
    known: Conventions,
    *,
    torque: bool,
) -> bool:
    """Return whether commands stand for torque; take out those that are not there of all joints.

    Raises
    ------
    LogError
        If a robot of servos has neither torque nor command, or nothing says what commands make.
    """
    if not known.joints or known.motion_alone:
        return False
    found: dict[str, list[Guess]] = {}
    for guess in [g for g in taken.values() if g.kind in COMMANDS]:
        found.setdefault(guess.kind, []).append(guess)
    for kind, those in found.items():
        has = {g.joint for g in those}
        own = known.motors if has & {*known.motors} else known.joints
        lacking = [j for j in own if j not in has]
        if lacking and known.servo is not None and not torque:
            end = min((end for end, what in SPELLED.items() if what == kind), key=len)
            mend = propose_locks(lacking, own) if kind == "q_ref" else ", or leave them out"
            raise LogError(
                f"{source} has commands ('.{end}') of {listing(has)} and none of "
                f"{listing(lacking)}; give '{lacking[0]}.{end}' as well{mend}."
            )
        for guess in those if lacking else ():
            del taken[guess.name]
    if torque:
        return False
    commands = [g for g in taken.values() if g.kind in ("q_ref", "dq_ref")]
    if known.servo is not None and not any(g.kind in COMMANDS for g in taken.values()):
        raise LogError(
            f"{source} has neither torque nor commands of the robot's joints, "
            f"{listing(known.joints)}; give what was measured of every one, "
            f"'{known.joints[0]}.tau', or the positions that its servo was told, "
            f"'{known.joints[0]}.cmd'. Of its columns {listing(list(names))} say which these are, "
            f"as in --map 'OLD={known.joints[0]}.cmd'."
        )
    if commands and known.servo is None:
        why = (
            "nothing states the gains of the servos that make torque of them; give them in the "
            "sidecar: [servo] kp = …, kv = … (or as <position> actuators of an MJCF). Where "
            'nobody knows them, [servo] kp = "fit" lets the logs tell them, in units of the robot '
            "file's bodies."
        )
        if known.base is not None:
            why = (
                f"the robot file says that '{known.base.body}' floats: torque is made of commands "
                "only of a robot that is held. If it hung on a stand, add --set base=fixed (or "
                'base = "fixed" in the sidecar); if it did not, log the torque.'
            )
        columns = listing([repr(g.source) for g in commands], 2)
        raise LogError(f"{source} has commands ({columns}) and no torque, and {why}")
    return bool(commands)


# What is missing, with the remedy ready to copy.


def _refuse_missing(
    names: Mapping[str, str], taken: Mapping[str, Guess], source: str, known: Conventions
) -> NoReturn:
    """Refuse a log that lacks what is needed, and say what it has instead.

    Raises
    ------
    LogError
    """
    measured = {n: g for n, g in taken.items() if g.kind not in COMMANDS}
    free = [n for n in _free(names, measured) if _kind(n) not in SPELLED or not _is_own(n, known)]
    every = listing(list(names.values()))
    if "t" not in taken:
        likely = [n for n in free if n.casefold().startswith("time")]
        raise LogError(
            f"{source} has no column 't' (time in s). It has the columns {every}. If one of them "
            f"is it, add --map '{[*likely, 'OLD'][0]}=t'; rows at an even rate need one, too: "
            "their number / rate."
        )
    has = list(dict.fromkeys(g.joint for g in taken.values() if g.kind in ("q", "tau")))
    missing = [j for j in known.joints if j not in has]
    strange = _strangers(free, known)
    if missing and strange:
        _refuse_strangers(missing, strange, source, known)
    for joint in has:
        for kind, other in (("tau", "q"), ("q", "tau")):
            name = f"{joint}.{kind}"
            if name in taken or joint in known.locked:
                continue
            end = near_match(name, free)
            told = f" If it is one of {listing(free, 4)}, add --map '{[*free, ''][0]}={name}'."
            raise LogError(
                f"{source} has '{joint}.{other}' but no {_WORDS[kind]} column '{name}'{end} Every "
                f"actuated joint needs both.{told if free and end == '.' else ''}"
            )
    if not has:
        raise LogError(
            f"{source} has no position column; expected '<joint>.q' and '<joint>.tau' for every "
            f"actuated joint, found {every}."
        )
    locks = propose_locks(missing, known.joints)
    told = " or '<joint>.cmd'" if known.servo else ""
    raise LogError(
        f"{source} has no columns for the actuated joint{'s' if len(missing) > 1 else ''} "
        f"{listing(missing)}; every actuated joint needs '<joint>.q' and '<joint>.tau'"
        f"{told}{locks or f'. It has the columns {every}'}."
    )


def _strangers(columns: Sequence[str], known: Conventions) -> list[str]:
    """Return the joints of other names that a log has positions or torques of."""
    found = []
    for name in columns:
        owner, kind = _owner(name), _kind(name)
        if not owner or kind not in SPELLED:
            cut = re.match(r"(.*?)[._/ ]*([A-Za-z]+)$", name)
            guess = guess_column(name, f"{cut[2]}1", ()) if cut and cut[1] else None
            owner = cut[1].rpartition("/")[2] if cut and guess is not None else ""
            kind = guess.kind if guess is not None else ""
        if owner and owner not in (*known.joints, *known.motors) and kind in ("q", "tau"):
            found.append(owner)
    return list(dict.fromkeys(found))


def _by_number(names: Sequence[str]) -> dict[int, str]:
    """Return the first name of each number."""
    found: dict[int, str] = {}
    for name in names:
        number = _number(name)
        if number is not None:
            found.setdefault(number, name)
    return found


def _refuse_strangers(
    missing: Sequence[str], strange: Sequence[str], source: str, known: Conventions
) -> NoReturn:
    """Refuse a log that calls joints otherwise, and propose which is which.

    Where it has some of the joints by their own names, the others are of another device, unless
    they are spelt nearly alike.
    """
    if len(missing) < len(known.joints):
        pairs = [(s, m) for m in missing for s in strange if near_match(m, [s]).endswith("?")]
    else:
        ours, theirs = _by_number(missing), _by_number(strange)
        pairs = [(theirs[k], name) for k, name in ours.items() if k in theirs]
        pairs = pairs if len(pairs) > 1 else list(zip(strange, missing, strict=False))
    maps = listing([f"--map '{old}={new}'" for old, new in pairs], between=" ")
    of = "joint" if len(missing) == 1 else "joints"
    found = {new for _, new in pairs}
    raise LogError(
        f"{source} has no columns for the actuated {of} {listing(missing)}, but for "
        f"{listing(strange)}, which the robot does not have"
        f"{f'; if these are they, add {maps}' if pairs else ''}"
        f"{propose_locks([m for m in missing if m not in found], known.joints)}."
    )


def propose_locks(missing: Sequence[str], wanted: Sequence[str]) -> str:
    """Return what to write where joints that a log does not have stand still, or nothing."""
    if len(missing) in (0, len(wanted)):  # of all foreign names are likelier
        return ""
    they, line = ("it does", "it") if len(missing) == 1 else ("they do", "them")
    options = " ".join(f"--lock {name}" for name in missing)
    names = ", ".join(f'"{name}"' for name in missing)
    return f". If {they} not move, lock {line}: {options}, or locked = [{names}] in the sidecar"


def _is_own(name: str, known: Conventions) -> bool:
    return not known.joints or _owner(name) in known.joints


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def _kind(name: str) -> str:
    return name.rpartition(".")[2]


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
