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
