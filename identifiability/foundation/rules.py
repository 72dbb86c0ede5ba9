"""`RuleTable`: every number by which a room decides, in one frozen table that is printed.

A room's table is `rules.py`: each field is ``name: Annotated[float, "meaning [unit], basis"]``.
What decides nothing stands where it is used, with its reason: how much is done at once (whole
numbers), and how finely one looks (a `Tolerance`, where several places share it).
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple, TypeAlias
from typing import get_type_hints as resolve

from identifiability.foundation.options import check_fields
from identifiability.foundation.values import frozen

#: A number of an algorithm: a step, a width, a rounding. It says how an answer is found, not which.
Tolerance: TypeAlias = float

#: Where a number is from: a publication; a test's level; a derivation; cases that were tried; a
#: reason that its text gives; nowhere but a developer's judgement.
BASES = ("literature", "level", "derived", "calibrated", "reasoned", "by hand")


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
    """A room's numbers: each is a field, whose annotation says what it means.

    Raises
    ------
    OptionError
        If a number is none that its annotation allows.
    """

    #: What its numbers decide.
    title = ""

    def __post_init__(self) -> None:
        check_fields(self)

    def rows(self) -> list[Rule]:
        """Return every number with its unit, its basis and its meaning."""
        kinds = resolve(type(self), include_extras=True)
        return [self._row(f.name, *kinds[f.name].__metadata__) for f in fields(self)]

    def _row(self, name: str, *notes: Any) -> Rule:
        said, _, basis = next(n for n in notes if isinstance(n, str)).rpartition(", ")
        meaning, _, unit = (
            said.removesuffix("]").rpartition(" [") if said[-1] == "]" else (said, "", "")
        )
        return Rule(name, getattr(self, name), unit, basis, meaning)
