"""Sentences for the user: what was given, what was expected, what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class IdentifiabilityError(Exception):
    """Bad input, said in one sentence that the user can act on."""


class RobotError(IdentifiabilityError):
    """The robot file or its sidecar cannot be used."""


class LogError(IdentifiabilityError):
    """A log cannot be used."""


class ModelError(IdentifiabilityError):
    """A model or a ladder of models cannot be used with this robot."""


class ClosureError(IdentifiabilityError):
    """The loops of a closed chain cannot be closed along a motion."""


class OutputError(IdentifiabilityError):
    """A result cannot be written."""


class EngineError(IdentifiabilityError):
    """The processes or the cluster that should do the work cannot be used."""


def near_match(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence: ``", did you mean 'x'?"`` with the nearest name, or ``"."``."""
    known = list(known)
    # Case slips are the commonest typos and difflib counts them as full substitutions.
    folded = {k.casefold(): k for k in known}
    close = difflib.get_close_matches(name.casefold(), list(folded), n=1, cutoff=0.6)
    return f", did you mean '{folded[close[0]]}'?" if close else "."


def listing(names: Iterable[str], most: int = 12) -> str:
    """Return the names as ``a, b, c`` and say how many were left out past `most`."""
    names = list(names)
    text = ", ".join(names[:most])
    return text if len(names) <= most else f"{text} and {len(names) - most} more"
