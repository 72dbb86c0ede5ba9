"""Columns that tell their joint by a number: ``q1`` … ``q6``, ``position[0]``, ``qpos[7]``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from identifiability.foundation.errors import LogError, listing
from identifiability.logs.aliases import Guess, words_of
from identifiability.logs.checks import CHANNELS
from identifiability.logs.conventions import Conventions
from identifiability.logs.stated_units import split_unit

#: Words of a column that holds names of joints.
NAMES = ("name", "names")


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
        entry = known.entries.get(array, {}).get(key)
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
        if column in first and len(words) > 1 and words[-2] in NAMES and words[-1].isdecimal():
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
            f"--map '{_regular(columns[0])}={known.joints[0]}.{needed[0]}'."
        )
    own = [_number(joint) for joint in known.joints]
    if None not in own and len({*own}) == count and own != sorted(own, key=lambda n: n or 0):
        columns = [g.source for g in loose if g.kind == "q"]
        raise LogError(
            f"{source} numbers its joints ({listing(columns)}), and the robot's order, "
            f"{listing(known.joints)}, is not that of its own numbers; say which is which, as in "
            f"--map '{_regular(columns[0])}={known.joints[0]}.q'."
        )
    return [
        replace(g, joint=known.joints[g.number - start])
        for g in loose
        if numbers[g.kind] == all_of_them
    ]


def _regular(column: str) -> str:
    return column.strip()


def _number(joint: str) -> int | None:
    found = re.findall(r"\d+", joint)
    return int(found[-1]) if found else None
