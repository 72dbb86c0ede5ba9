"""Which column of a table is what: its joint and channel, whatever the table calls it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array, Renames
from identifiability.foundation.values import frozen
from identifiability.logs.aliases import INDEX, KINDS, Guess, guess_column, unread_unit
from identifiability.logs.checks import CHANNELS, find_joints
from identifiability.logs.conventions import Conventions
from identifiability.logs.missing import may_be_torque, refuse_missing, several
from identifiability.logs.numbered import find_entries, settle_numbers
from identifiability.logs.stated_units import Unit, find_unit, split_unit

#: A unit of each channel, for sentences.
EXAMPLES = {"t": "ms", "q": "deg", "q_ref": "deg", "dq": "deg/s", "ddq": "deg/s2", "tau": "Nm"}
EXAMPLES |= {"dq_ref": "deg/s", "tau_ff": "Nm"}
EXAMPLES |= {"current": "A"}

#: A joint's name and a word for its channel.
_CHANNEL_LAST = re.compile(r"(?P<joint>.+?)(?P<between>[._\- ]+)(?P<kind>[A-Za-z]+)")


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
    if cut and cut["kind"].casefold() in KINDS:
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


def _owner(name: str) -> str:
    return name.rpartition(".")[0]


def _is_channel(name: str) -> bool:
    owner, _, kind = name.rpartition(".")
    return bool(owner) and kind in CHANNELS
