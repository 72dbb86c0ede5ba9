"""Checks of the columns of a log, piece by piece, so that it need not fit in memory."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_count
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES

if TYPE_CHECKING:
    import pandas as pd

#: What was commanded of each joint: position, velocity, torque that is fed forward.
COMMANDS = ("q_ref", "dq_ref", "tau_ff")

#: What a log has of each joint.
CHANNELS = ("q", "dq", "ddq", "tau", *COMMANDS)


def find_channels(joints: Sequence[str], columns: Collection[str]) -> tuple[str, ...]:
    """Return which of `CHANNELS` some columns hold for every joint."""
    return tuple(c for c in CHANNELS if all(f"{j}.{c}" in columns for j in joints))


class Numbers:
    """Turns the pieces of a column into floats and remembers what is wrong with them.

    Parameters
    ----------
    column, source : str
        Its name, and the file it stands in.
    """

    def __init__(self, column: str, source: str) -> None:
        self.column, self.source = column, source
        self.rows = self.bad = self.empty = 0
        self._first: tuple[int, str] | None = None
        self._large: tuple[int, float] | None = None

    def add(self, given: pd.Series) -> Array:
        """Return the next piece as floats, (N,); what is no number is NaN.

        Raises
        ------
        LogError
            If it holds another kind of value altogether.
        """
        if len(given) and getattr(given.dtype, "kind", "O") in "mMcb":
            raise LogError(
                f"{self.source}: column '{self.column}' holds {given.dtype} (first "
                f"'{given.iloc[0]}'); give numbers in SI "
                f"units{', seconds' if self.column == 't' else ''}."
            )
        numbers = to_floats(given)
        bad = np.flatnonzero(~np.isfinite(numbers))
        large = np.flatnonzero(np.abs(numbers) > RULES.largest)
        if len(bad) and self._first is None:
            self._first = (self.rows + int(bad[0]), str(given.iloc[bad[0]])[:40])
        if len(large) and self._large is None:
            self._large = (self.rows + int(large[0]), float(numbers[large[0]]))
        self.bad += len(bad)
        self.empty += int(given.isna().sum()) if len(bad) else 0
        self.rows += len(numbers)
        return numbers

    @property
    def clean(self) -> bool:
        """Whether every cell so far is empty or a finite number of a size that can be."""
        return self.bad == self.empty and self._large is None

    @property
    def lost(self) -> bool:
        """Whether cells are empty, and nothing else is wrong."""
        return self.clean and self.bad > 0

    @property
    def usable(self) -> bool:
        """Whether every value so far is a finite number of a size that can be."""
        return self._first is None and self._large is None

    def finish(self) -> None:
        """Refuse a column with values that are no finite number of a size that can be.

        Raises
        ------
        LogError
            With the first such row.
        """
        if self._first is not None:
            row, text = self._first
            every = self.bad == self.rows
            advice = "give numbers with a decimal point" if every else "remove or repair these rows"
            raise LogError(
                f"{self.source}: column '{self.column}' is not a finite number in {self.bad} of "
                f"{self.rows} rows, first in data row {row + 1} ('{text}'); {advice}."
            )
        if self._large is not None:
            row, value = self._large
            raise LogError(
                f"{self.source}: column '{self.column}' is {value:g} in data row {row + 1}, more "
                f"than anything in SI units can be{' (time in s)' if self.column == 't' else ''}; "
                "repair the value or convert the unit."
            )


def to_floats(given: pd.Series) -> Array:
    """Return a column as floats, (N,); NaN for what is no number."""
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if given.dtype == float:  # there is nothing to parse
        return np.array(given)
    try:
        numbers: Array = pd.to_numeric(given, errors="coerce").to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):  # cells that hold lists, categories …
        numbers = np.full(len(given), np.nan)
    return numbers


@frozen
class ClockStep:
    """One step of the clock: the row and the time [s] it starts from, and the time it leads to."""

    row: int
    t: float
    then: float

    @property
    def length(self) -> float:
        """How long it is [s]."""
        return self.then - self.t


class Clock:
    """Follows the times of a log piece by piece.

    Attributes
    ----------
    rows : int
    first, last : float [s]
    longest, shortest : ClockStep
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.rows = 0
        self.first = self.last = self._usual = np.nan
        self.longest, self.shortest = ClockStep(0, 0.0, -np.inf), ClockStep(0, 0.0, np.inf)
        self._before = np.empty(0)
        self._back: ClockStep | None = None
        self._odd: list[Array] = []

    def add(self, t: Array) -> None:
        """Take in the next times, (N,) [s]."""
        if not len(t):
            return
        if not self.rows:
            self.first = float(t[0])
        start = self.rows - len(self._before)
        t = np.concatenate([self._before, t])
        self.rows, self.last, self._before = start + len(t), float(t[-1]), t[-1:]
        steps = np.diff(t)
        if not len(steps):
            return

        def step(k: np.intp) -> ClockStep:
            return ClockStep(start + int(k), float(t[k]), float(t[k + 1]))

        self.longest = max(self.longest, step(steps.argmax()), key=lambda s: s.length)
        self.shortest = min(self.shortest, step(steps.argmin()), key=lambda s: s.length)
        if np.isnan(self._usual):
            self._usual = float(np.median(steps))
        # Steps of the clock that differ from the usual one by more than this share of it
        # are remembered.
        odd = np.flatnonzero(np.abs(steps - self._usual) > 0.4 * self._usual)
        self._odd.append(np.stack([start + odd, t[odd], t[odd + 1]]))
        back = np.flatnonzero(~(steps > 0))
        if len(back) and self._back is None:
            self._back = step(back[0])

    @property
    def odd(self) -> tuple[np.ndarray, Array, Array]:
        """Rows (m,), times and next times [s] of the steps that are not the usual one."""
        rows, t, then = np.concatenate([np.empty((3, 0)), *self._odd], axis=1)
        return rows.astype(int), t, then

    def cut(self, start: int, stop: int, first: float, last: float) -> Clock:
        """Return the clock of the rows [start, stop), from the time `first` to `last` [s]."""
        cut = copy(self)
        rows, t, then = self.odd
        inside = (rows >= start) & (rows < stop - 1)
        cut._odd = [np.stack([rows - start, t, then])[:, inside]]
        cut.rows, cut.first, cut.last = stop - start, first, last
        return cut

    def finish(self) -> None:
        """Refuse times that are too few or do not increase.

        Raises
        ------
        LogError
        """
        if self.rows < RULES.fewest:
            raise LogError(
                f"{self.source} has {format_count(self.rows, 'sample')}, too few to say "
                f"anything; at least {RULES.fewest} are needed and some hundreds are usual."
            )
        if self._back is not None:
            raise LogError(
                f"{self.source}: time does not increase after data row {self._back.row + 1} (t = "
                f"{self._back.t:g} s, then {self._back.then:g} s); sort the rows and remove "
                "repeated ones."
            )
        # No log is sampled faster than this.
        if self._usual < 1e-07:
            raise LogError(Finding("clock.fast", self.source, step=self._usual))
