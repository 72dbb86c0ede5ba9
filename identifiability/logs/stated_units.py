"""Units that a log states for its columns, in a row under the header or in the names."""

from __future__ import annotations

import math
import re

from identifiability.foundation.errors import LogError
from identifiability.foundation.values import frozen

#: What each channel of a log can be measured in.
DIMENSIONS = {
    "t": ("time",),
    "q": ("angle", "length"),
    "q_ref": ("angle", "length"),
    "dq": ("angle/s", "length/s"),
    "ddq": ("angle/s2", "length/s2"),
    "tau": ("torque", "force"),
    "current": ("current",),
}

_TIMES = {
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3,
    "millis": 1e-3, "milliseconds": 1e-3, "us": 1e-6, "usec": 1e-6, "µs": 1e-6,
    "microseconds": 1e-6, "ns": 1e-9, "nsec": 1e-9, "nanoseconds": 1e-9, "min": 60.0,
}  # fmt: skip
_ANGLES = {
    "rad": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3, "deg": math.pi / 180,
    "degree": math.pi / 180, "degrees": math.pi / 180, "°": math.pi / 180,
}  # fmt: skip
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "um": 1e-6}

#: Units without spaces, dots and signs of powers: what they measure, and how much of SI one is.
UNITS = {
    **{name: ("time", size) for name, size in _TIMES.items()},
    **{name: ("angle", size) for name, size in _ANGLES.items()},
    **{name: ("length", size) for name, size in _LENGTHS.items()},
    **{
        f"{name}/{per}": (f"{what}/s{power}", size)
        for what, names in (("angle", _ANGLES), ("length", _LENGTHS))
        for name, size in names.items()
        for power, pers in (("", ("s", "sec")), ("2", ("s2", "sec2")))
        for per in pers
    },
    "rpm": ("angle/s", math.pi / 30),
    **{name: ("torque", size) for name, size in
       (("Nm", 1.0), ("mNm", 1e-3), ("Nmm", 1e-3), ("Ncm", 1e-2), ("kNm", 1e3))},
    **{name: ("force", size) for name, size in (("N", 1.0), ("mN", 1e-3), ("kN", 1e3))},
    **{name: ("current", size) for name, size in (("A", 1.0), ("Amp", 1.0), ("mA", 1e-3))},
}  # fmt: skip

#: What stands where a column has no unit.
NONE = ("", "-", "–", "1", "none", "n/a")

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
            word = {"t": "time", "q": "position", "dq": "velocity", "ddq": "acceleration",
                    "current": "current"}  # fmt: skip
            raise LogError(
                f"{source}: column '{column}' is a {word.get(kind, 'torque or force')}, but the "
                f"log says that its unit is '{self.text}'; check which column is which, and "
                "rename it or repair the unit."
            )


def find_unit(text: str) -> Unit | None:
    """Return the unit that a text is, with brackets or without; None if it is none."""
    inner = _BRACKETS.fullmatch(text)
    stated = (inner[1] if inner else text).strip()
    plain = re.sub(r"[\s·⋅*.^]", "", stated).replace("²", "2").replace("μ", "µ")
    plain = plain.replace("s-1", "/s").replace("s-2", "/s2").replace("//", "/")
    found = UNITS.get(plain) or UNITS.get(plain.lower() if len(plain) > 2 else plain)
    return Unit(stated, *found) if found else None


def is_no_unit(text: str) -> bool:
    """Whether a cell of a row of units says that its column has none."""
    inner = _BRACKETS.fullmatch(text.strip())
    return (inner[1] if inner else text.strip()).casefold() in NONE


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
