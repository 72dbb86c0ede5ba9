"""`RuleTable`: every number by which a room decides, in one frozen table that is printed.

A room's table is `rules.py`: a docstring that gives each number its unit, its basis and its
meaning, and the numbers. What decides nothing stays beside its algorithm: how much is done at once
(whole numbers), and how finely one looks (a `Tolerance`).
"""

from __future__ import annotations

import re
from inspect import cleandoc
from typing import Any, NamedTuple, TypeAlias

from identifiability.foundation.options import check_fields
from identifiability.foundation.values import frozen

#: A number of an algorithm: a step, a width, a rounding. It says how an answer is found, not which.
Tolerance: TypeAlias = float

#: Where a number is from: a publication; a test's level; a derivation; cases that were tried; a
#: reason that its text gives; nowhere but a developer's judgement.
BASES = ("literature", "level", "derived", "calibrated", "reasoned", "by hand")

_ENTRY = re.compile(
    r"^(?P<name>\w+) : [\w\[\], .]*?(?: \[(?P<unit>[^\]]+)\])?, "
    rf"(?P<basis>{'|'.join(BASES)}|studies/\w+\.py)\n(?P<meaning>(?:    .*(?:\n|$))+)",
    re.MULTILINE,
)


class Rule(NamedTuple):
    """A number, as it is printed."""

    name: str
    value: Any
    unit: str
    basis: str
    meaning: str

    @property
    def text(self) -> str:
        """The value with its unit."""
        many = self.value if isinstance(self.value, tuple) else (self.value,)
        return f"{' … '.join(f'{x:.10g}' for x in many)} {self.unit}".rstrip()


@frozen
class RuleTable:
    """A room's numbers; each is a field, and an entry ``name : type [unit], basis`` of `__doc__`.

    Raises
    ------
    OptionError
        If a number is none that its annotation allows.
    """

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def title(self) -> str:
        """What its numbers decide."""
        return cleandoc(self.__doc__ or "").partition("\n")[0].rstrip(".")

    def rows(self) -> list[Rule]:
        """Return every number with its unit, its basis and its meaning."""
        _, _, text = cleandoc(self.__doc__ or "").partition("Attributes\n----------\n")
        return [
            Rule(
                e["name"],
                getattr(self, e["name"]),
                e["unit"] or "",
                e["basis"],
                " ".join(e["meaning"].split()),
            )
            for e in _ENTRY.finditer(text)
        ]
