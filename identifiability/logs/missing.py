"""Sentences about columns that a log lacks, with the remedy ready to copy."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from os.path import commonprefix
from typing import NoReturn

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.logs.aliases import CHANNEL_WORDS, COMMANDED, KINDS, guess_column, words_of
from identifiability.logs.checks import CHANNELS, find_joints
from identifiability.logs.conventions import Conventions

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
    raise LogError(
        f"{source} has no columns for the actuated joint{'s' if len(missing) > 1 else ''} "
        f"{listing(missing)}; every actuated joint needs '<joint>.q' and '<joint>.tau'"
        f"{locks or f'. It has the columns {listing(list(names))}'}."
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
