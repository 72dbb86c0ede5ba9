"""What a pruning step does to the columns of a model: zero some, or make some equal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from itertools import takewhile

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import Rung

#: Stands for "held at zero" where a column's group is named.
ZERO = -1


class Kind(StrEnum):
    """The kinds of move; the value is the public word."""

    UNEXCITED = "not excited"
    FORCED = "forced"
    OFFSET = "zero offset"
    MERGE = "merge Coulomb"
    ZERO = "zero by geometry"
    TIE = "tie by symmetry"
    DROP = "drop"


@frozen
class Move:
    """One step down the ladder.

    Attributes
    ----------
    kind : Kind
    zero : tuple of str
        Columns that are held at zero from now on.
    tie : tuple of tuple of str
        Sets of columns that are equal from now on.
    why : str
        What suggests it, as the beginning of a sentence.
    """

    kind: Kind
    zero: tuple[str, ...] = ()
    tie: tuple[tuple[str, ...], ...] = ()
    why: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns it touches."""
        return (*self.zero, *(c for members in self.tie for c in members))

    @property
    def text(self) -> str:
        """What is done, ``zero platform.mz`` or ``slider1.Fc+ = slider1.Fc-``."""
        parts = [" = ".join(members) for members in self.tie]
        if self.zero:
            parts.append(f"zero {', '.join(self.zero)}")
        return "; ".join(parts)


@frozen
class Partition:
    """Which columns of the starting model are still free, equal to another, or zero.

    Attributes
    ----------
    columns : tuple of str
        Of the starting model.
    group : (k,) int
        Index of the column that each one equals (its own if it leads), or `ZERO`.
    """

    columns: tuple[str, ...]
    group: np.ndarray

    @staticmethod
    def of(columns: Sequence[str]) -> Partition:
        """Return the partition in which every column is free."""
        return Partition(tuple(columns), np.arange(len(columns)))

    @property
    def leaders(self) -> list[int]:
        """The free columns, one of each set of equal ones."""
        own: list[int] = np.flatnonzero(self.group == np.arange(len(self.columns))).tolist()
        return own

    def __len__(self) -> int:
        """Return the number of free parameters."""
        return len(self.leaders)

    @cached_property
    def _positions(self) -> dict[str, int]:
        return {c: k for k, c in enumerate(self.columns)}

    def index(self, column: str) -> int:
        """Return the position of a column."""
        return self._positions[column]

    def members(self, leader: int) -> tuple[str, ...]:
        """Return the columns that equal a leader, itself first."""
        return tuple(self.columns[k] for k in np.flatnonzero(self.group == leader))

    def alive(self, columns: Iterable[str]) -> list[int]:
        """Return the distinct leaders of those columns that are not zero."""
        at = [int(self.group[self.index(c)]) for c in columns]
        return sorted({g for g in at if g != ZERO})

    def rows(self, move: Move) -> Array:
        """Return the constraints ``L x = 0`` that a move adds, (r, k); none if it is void."""
        pairs: list[tuple[int, int | None]] = [(g, None) for g in self.alive(move.zero)]
        for members in move.tie:
            first, *rest = self.alive(members) or [0]
            pairs += [(first, g) for g in rest]
        rows = np.zeros((len(pairs), len(self.columns)))
        for row, (one, other) in zip(rows, pairs, strict=True):
            row[one] = 1.0
            if other is not None:
                row[other] = -1.0
        return rows

    def apply(self, move: Move) -> Partition:
        """Return the partition after a move."""
        group = self.group.copy()
        for g in self.alive(move.zero):
            group[group == g] = ZERO
        after = replace(self, group=group)
        for members in move.tie:
            first, *rest = after.alive(members) or [0]
            for g in rest:
                group[group == g] = first
        return after

    @property
    def matrix(self) -> Array:
        """Columns of the starting model from the m free parameters, (k, m)."""
        M: Array = (self.group[:, None] == self.leaders).astype(float)
        return M

    def survivors(self) -> np.ndarray:
        """Return whether each column of the starting model is not zero, (k,) bool."""
        alive: np.ndarray = self.group != ZERO
        return alive

    def zeroed(self) -> list[str]:
        """Return the columns that are held at zero."""
        return [c for c, g in zip(self.columns, self.group, strict=True) if g == ZERO]

    def ties(self) -> dict[str, list[str]]:
        """Return the sets of equal columns, each by the name of its common parameter."""
        out: dict[str, list[str]] = {}
        for members in map(self.members, self.leaders):
            if len(members) > 1:
                name = common_name(members)
                taken = name in out or (name in self.columns and name not in members)
                out[" = ".join(members) if taken else name] = list(members)
        return out

    def rung(self, start: Rung, name: str, description: str = "") -> Rung:
        """Return the model as a rung below the starting one."""
        rung = replace(start, name=name, description=description).without(self.zeroed())
        for common, members in self.ties().items():
            rung = rung.tied(common, members)
        return rung


def common_name(columns: Sequence[str]) -> str:
    """Return a name for equal columns: ``slider1.Fc`` or ``leg*_lower.my``.

    Examples
    --------
    >>> common_name(["slider1.Fc+", "slider1.Fc-"])
    'slider1.Fc'
    >>> common_name(["leg1_lower.my", "leg2_lower.my"])
    'leg*_lower.my'
    """
    head = _beginning(columns)
    rest = [c[len(head) :] for c in columns]
    if sorted(rest) == ["+", "-"]:
        return head
    tail = _beginning([r[::-1] for r in rest])[::-1]
    return f"{head}*{tail}"


def _beginning(texts: Sequence[str]) -> str:
    """Return the letters with which all texts begin."""
    letters = takewhile(lambda each: len(set(each)) == 1, zip(*texts, strict=False))
    return "".join(each[0] for each in letters)
