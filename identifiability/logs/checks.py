"""Checks of the columns of a log, piece by piece, so that it need not fit in memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_count
from identifiability.foundation.values import frozen

from .rows import divide_rows
from .rules import RULES

if TYPE_CHECKING:
    import pandas as pd

#: Commands of each joint: position, velocity, feed-forward torque.
COMMANDS = ("q_ref", "dq_ref", "tau_ff")

#: Position and torque of each motor, beside those of its joint: both sides of a gear.
MOTOR = ("q_m", "tau_m")

#: Motion of each joint: position, velocity, acceleration.
MOTIONS = ("q", "dq", "ddq")

#: Channels of a log for each joint.
CHANNELS = (*MOTIONS, "tau", *COMMANDS, *MOTOR)


class Numbers:
    """Converts the pieces of a column to floats and records their errors.

    Parameters
    ----------
    column, source : str
        Name of the column, and name of its file.
    """

    def __init__(self, column: str, source: str) -> None:
        self.column = column
        self.source = source
        self.rows = self.bad = self.empty = 0
        self._first: tuple[int, str] | None = None
        self._large: tuple[int, float] | None = None

    def add(self, given: pd.Series) -> Array:
        """Return the next piece as floats, (N,); other values become NaN.

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
        bad = ~np.isfinite(numbers)
        large = np.abs(numbers) > RULES.largest
        if bad.any() and self._first is None:
            k = int(np.argmax(bad))
            self._first = self.rows + k, str(given.iloc[k])[:40]
        if large.any() and self._large is None:
            k = int(np.argmax(large))
            self._large = self.rows + k, float(numbers[k])
        self.bad += int(bad.sum())
        if bad.any():
            self.empty += int(given.isna().sum())
        self.rows += len(numbers)
        return numbers

    @property
    def clean(self) -> bool:
        """Return whether every cell so far is empty or a finite number of possible size."""
        return self.bad == self.empty and self._large is None

    @property
    def lost(self) -> bool:
        """Return whether cells are empty, and nothing else is wrong."""
        return self.clean and self.bad > 0

    @property
    def usable(self) -> bool:
        """Return whether every value so far is a finite number of possible size."""
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
    """Return a column as floats, (N,); other values become NaN."""
    import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

    if given.dtype == float:  # there is nothing to parse
        return np.array(given)
    try:
        numbers = pd.to_numeric(given, errors="coerce").to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):  # cells that hold lists, categories …
        numbers = np.full(len(given), np.nan)
    return numbers


@frozen
class Clock:
    """Properties of the times of a log.

    Attributes
    ----------
    rows : int
    first, last : float [s]
    usual : float [s]
        The usual step.
    longest : float [s]
        Of all steps.
    odd : (3, m)
        Rows of the steps that are not the usual one, their times and next times [s].
    back : (k, 3)
        The first rows after which time does not increase, and the same of these.
    """

    rows: int
    first: float
    last: float
    usual: float
    longest: float
    odd: Array
    back: Array

    @staticmethod
    def of(t: Array) -> Clock:
        """Return the clock of times (N,) [s]."""
        odd = [np.empty((3, 0))]
        back = [np.empty((3, 0))]
        usual = np.nan
        longest = -np.inf
        for a, b in divide_rows(len(t) - 1):
            part = t[a : b + 1]
            steps = np.diff(part)
            if len(steps) and np.isnan(usual):
                usual = float(np.median(steps))
            longest = max(longest, float(steps.max(initial=-np.inf)))
            every = np.stack([np.arange(a, b), part[:-1], part[1:]])
            # Steps that differ from the usual one by more than this share of it are remembered.
            odd.append(every[:, np.abs(steps - usual) > 0.4 * usual])
            back.append(every[:, ~(steps > 0)][:, :1])
        first, last = (float(t[0]), float(t[-1])) if len(t) else (np.nan, np.nan)
        kept = np.concatenate(odd, 1), np.concatenate(back, 1).T
        return Clock(len(t), first, last, usual, longest, *kept)

    def check(self, source: str) -> None:
        """Refuse times that are too few or do not increase.

        Raises
        ------
        LogError
        """
        if self.rows < RULES.fewest:
            raise LogError(
                f"{source} has {format_count(self.rows, 'sample')}, too few to say "
                f"anything; at least {RULES.fewest} are needed and some hundreds are usual."
            )
        for row, t, then in self.back[:1].tolist():
            remedy = "sort the rows and remove repeated ones"
            if row >= RULES.fewest and then <= self.first:
                remedy = (
                    "time starts again, so save each recording as a file; of a LeRobot dataset "
                    "give the folder"
                )
            raise LogError(
                f"{source}: time does not increase after data row {row + 1:.0f} (t = "
                f"{t:g} s, then {then:g} s); {remedy}."
            )
        # No log is sampled faster than this.
        if self.usual < 1e-07:
            raise LogError(Finding("clock.fast", source, step=self.usual))
