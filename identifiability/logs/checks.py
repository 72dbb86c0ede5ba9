"""Checks of the columns of a log, piece by piece, so that it need not fit in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

if TYPE_CHECKING:
    import pandas as pd

#: What a log has of each joint.
CHANNELS = ("q", "dq", "ddq", "tau")

#: Fewer samples than this say nothing about any robot.
FEWEST = 20

#: No time, position or torque in SI units is larger (time since 1970 in s is 1.7e9).
LARGEST = 1e12

#: No log is sampled faster than this [s].
SHORTEST_STEP = 1e-7


def check_columns(columns: list[str], source: str) -> None:
    """Refuse a table without time, or with a column twice.

    Raises
    ------
    LogError
    """
    if "t" not in columns:
        likely = [c for c in columns if c == "T" or c.casefold().startswith("time")]
        guess = f", did you mean '{likely[0]}'?" if likely else "."
        raise LogError(
            f"{source} has no column 't' (time in s){guess} It has the columns {listing(columns)}."
        )
    repeated = sorted({c for c in columns if columns.count(c) > 1})
    if repeated:
        raise LogError(f"{source} has the column '{repeated[0]}' more than once; keep one of them.")


def find_joints(columns: list[str], source: str) -> list[str]:
    """Return the joints that a table has position and torque of.

    Raises
    ------
    LogError
        If a column is missing or there twice.
    """
    check_columns(columns, source)
    joints = [c.removesuffix(".q") for c in columns if c.endswith(".q")]
    if not joints:
        raise LogError(
            f"{source} has no position column; expected '<joint>.q' and '<joint>.tau' for every "
            f"actuated joint, found {listing(columns)}."
        )
    named = {c.removesuffix(".tau") for c in columns if c.endswith(".tau")}
    for joint in joints:
        if joint not in named:
            raise LogError(
                f"{source} has '{joint}.q' but no torque column '{joint}.tau'"
                f"{near_match(joint + '.tau', _loose(columns, joint))} "
                "Every actuated joint needs both."
            )
    for joint in sorted(named):
        if joint not in joints:
            raise LogError(
                f"{source} has '{joint}.tau' but no position column '{joint}.q'"
                f"{near_match(joint + '.q', _loose(columns, joint))} "
                "Every actuated joint needs both."
            )
    return joints


def wanted_columns(columns: Sequence[str], joints: Sequence[str]) -> list[str]:
    """Return the columns that a log is made of, in the order of the table."""
    known = {f"{j}.{kind}" for j in joints for kind in CHANNELS}
    return [c for c in columns if c == "t" or c in known]


def _loose(columns: list[str], joint: str) -> list[str]:
    """Return the columns that may be a misspelt one of a joint: those that belong nowhere else."""
    owners = [(c, *c.rpartition(".")[::2]) for c in columns]
    paired = {joint, *(o for _, o, _ in owners if {f"{o}.q", f"{o}.tau"} <= set(columns))}
    return [c for c, owner, kind in owners if owner not in paired or kind not in CHANNELS]


class Numbers:
    """Turns the pieces of a column into floats and remembers what is wrong with them.

    Parameters
    ----------
    column, source : str
        Its name, and the file it stands in.
    """

    def __init__(self, column: str, source: str) -> None:
        self.column, self.source = column, source
        self.rows = self.bad = 0
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
        finite = np.isfinite(numbers)
        if not finite.all():
            bad = np.flatnonzero(~finite)
            self.bad += len(bad)
            if self._first is None:
                self._first = (self.rows + int(bad[0]), str(given.iloc[bad[0]])[:40])
        if self._large is None:
            large = np.flatnonzero(np.abs(numbers) > LARGEST)
            if len(large):
                self._large = (self.rows + int(large[0]), float(numbers[large[0]]))
        self.rows += len(numbers)
        return numbers

    def finish(self) -> None:
        """Refuse a column with values that are no finite number of a size that can be.

        Raises
        ------
        LogError
            With the first such row.
        """
        if self._first is not None:
            row, text = self._first
            advice = (
                "give numbers with a decimal point"
                if self.bad == self.rows
                else "remove or repair these rows"
            )
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

    try:
        numbers: Array = pd.to_numeric(given, errors="coerce").to_numpy(float, na_value=np.nan)
    except (TypeError, ValueError):  # cells that hold lists, categories …
        numbers = np.full(len(given), np.nan)
    return numbers


def read_numbers(frame: pd.DataFrame, column: str, source: str) -> Array:
    """Return a column as floats, (N,).

    Raises
    ------
    LogError
        With the first row that is not a finite number of a size that can be.
    """
    numbers = Numbers(column, source)
    values = numbers.add(frame[column])
    numbers.finish()
    return values


@frozen
class Step:
    """One step of the clock: its length [s], and the row and time [s] it starts from."""

    length: float
    row: int
    t: float


class Clock:
    """Follows the times of a log piece by piece.

    Attributes
    ----------
    rows : int
    first, last : float [s]
    longest, shortest : Step
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.rows = 0
        self.first = self.last = np.nan
        self.longest = Step(-np.inf, 0, np.nan)
        self.shortest = Step(np.inf, 0, np.nan)
        self._back: tuple[int, float, float] | None = None

    def add(self, t: Array) -> None:
        """Take in the next times, (N,) [s]."""
        if not len(t):
            return
        joined = t if not self.rows else np.concatenate([[self.last], t])
        start = self.rows - (1 if self.rows else 0)
        if not self.rows:
            self.first = float(t[0])
        steps = np.diff(joined)
        if len(steps):
            back = np.flatnonzero(~(steps > 0))
            if len(back) and self._back is None:
                k = int(back[0])
                self._back = (start + k, float(joined[k]), float(joined[k + 1]))
            k = int(np.argmax(steps))
            if steps[k] > self.longest.length:
                self.longest = Step(float(steps[k]), start + k, float(joined[k]))
            k = int(np.argmin(steps))
            if steps[k] < self.shortest.length:
                self.shortest = Step(float(steps[k]), start + k, float(joined[k]))
        self.rows += len(t)
        self.last = float(t[-1])

    def finish(self, step: float) -> None:
        """Refuse times that are too few or do not increase.

        Parameters
        ----------
        step : float [s]
            The usual step.

        Raises
        ------
        LogError
        """
        check_length(self.rows, self.source)
        if self._back is not None:
            row, t, then = self._back
            raise LogError(
                f"{self.source}: time does not increase after data row {row + 1} (t = {t:g} s, "
                f"then {then:g} s); sort the rows and remove repeated ones."
            )
        if step < SHORTEST_STEP:
            raise LogError(
                f"{self.source} has a sampling step of {step:.3g} s, which no robot has; give the "
                "time in s."
            )


def check_length(rows: int, source: str) -> None:
    """Refuse a log of a few samples.

    Raises
    ------
    LogError
    """
    if rows < FEWEST:
        raise LogError(
            f"{source} has {rows} samples, too few to say anything; at least {FEWEST} are needed "
            "and some hundreds are usual."
        )


def check_times(t: Array, source: str) -> Clock:
    """Refuse times (N,) [s] that are too few or do not increase; return what was seen of them.

    Raises
    ------
    LogError
    """
    check_length(len(t), source)
    clock = Clock(source)
    clock.add(t)
    clock.finish(float(np.median(np.diff(t))))
    return clock
