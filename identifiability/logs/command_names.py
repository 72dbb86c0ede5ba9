"""Which columns of a table hold commands, whatever it calls them: ``.cmd``, ``q_des``, ``action``.

A name is read as that of a measurement is, with a word for what was wanted in it.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from typing import NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.aliases import Guess, Unit, guess_command, split_unit
from identifiability.logs.checks import COMMANDS
from identifiability.logs.conventions import Conventions
from identifiability.logs.naming import find_entries, propose_locks, rename
from identifiability.logs.to_si import ANGULAR, DEGREE, has_torque

#: Endings that say it in one word.
_SHORT = {
    "cmd": "q_ref",
    "q_cmd": "q_ref",
    "dq_cmd": "dq_ref",
    "tau_cmd": "tau_ff",
    **{kind: kind for kind in COMMANDS},
}


@frozen
class Command:
    """A column that holds commands.

    Attributes
    ----------
    name : str
        ``<joint>.q_ref``, ``.dq_ref`` or ``.tau_ff``.
    factor, low, high : float
        What its values are multiplied by, and beyond which they act no further.
    """

    name: str
    factor: float = 1.0
    low: float = -np.inf
    high: float = np.inf

    def scale(self, values: Array) -> Array:
        """Return values of the table, (N,), as what it is called here."""
        return np.clip(values, self.low, self.high) * self.factor


def choose_commands(
    columns: Iterable[str], source: str, known: Conventions
) -> tuple[dict[str, Command], bool]:
    """Return the columns of commands that are read, and whether they stand for torque.

    They do where a table has none; beside torque only those are read that are called as here,
    unless all are asked for.

    Parameters
    ----------
    columns : iterable of str
    source : str
        What sentences call the table.
    known : Conventions

    Raises
    ------
    LogError
        If there is neither torque nor command, or nothing says what torque commands make.
    """
    columns = list(columns)
    if not known.joints or known.motion_alone:
        return {}, False
    meant = _read_names(columns, source, known)
    found = _of_all(meant, known)
    whole = any(f.name.endswith((".q_ref", ".dq_ref")) for f in found.values())
    torque = has_torque([c for c in columns if c not in meant], known)
    if known.servo is not None and not torque and len(found) < len(meant):
        _refuse_part([f.name for c, f in meant.items() if c not in found], source, known)
    if whole and (known.commands or not torque):
        if not torque and known.servo is None and known.base is not None:
            raise LogError(
                f"{source} has commands ({listing([repr(c) for c in found], 2)}) and no torque, "
                f"and the robot file says that '{known.base.body}' floats: torque is made of "
                "commands only of a robot that is held. If it hung on a stand, add --base fixed "
                '(or base = "fixed" in the sidecar); if it did not, log the torque.'
            )
        if not torque and known.servo is None:
            raise LogError(
                f"{source} has commands ({listing([repr(c) for c in found], 2)}) and no torque, "
                "and nothing states the gains of the servos that make torque of them; give them "
                "in the sidecar: [servo] kp = …, kv = … (or as <position> actuators of an MJCF). "
                'Where nobody knows them, [servo] kp = "fit" lets the logs tell them, in units of '
                "the robot file's bodies."
            )
        return found, not torque
    if known.servo is not None and not (torque or found):
        others = [c.strip() for c in columns if _is_command(c)]
        if others:
            owner, of = others[0].rpartition(".")[0], known.joints[0]
            rule = f"{owner}={of}" if owner else f"{others[0]}={of}.cmd"
            raise LogError(
                f"{source} has commands ({listing([repr(c) for c in others], 3)}) that are not "
                f"those of the robot's joints, {listing(known.joints)}; say which is which, as in "
                f"--map '{rule}' (or under [columns] in the sidecar)."
            )
        raise LogError(
            f"{source} has neither torque nor commands; give what was measured of every actuated "
            f"joint, '{known.joints[0]}.tau', or the positions that its servo was told, "
            f"'{known.joints[0]}.cmd'."
        )
    return {c: f for c, f in found.items() if _is_plain(c, f)}, False


def _refuse_part(names: Sequence[str], source: str, known: Conventions) -> NoReturn:
    """Refuse commands of some joints, where those of the others are missing.

    Raises
    ------
    LogError
    """
    kind = names[0].rpartition(".")[2]
    given = [j for j in (*known.motors, *known.joints, *known.locked) if f"{j}.{kind}" in names]
    own = known.motors if {*given} & {*known.motors} else known.joints
    end = min((end for end, what in _SHORT.items() if what == kind), key=len)
    lacking = [j for j in own if j not in given]
    mend = propose_locks(lacking, own) if kind == "q_ref" else ", or leave them out"
    raise LogError(
        f"{source} has commands ('.{end}') of {listing(dict.fromkeys(given))} and none of "
        f"{listing(lacking)}; give '{lacking[0]}.{end}' as well{mend}."
    )


def _is_command(column: str) -> bool:
    """Whether a name says that a column holds a command, of whichever joint."""
    name, _ = split_unit(column.strip())
    owner, _, end = name.rpartition(".")
    return end in _SHORT or guess_command(column, name, [owner] if owner else []) is not None


def _is_plain(column: str, command: Command) -> bool:
    """Whether a column is called as it is here."""
    plain, _ = split_unit(column.strip())
    owner, _, kind = plain.rpartition(".")
    return f"{owner}.{_SHORT.get(kind)}" == command.name


def state_commands(found: Mapping[str, Command]) -> tuple[str, ...]:
    """Return which columns were taken for commands by what their names usually mean, if any."""
    told = []
    for column, command in found.items():
        joint, _, kind = command.name.rpartition(".")
        end = min((end for end, what in _SHORT.items() if what == kind), key=len)
        told += [] if _is_plain(column, command) else [f"{column.strip()!r} as {joint}.{end}"]
    return (f"commands are {listing(told, 4)}",) if told else ()


def _of_all(found: Mapping[str, Command], known: Conventions) -> dict[str, Command]:
    """Return the commands of the kinds that are there of all joints, or all motors."""
    names = {command.name for command in found.values()}
    return {c: command for c, command in found.items() if _whole(command.name, names, known)}


def _read_names(columns: Iterable[str], source: str, known: Conventions) -> dict[str, Command]:
    """Return the columns that hold commands of any of the robot's joints."""
    own = tuple(dict.fromkeys((*known.motors, *known.joints, *known.locked)))
    found: dict[str, Command] = {}
    numbered: dict[str, dict[int, str]] = {}
    units: dict[str, Unit | None] = {}
    names = {column: rename(column.strip(), known) for column in columns}
    entries = find_entries(names, known)
    for column, name in names.items():
        if column in entries:  # MuJoCo's own arrays
            entry = entries[column]
            if entry is not None and entry.entry is not None and entry.kind in COMMANDS:
                at = entry.entry
                found[column] = Command(at.column, at.factor, at.low, at.high)
            continue
        owner, _, end = split_unit(name)[0].rpartition(".")
        literal = owner in own and end in _SHORT
        guess = Guess(column, _SHORT[end], owner) if literal else guess_command(column, name, own)
        if guess is None:
            continue
        units[column] = split_unit(column.strip())[1] or guess.unit
        if guess.joint:
            factor = _factor(column, guess.kind, guess.joint, units[column], source, known)
            found[column] = Command(f"{guess.joint}.{guess.kind}", factor)
        elif guess.number >= 0:
            numbered.setdefault(guess.kind, {})[guess.number] = column
    for kind, those in numbered.items():
        first = min(those)
        if first in (0, 1) and set(those) == set(range(first, first + len(known.joints))):
            for k, joint in enumerate(known.joints):
                column = those[first + k]
                factor = _factor(column, kind, joint, units[column], source, known)
                found[column] = Command(f"{joint}.{kind}", factor)
    by_name: dict[str, list[str]] = {}
    for column, command in found.items():
        by_name.setdefault(command.name, []).append(column)
    for name, several in by_name.items():
        if len(several) > 1:
            raise LogError(
                f"{source} has several columns that may be the command '{name}': "
                f"{listing(several, 4)}; say which it is, as in --map "
                f"'{several[0].strip()}={name}'."
            )
    return found


def _factor(
    column: str, kind: str, joint: str, unit: Unit | None, source: str, known: Conventions
) -> float:
    """Return what turns a stated unit into the one in which the joint's column is read."""
    if unit is None:
        return 1.0
    unit.check(kind, column.strip(), source)
    if joint in known.scales and kind in ANGULAR:
        raise LogError(
            f"{source}: the column '{column.strip()}' states a unit, and the sidecar's [columns] "
            f"scales '{joint}'; leave one of them out."
        )
    return unit.factor / (DEGREE if joint in known.degrees and kind in ANGULAR else 1.0)


def _whole(name: str, found: Container[str], known: Conventions) -> bool:
    """Whether a kind of command is there of all joints, or all motors."""
    kind = name.rpartition(".")[2]
    return any(
        names and all(f"{j}.{kind}" in found for j in names)
        for names in (known.joints, known.motors)
    )
