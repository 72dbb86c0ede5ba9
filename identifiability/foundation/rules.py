"""`RuleTable`: every number by which a room decides, in one frozen table that is printed.

A room's table is `rules.py`: each field is ``name: Annotated[float, "meaning [unit], basis"]``.
Numbers that decide nothing stand where they are used, with their reason. They are sizes of pieces
of work (whole numbers) and resolutions of a search. A `Tolerance` is a resolution that several
places share.
"""

from __future__ import annotations

from typing import TypeAlias

from .options import check_fields
from .values import frozen

#: A number of an algorithm: a step, a width, a rounding. It affects how an answer is found, not the
#: answer.
Tolerance: TypeAlias = float


@frozen
class RuleTable:
    """A room's numbers: each is a field, whose annotation gives its meaning.

    Raises
    ------
    OptionError
        If a number is out of the range of its annotation.
    """

    #: Purpose of its numbers.
    def __post_init__(self) -> None:
        check_fields(self)
