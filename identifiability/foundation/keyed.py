"""`Row`: the result for one parameter; `Keyed`: results whose rows are found by name."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar

from .errors import IdentifiabilityError, listing, near_match
from .values import frozen


@frozen(kw_only=True)
class Row:
    """One row of a result: an estimate with its uncertainty and its verdict.

    Attributes
    ----------
    name : str
        Key of the row, such as ``joint_2.Fc``.
    estimate, standard_error : float [unit]
        Not a number where the result has none.
    interval : (float, float) [unit]
        95 % interval.
    unit : str
        Empty for a number without a unit.
    verdict : str
        Word of the verdict, such as ``identifiable``; empty where the result gives none.
    reason : str
        Reason of the verdict.
    details : mapping
        All further columns of the same row of ``to_frame()``, by column.
    """

    name: str
    estimate: float
    standard_error: float = math.nan
    interval: tuple[float, float] = (math.nan, math.nan)
    unit: str = ""
    verdict: str = ""
    reason: str = ""
    details: Mapping[str, Any]

    def __str__(self) -> str:
        """Return the row in one line."""
        value = f"{self.name} = {self.estimate:.4g} {self.unit}".rstrip()
        low, high = (f"{end:.4g}" for end in self.interval)
        spread = f"standard error {self.standard_error:.2g}, 95 % interval {low} … {high}"
        return ", ".join(filter(None, (value, spread, self.verdict, self.reason)))


def name_estimates(
    estimates: Iterable[tuple[str, float, float, str]], **told: Any
) -> Iterator[Row]:
    """Yield rows of names, estimates, standard errors and units; `told` are fields of all rows."""
    from .rounding import REACH  # noqa: PLC0415 - SciPy

    for name, value, error, unit in estimates:
        interval = (value - REACH * error, value + REACH * error)
        yield Row(
            name=name,
            estimate=value,
            standard_error=error,
            interval=interval,
            unit=unit,
            **{"details": {}, **told},
        )


def explain_combination(groups: Sequence[str]) -> str:
    """Return that a parameter is part of the named base parameters; empty without one."""
    if not groups:
        return ""
    return f"motion determines it only in combination, as part of {listing(groups, 4)}."


class UnknownNameError(IdentifiabilityError, KeyError):
    """A result has no row of the name that was asked for."""

    __str__ = Exception.__str__  # a KeyError would quote the sentence


class Keyed:
    """A result whose rows are found by name: ``result["joint_2.Fc"]``."""

    #: Subject of the rows, for the sentence that refuses a name.
    row_kind: ClassVar[str] = "parameter"

    def rows_by_name(self) -> Iterable[Row]:
        """Return the rows; a later row of the same name replaces an earlier one."""
        return ()

    def explain_absence(self, name: str) -> str:
        """Return why a known name has no row; empty if the reason is unknown."""
        del name
        return ""

    def row_names(self) -> tuple[str, ...]:
        """Return the names of all rows, in their order."""
        return tuple(dict.fromkeys(row.name for row in self.rows_by_name()))

    def __getitem__(self, name: str) -> Row:
        """Return the row of a name.

        Raises
        ------
        UnknownNameError
            If there is no such row. The error names the nearest name and the call that lists all
            names.
        """
        rows = {row.name: row for row in self.rows_by_name()}
        if name in rows:
            return rows[name]
        if not rows:
            raise UnknownNameError("This result has no rows by name; to_frame() is its table.")
        why = self.explain_absence(str(name))
        if why:
            raise UnknownNameError(f"This result has no row '{name}': {why}")
        raise UnknownNameError(
            f"This result has no {self.row_kind} '{name}'{near_match(str(name), rows)} "
            f"It has {listing(rows, 4)}; row_names() lists all, to_frame() shows them."
        )

    def __contains__(self, name: object) -> bool:
        """Return whether there is a row of a name."""
        return name in self.row_names()

    def _ipython_key_completions_(self) -> list[str]:
        """Return the names that a notebook completes after ``result["``."""
        return list(self.row_names())

    #: A result is no sequence: rows are asked for by name.
    __iter__: ClassVar[Iterator[Any] | None] = None
