"""What names of columns usually mean: drivers, recorders and toolboxes have habits of their own.

A name is cut into words and numbers, ``/joint_states/panda_joint1/position`` into *joint, states,
panda, joint, 1, position*. It is taken for a channel of a joint if it holds the joint's name or
its number, one word for the channel, and beside these only words that say nothing. A command is
no measurement.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from identifiability.foundation.values import frozen
from identifiability.logs.stated_units import (
    UNITS,
    Unit,
    bracketed,
    find_unit,
    is_no_unit,
    split_unit,
)
from identifiability.robot.parts import Entry

#: Words for each channel.
CHANNEL_WORDS = {
    kind: tuple(words.split())
    for kind, words in {
        "q": "q pos position positions angle angles theta qpos winkel lage",
        "dq": "dq qd qdot vel velocity velocities speed speeds qvel "
        "geschwindigkeit drehzahl vitesse",
        "ddq": "ddq qdd qddot acc accel acceleration accelerations qacc beschleunigung",
        "tau": "tau torque torques trq effort efforts force forces moment qfrc "
        "drehmoment kraft couple",
        "current": "current currents curr strom courant",
    }.items()
}
KINDS = {word: kind for kind, words in CHANNEL_WORDS.items() for word in words}

#: Two words for one.
_PAIRS = {
    ("q", "dot"): "qdot",
    ("q", "ddot"): "qddot",
    ("tau", "j"): "tau",
    ("qfrc", "actuator"): "qfrc",
}

#: Words that say nothing about which joint and which channel.
SILENT = frozenset(
    (
        "joint",
        "joints",
        "dof",
        "dofs",
        "j",
        "axis",
        "axes",
        "state",
        "states",
        "robot",
        "arm",
        "actual",
        "measured",
        "meas",
        "mes",
        "msr",
        "feedback",
        "fbk",
        "field",
        "data",
        "log",
        "value",
        "values",
        "achse",
        "axe",
        "ist",
        "istwert",
    )
)

#: Words of what was wanted, and not measured.
COMMANDED = frozenset(
    (
        "d",
        "des",
        "desired",
        "target",
        "targets",
        "cmd",
        "command",
        "commands",
        "commanded",
        "ref",
        "reference",
        "setpoint",
        "action",
        "actions",
        "ctrl",
        "set",
        "goal",
        "planned",
        "nominal",
        "soll",
        "sollwert",
        "consigne",
    )
)

#: Words for time.
TIME_WORDS = frozenset(
    ("t", "time", "times", "timestamp", "timestamps", "stamp", "zeit", "temps", "elapsed")
)
_TIME_UNITS = tuple(name for name, (what, _) in UNITS.items() if what == "time")

#: What a table of pandas without a name for its index is stored under.
INDEX = "__index_level_0__"


@frozen
class Guess:
    """What a column is by its name.

    Attributes
    ----------
    source : str
        What the table calls it.
    kind : str
        ``t``, a channel, or ``current``.
    joint : str
        Empty if it is told by a number, or not at all.
    number : int
        −1 if there is none.
    unit : Unit or None
        As far as the name states it.
    current : bool
        Whether it is taken for the torque though it is a current.
    entry : Entry or None
        What MuJoCo keeps under this name.
    """

    source: str
    kind: str
    joint: str = ""
    number: int = -1
    unit: Unit | None = None
    current: bool = False
    entry: Entry | None = None


def words_of(name: str) -> list[str]:
    """Return a name's words, in small letters, and numbers.

    Example
    -------
    >>> words_of("actualPosition_1")
    ['actual', 'position', '1']
    """
    apart = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return [w.casefold() for w in re.findall(r"[^\W\d_]+|\d+", apart)]


def guess_column(source: str, name: str, joints: Sequence[str]) -> Guess | None:
    """Return what a column is; None if its name does not say so.

    Parameters
    ----------
    source, name : str
        What the table calls it, and its name after renaming.
    joints : sequence of str
        Of the robot.
    """
    plain, unit = split_unit(name)
    if unit is None and unread_unit(name, joints):  # what it is of can be told all the same
        plain = name[: name.rindex(bracketed(name)) - 1]
    parts = [p for p in plain.split("/") if p]
    words, above = words_of(" ".join(parts[-2:])), words_of(" ".join(parts[:-2]))
    time = _guess_time(source, words, unit)
    if time is not None:
        return time
    joint, rest = take_joint(words, joints)
    for k in reversed(range(len(rest) - 1)):
        if (rest[k], rest[k + 1]) in _PAIRS:
            rest[k : k + 2] = [_PAIRS[rest[k], rest[k + 1]]]
    if rest and unit is None and rest[-1] in ("rad", "deg", "nm", "mm"):
        unit = find_unit({"nm": "Nm"}.get(rest[-1], rest[-1]))
        rest = rest[:-1]
    kinds = [w for w in rest if w in KINDS]
    numbers = [w for w in rest if w.isdecimal()]
    others = [w for w in rest if w not in kinds and w not in numbers and w not in SILENT]
    if len(kinds) != 1 or others or COMMANDED & {*rest, *above} or len(numbers) > (not joint):
        return None
    number = int(numbers[0]) if numbers and len(numbers[0]) < 4 else -1
    return Guess(source, KINDS[kinds[0]], joint, number, unit)


def unread_unit(name: str, joints: Sequence[str]) -> str:
    """Return what stands in brackets at the end of a name as a unit that is not known, or nothing.

    Numbers, names of joints and words that say nothing of a unit are none.

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


def _guess_time(source: str, words: list[str], unit: Unit | None) -> Guess | None:
    """Return a column of time."""
    if source == INDEX:
        return Guess(source, "t")
    if unit is None and len(words) > 1 and words[-1] in _TIME_UNITS:
        unit, words = find_unit(words[-1]), words[:-1]
    left = [w for w in words if w not in SILENT and w != "header"]
    if unit is not None and unit.dimension != "time":
        return None
    return Guess(source, "t", unit=unit) if left and TIME_WORDS.issuperset(left) else None


def take_joint(words: list[str], joints: Sequence[str]) -> tuple[str, list[str]]:
    """Return the joint whose name stands among some words, and the words without it."""
    found = []
    for joint in joints:
        name = words_of(joint)
        at = [k for k in range(len(words)) if words[k : k + len(name)] == name]
        if at and name:
            found.append((len(name), joint, at[0]))
    if not found:
        return "", list(words)
    size, joint, k = max(found, key=lambda f: f[0])
    alike = [other for length, other, _ in found if length == size]
    if len(alike) > 1:  # two names that differ in case or signs only
        return "", ["?"]
    return joint, words[:k] + words[k + size :]
