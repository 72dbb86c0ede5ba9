"""Joints that follow others: ``-pitch + 0.5 * roll - 0.1``."""

from __future__ import annotations

import re
from collections.abc import Mapping

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.values import frozen

_NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?"
_TERM = re.compile(
    rf"\s*([+-])\s*(?:({_NUMBER})\s*(?:\*\s*([^\W\d]\w*))?|([^\W\d]\w*))\s*(?=[+-]|$)"
)


@frozen
class Follow:
    """A joint at ``constant + Σ weights · positions`` [rad or m]."""

    constant: float
    weights: Mapping[str, float]


def read_follow(what: str, text: str, units: Mapping[str, float], unit: float) -> Follow:
    """Return what a joint follows.

    Parameters
    ----------
    what : str
        The table and the joint, for sentences.
    text : str
    units : mapping
        Every joint of the table to the unit that its positions stand in there [rad or m].
    unit : float
        That of the joint itself.

    Raises
    ------
    RobotError
    """
    rest = text.strip().removeprefix("=").strip()
    rest = rest if rest.startswith(("+", "-")) else f"+{rest}"
    constant, weights = 0.0, dict[str, float]()
    while rest:
        found = _TERM.match(rest)
        if found is None:
            raise RobotError(
                f"{what} equals '{text}', which is no sum of joints; write it as -pitch, or as "
                "0.5 * yaw - pitch + 0.1 (polynomials of joints stand in [[sidecar.couplings]])."
            )
        sign, number, scaled, alone = found.groups()
        factor = float(f"{sign}{number or 1}")
        joint, rest = scaled or alone, rest[found.end() :]
        if joint is None:
            constant += unit * factor
            continue
        if joint not in units:
            raise RobotError(
                f"{what} equals '{text}', and there is no joint '{joint}'{near_match(joint, units)}"
                f" The joints are {listing(units)}."
            )
        weights[joint] = weights.get(joint, 0.0) + factor * unit / units[joint]
    return Follow(constant, weights)
