"""The one list of data-quality checks: what each looks at, and what follows from what it says."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Any, TypeAlias

from identifiability.foundation.values import frozen

#: Returns sentences that name the column and the remedy, none for sound logs, of `MeasuredLogs`;
#: what mends returns logs that are being read with these sentences (`mends.Reading`).
Find: TypeAlias = Callable[[Any], Any]


class Does(StrEnum):
    """What follows from what a check says."""

    MISREADS = "columns are read as what they are not: no verdict stands"
    EXPLAINS = "whatever else contradicts physics follows from it, and is not said"
    HINTS = "it is said"
    MENDS = "it is mended when logs are read, and said"


@frozen
class Check:
    """A data-quality check.

    Attributes
    ----------
    title : str
        What it looks for.
    does : Does
    find : callable(MeasuredLogs) -> tuple of str, or callable(Reading) -> Reading
    rank : int
        Of two explanations the one of lower rank is given; hints are said in this order.
    always : bool
        Whether it also looks at logs that have nothing to explain; what it says is of the robot
        file, or of all logs together.
    says, means, do : str
        How its sentence begins (… is what changes from log to log), what that means, and the
        remedy, for the page of messages.
    """

    title: str
    does: Does
    find: Find
    rank: int
    always: bool = False
    says: str = ""
    means: str = ""
    do: str = ""


#: All checks, by rank.
CHECKS: list[Check] = []


def check(
    title: str,
    does: Does,
    rank: int,
    *,
    always: bool = False,
    says: str = "",
    means: str = "",
    do: str = "",
) -> Callable[[Find], Find]:
    """Register a check; parameters as in `Check`.

    Example
    -------
    ::

        @check("a brake that stays on", Does.HINTS, 90)
        def find_brake(logs):
            dragging = ...
            return (f"{listing(dragging)} drags: release its brake, and log anew.",)
    """

    def decorate(find: Find) -> Find:
        CHECKS.append(Check(title, does, find, rank, always, says, means, do))
        CHECKS.sort(key=lambda one: one.rank)
        return find

    return decorate
