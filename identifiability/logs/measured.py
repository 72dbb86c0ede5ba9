"""Torque columns as they were measured: currents, motor torques, other units, other signs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from identifiability.foundation.errors import LogError, listing
from identifiability.logs.aliases import CHANNEL_WORDS, COMMANDED, words_of
from identifiability.logs.conventions import Conventions
from identifiability.logs.naming import Column, Naming, rename

#: What columns of motor currents are called.
CURRENT = ".current"

_TORQUES = {*CHANNEL_WORDS["tau"], *CHANNEL_WORDS["current"]}
_POSITION = re.compile(
    rf"((?:^|.*[^A-Za-z]))(?:{'|'.join(CHANNEL_WORDS['q'])})(?![A-Za-z])", re.IGNORECASE
)

#: What is said of a sensor behind the gears.
BEHIND = (
    "torque was measured behind the gears, where no inertia of rotors is seen: the model has none"
)


def call_currents(found: Sequence[str], known: Conventions) -> list[str]:
    """Return names under which a table's columns are looked for.

    The current of a joint stands for its torque where that was not measured.
    """
    names = [known.columns.apply(name.strip()) for name in found]
    owners = [name.removesuffix(CURRENT) for name in names]
    return [
        f"{owner}.tau" if owner != name and not _has_torque(owner, names, known) else given
        for given, name, owner in zip(found, names, owners, strict=True)
    ]


def _has_torque(owner: str, names: Sequence[str], known: Conventions) -> bool:
    return bool({f"{owner}.tau", f"{known.columns.apply(owner)}.tau"} & set(names))


def missing_torque(columns: Iterable[str], known: Conventions) -> list[str]:
    """Return what torques of a table would be called that holds none, nor a current; else none.

    They are called as its positions are, so that what is understood of these is so of them; where
    a rule renames positions alone, as they become. Torque is what a rule makes torque, too.
    """
    new = {name: rename(name.strip(), known) for name in columns}
    said = {name: {*words_of(name), *words_of(becomes)} for name, becomes in new.items()}
    if any(words & _TORQUES for words in said.values()):
        return []
    called: list[str] = []
    for name in (name for name, words in said.items() if not words & COMMANDED):
        own, becomes = (_POSITION.sub(r"\1tau", n, count=1) for n in (name, new[name]))
        called.append(own if rename(own, known) == becomes else becomes)
    return [name for name in dict.fromkeys(called) if name not in {*new, *new.values()}]


def settle_torque(naming: Naming, known: Conventions, source: str) -> Naming:
    """Return what a log takes from a table, with its torques in N·m or N at the joints.

    Parameters
    ----------
    naming : Naming
        With currents in the place of torques.
    known : Conventions
    source : str
        What sentences call the table.

    Raises
    ------
    LogError
        If a current has no gain, or a motor's torque no ratio.
    """
    torque = known.torque
    given = {c.name.removesuffix(".tau"): c for c in naming.columns if c.name.endswith(".tau")}
    given = {joint: c for joint, c in given.items() if joint in naming.joints}
    currents = [j for j, c in given.items() if c.current]
    unknown = [] if known.raw_torque else [j for j in currents if not torque.has_gain(j)]
    if unknown:
        raise LogError(
            f"{source} has currents and no torques of {listing(unknown)}; say in the sidecar what "
            f"one unit gives at the joint [N·m or N]: [torque] gain = {{{unknown[0]} = …}} (the "
            "torque constant times the ratio of the gear), or have it identified from a known "
            "payload: identifiability gain."
        )
    turned = [j for j in given if j not in known.motors]
    if torque.side == "motor" and (loose := [j for j in turned if not torque.has_ratio(j)]):
        raise LogError(
            f"{source}: the torque of {listing(loose)} was measured at the motor, by the sidecar; "
            f"give the ratio of its gear, too: [torque] ratio = {{{loose[0]} = …}}."
        )
    factors = {j: 1.0 if known.raw_torque else torque.factor(j) for j in given}
    columns = tuple(_scaled(c, factors) for c in naming.columns)
    return replace(naming, columns=columns, notes=(*naming.notes, *_tell(factors, currents, known)))


def _scaled(column: Column, factors: Mapping[str, float]) -> Column:
    joint = column.name.removesuffix(".tau")
    if column.name == joint or factors.get(joint, 1.0) == 1.0:
        return column
    return replace(column, factor=column.factor * factors[joint])


def _tell(factors: Mapping[str, float], currents: Sequence[str], known: Conventions) -> list[str]:
    notes = []
    what = "torques are currents" if currents else "torques were multiplied"
    changed = {j: f for j, f in factors.items() if f != 1.0 or j in currents}
    if changed and not known.raw_torque:
        shown = listing([f"{j}: {f:.6g}" for j, f in changed.items()], 4)
        times = " times what the sidecar says" if currents else " by what the sidecar says"
        notes.append(f"{what}{times} ({shown})")
    if known.torque.side == "link":
        notes.append(BEHIND)
    return notes
