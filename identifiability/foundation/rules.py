"""`RuleTable`: every number by which a room decides, in one frozen table that is printed.

A room's table is `rules.py`: each field is ``name: Annotated[float, "meaning [unit], basis"]``.
What decides nothing stands where it is used, with its reason: how much is done at once (whole
numbers), and how finely one looks (a `Tolerance`, where several places share it).
"""

from __future__ import annotations

from typing import TypeAlias

from .options import check_fields
from .values import frozen

#: A number of an algorithm: a step, a width, a rounding. It says how an answer is found, not which.
Tolerance: TypeAlias = float


@frozen
class RuleTable:
    """A room's numbers: each is a field, whose annotation says what it means.

    Raises
    ------
    OptionError
        If a number is none that its annotation allows.
    """

    #: What its numbers decide.
    def __post_init__(self) -> None:
        check_fields(self)
