"""`RuleTable`: every number by which a room decides, in one frozen table that is printed.

A room's table is `rules.py`: each field is ``name: Annotated[float, "meaning [unit], basis"]``.
What decides nothing stands where it is used, with its reason: how much is done at once (whole
numbers), and how finely one looks (a `Tolerance`, where several places share it).
"""

from __future__ import annotations

from dataclasses import fields
from typing import TypeAlias
from typing import get_type_hints as resolve

from identifiability.foundation.options import check_fields
from identifiability.foundation.values import frozen

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
    title = ""

    def __post_init__(self) -> None:
        check_fields(self)

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Return of every number its name, its value with its unit, its basis and its meaning."""
        kinds, rows = resolve(type(self), include_extras=True), []
        for name in (field.name for field in fields(self)):
            told = next(n for n in kinds[name].__metadata__ if isinstance(n, str))
            said, _, basis = told.rpartition(", ")
            meaning, _, unit = said.rpartition(" [") if said[-1] == "]" else (said, "", "")
            many = getattr(self, name)
            text = " … ".join(f"{x:.10g}" for x in (many if isinstance(many, tuple) else (many,)))
            rows.append((name, f"{text} {unit.removesuffix(']')}".rstrip(), basis, meaning))
        return rows
