"""What names and units of columns usually mean: drivers, recorders, toolboxes have habits.

Units stand in a row under the header or in the names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.foundation.values import frozen

if TYPE_CHECKING:
    from identifiability.robot.parts import Entry

# Units that a log states for its columns, in a row under the header or in the names.


#: What each channel of a log can be measured in.
DIMENSIONS = {
    "t": ("time",),
    "q": ("angle", "length"),
    "q_ref": ("angle", "length"),
    "dq": ("angle/s", "length/s"),
    "ddq": ("angle/s2", "length/s2"),
    "tau": ("torque", "force"),
    "dq_ref": ("angle/s", "length/s"),
    "tau_ff": ("torque", "force"),
    "current": ("current",),
}

#: What units measure, how much of SI one is, and how they are written: without spaces, dots and
#: signs of powers.
_WRITTEN = (
    ("time", 1.0, ("s", "sec", "secs", "second", "seconds")),
    ("time", 1e-3, ("ms", "msec", "millis", "milliseconds")),
    ("time", 1e-6, ("us", "usec", "µs", "microseconds")),
    ("time", 1e-9, ("ns", "nsec", "nanoseconds")),
    ("time", 60.0, ("min",)),
    ("angle", 1.0, ("rad", "radian", "radians")),
    ("angle", 1e-3, ("mrad",)),
    ("angle", math.pi / 180, ("deg", "degree", "degrees", "°", "Grad")),
    ("length", 1.0, ("m",)),
    ("length", 1e-2, ("cm",)),
    ("length", 1e-3, ("mm",)),
    ("length", 1e-6, ("µm", "um")),
    ("length", 0.0254, ("in", "inch", "inches")),
    ("angle/s", math.pi / 30, ("rpm", "U/min", "tr/min")),
    ("torque", 1.0, ("Nm",)),
    ("torque", 1e-2, ("Ncm",)),
    ("torque", 1e-3, ("mNm", "Nmm")),
    ("torque", 1e3, ("kNm",)),
    ("torque", 10.0, ("daNm",)),
    ("torque", 9.80665, ("kgfm", "kgm")),
    ("torque", 9.80665e-2, ("kgfcm", "kgcm")),
    ("torque", 1.3558179483, ("lbfft", "lbft", "ftlbf", "ftlb")),
    ("torque", 0.1129848290, ("lbfin", "lbin", "inlbf", "inlb")),
    ("force", 1.0, ("N",)),
    ("force", 1e-3, ("mN",)),
    ("force", 1e3, ("kN",)),
    ("force", 10.0, ("daN",)),
    ("force", 9.80665, ("kgf",)),
    ("force", 4.4482216153, ("lbf",)),
    ("current", 1.0, ("A", "Amp")),
    ("current", 1e-3, ("mA",)),
)
_RATES = (("/s", ("/s", "/sec")), ("/s2", ("/s2", "/sec2")))

#: Units by how they are written: what they measure, and how much of SI one is.
UNITS = {name: (what, size) for what, size, names in _WRITTEN for name in names}
UNITS |= {
    f"{name}{end}": (f"{what}{rate}", size)
    for name, (what, size) in UNITS.items()
    if what in ("angle", "length")
    for rate, ends in _RATES
    for end in ends
}

#: What stands where a column has no unit.
NONE = ("", "-", "–", "1", "none", "n/a")

_WORDS = {
    "t": "time",
    "q": "position",
    "dq": "velocity",
    "ddq": "acceleration",
    "current": "current",
}

_BRACKETS = re.compile(r"\s*[\[(<]\s*([^\])>]*?)\s*[\])>]\s*$")


@frozen
class Unit:
    """A unit that a log states.

    Attributes
    ----------
    text : str
        As it is written.
    dimension : str
        What it measures.
    factor : float
        How much of the SI unit one is.
    """

    text: str
    dimension: str
    factor: float

    def check(self, kind: str, column: str, source: str) -> None:
        """Refuse a unit in which a channel cannot be measured.

        Raises
        ------
        LogError
        """
        if self.dimension not in DIMENSIONS[kind]:
            what = _WORDS.get(kind, "torque or force")
            raise LogError(
                f"{source}: column '{column}' is a {what}, but the log says that its unit is "
                f"'{self.text}'; check which column is which, and rename it or repair the unit."
            )


def find_unit(text: str) -> Unit | None:
    """Return the unit that a text is, with brackets or without; None if it is none."""
    inner = _BRACKETS.fullmatch(text)
    stated = (inner[1] if inner else text).strip()
    plain = re.sub(r"[\s·⋅*.^]", "", stated).replace("²", "2").replace("μ", "µ")
    plain = plain.replace("s-1", "/s").replace("s-2", "/s2").replace("//", "/")
    plain = re.sub(r"(?<=[a-z])-(?=[a-z])", "", plain)  # in-lb
    found = UNITS.get(plain) or UNITS.get(plain.lower() if len(plain) > 2 else plain)
    return Unit(stated, *found) if found else None


def is_no_unit(text: str) -> bool:
    """Whether a cell of a row of units says that its column has none."""
    inner = _BRACKETS.fullmatch(text.strip())
    return (inner[1] if inner else text.strip()).casefold() in NONE


def bracketed(name: str) -> str:
    """Return what stands in brackets at the end of a name, nothing if there are none."""
    inner = _BRACKETS.search(name)
    return inner[1] if inner else ""


def split_unit(name: str) -> tuple[str, Unit | None]:
    """Return the name of a column and the unit that stands in brackets at its end.

    Example
    -------
    >>> split_unit("elbow.q [deg]")[0]
    'elbow.q'
    """
    inner = _BRACKETS.search(name)
    unit = find_unit(inner[1]) if inner else None
    return (name[: inner.start()].strip(), unit) if inner and unit else (name, None)


# What names of columns usually mean: drivers, recorders and toolboxes have habits of their own.
#
# A name is cut into words and numbers, ``/joint_states/panda_joint1/position`` into *joint,
# states, panda, joint, 1, position*. It is taken for a channel of a joint if it holds the joint's
# name or its number, one word for the channel, and beside these only words that say nothing. A
# command is no measurement.


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
    """Return the joint whose name stands among some words, and the words without it.

    Words that say nothing may be left out of a name, as in "FL_hip" for "FL_hip_joint", as long as
    a word is left.
    """
    names = [words_of(joint) for joint in joints]
    found = _standing(words, names, joints)
    if not found:
        brief = [[w for w in name if w not in SILENT] for name in names]
        brief = [name if any(not w.isdecimal() for w in name) else [] for name in brief]
        found = _standing(words, brief, joints)
    if not found:
        return "", list(words)
    size, joint, k = max(found, key=lambda f: f[0])
    alike = [other for length, other, _ in found if length == size]
    if len(alike) > 1:  # two names that differ in case or signs only
        return "", ["?"]
    return joint, words[:k] + words[k + size :]


def _standing(
    words: list[str], names: Sequence[list[str]], joints: Sequence[str]
) -> list[tuple[int, str, int]]:
    """Return the joints whose names stand among some words: how long they are, which, and where."""
    found = []
    for name, joint in zip(names, joints, strict=True):
        at = [k for k in range(len(words)) if words[k : k + len(name)] == name]
        if at and name:
            found.append((len(name), joint, at[0]))
    return found
