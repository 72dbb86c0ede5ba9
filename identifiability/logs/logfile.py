"""`LogFile`: a log too long for memory; it is checked once and then read by ranges of rows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.bags import is_bag, split_topic
from identifiability.logs.checks import CHANNELS, Clock, Numbers, find_joints, wanted_columns
from identifiability.logs.log import Log, build_log
from identifiability.logs.longtable import LongTable, is_long, open_parquet, scan_table
from identifiability.logs.signals import spread_windows
from identifiability.logs.table import is_parquet, parsing

if TYPE_CHECKING:
    import pandas as pd


@frozen
class LogFile:
    """A CSV or Parquet file with a log of any length. Make one with `LogFile.read`.

    Attributes
    ----------
    name : str
        File name.
    joints : tuple of str
        Joints (or motors) in column order.
    channels : tuple of str
        Which of position, derivatives and torque it has for every joint.
    table : LongTable
        The file.
    columns : tuple of str
        Names in the file of the columns that are read.
    clock : Clock
        First and last time, longest and shortest step.
    torque : bool
        Whether any torque is not zero.
    sha256 : str
        Hash of the file.
    stamp : (int, int)
        Size and time of change of the file when it was checked.
    span : (int, int)
        Rows of the file that this is about; all by default.
    """

    name: str
    joints: tuple[str, ...]
    channels: tuple[str, ...]
    table: LongTable
    columns: tuple[str, ...]
    clock: Clock
    torque: bool
    sha256: str
    stamp: tuple[int, int]
    span: tuple[int, int] = (0, -1)

    def __len__(self) -> int:
        """Return the number of samples."""
        return (self.table.rows if self.span[1] < 0 else self.span[1]) - self.span[0]

    def cut(self, start: int, stop: int, name: str) -> LogFile:
        """Return the samples [start, stop) of the file under another name."""
        clock = copy(self.clock)
        clock.first, clock.last = (float(self.rows(k, k + 1).t[0]) for k in (start, stop - 1))
        span = (self.span[0] + start, self.span[0] + stop)
        return replace(self, name=name, clock=clock, span=span)

    @staticmethod
    def read(path: str | Path) -> LogFile:
        """Check a file from its first row to its last, without keeping it.

        Raises
        ------
        LogError
            What `Log.read` would say of it, with the same row.
        """
        path = Path(path)
        with parsing(path):
            if not path.is_file():
                raise LogError(f"There is no log file '{path}'; give a CSV or Parquet file.")
            stamp = _stamp(path)
        digest = hashlib.sha256()
        check = _Check(str(path))
        if is_parquet(path):  # a table without rows has columns as well
            check.begin(list(open_parquet(path).columns))
        table = scan_table(path, digest, check.add)
        check.begin(list(table.columns))
        step = _usual_step(table, check.columns) if table.rows > 1 else np.nan
        check.finish(step)
        if _stamp(path) != stamp:
            raise LogError(f"{path} changed while it was read; wait until it is complete.")
        joints = check.joints
        channels = tuple(
            c for c in CHANNELS if all(f"{j}.{c}" in check.numbers for j in joints)
        )  # fmt: skip
        return LogFile(
            path.name, tuple(joints), channels, table, tuple(check.columns), check.clock,
            check.torque, digest.hexdigest(), stamp,
        )  # fmt: skip

    def rows(self, start: int, stop: int) -> Log:
        """Return the samples [start, stop) as a log of the same name.

        Raises
        ------
        LogError
            If the file changed since it was checked.
        """
        parts = list(self._arrays(start, stop))
        return self._log(np.concatenate(parts) if parts else np.empty((0, len(self.columns))))

    def overlapping(
        self, start: int, stop: int, size: int, margin: int
    ) -> Iterator[tuple[int, int, int, Log]]:
        """Yield the samples [start, stop) in pieces with margins, reading each row once.

        Parameters
        ----------
        start, stop : int
        size : int
            Samples a piece, at most.
        margin : int
            Samples that are added on both sides, as far as there are any.

        Yields
        ------
        first, last : int
            Rows of the piece itself.
        origin : int
            Row of the log's first sample.
        log : Log

        Raises
        ------
        LogError
            If the file changed since it was checked.
        """
        origin = max(0, start - margin)
        arrays = self._arrays(origin, min(len(self), stop + margin))
        held = np.empty((0, len(self.columns)))
        for first in range(start, stop, size):
            last = min(first + size, stop)
            low, high = max(0, first - margin), min(len(self), last + margin)
            held, origin = held[low - origin :], low
            parts, have = [held], len(held)
            while have < high - low:
                parts.append(next(arrays))
                have += len(parts[-1])
            held = np.concatenate(parts)
            yield first, last, origin, self._log(held[: high - low])

    def _arrays(self, start: int, stop: int) -> Iterator[Array]:
        """Yield the columns (N, c) of the rows [start, stop)."""
        self._check_unchanged()
        count = 0
        try:
            first = self.span[0]
            for values in self.table.arrays(first + start, first + stop, self.columns):
                count += len(values)
                yield values
        except LogError:
            self._check_unchanged()
            raise
        self._check_unchanged()
        if count != stop - start:
            raise self._changed()

    def _log(self, values: Array) -> Log:
        columns = {c.strip(): values[:, k] for k, c in enumerate(self.columns)}
        return build_log(self.name, self.joints, columns, self.sha256)

    def _check_unchanged(self) -> None:
        with parsing(self.table.path):
            if not self.table.path.is_file() or _stamp(self.table.path) != self.stamp:
                raise self._changed()

    def _changed(self) -> LogError:
        return LogError(
            f"{self.table.path} changed while it was analysed; wait until it is complete, then "
            "start again."
        )


class _Check:
    """What a first reading of all rows finds."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.columns: list[str] = []
        self.joints: list[str] = []
        self.numbers: dict[str, Numbers] = {}
        self.clock = Clock(source)
        self.torque = False

    def begin(self, columns: list[str]) -> None:
        """Check the names of the columns, once."""
        if self.joints:
            return
        stripped = [c.strip() for c in columns]
        self.joints = find_joints(stripped, self.source)
        known = set(wanted_columns(stripped, self.joints))
        self.columns = [c for c in columns if c.strip() in known]
        self.numbers = {c.strip(): Numbers(c.strip(), self.source) for c in self.columns}

    def add(self, frame: pd.DataFrame) -> None:
        """Check the next rows."""
        self.begin([str(c) for c in frame.columns])
        frame = frame.set_axis([str(c) for c in frame.columns], axis=1)
        for column in self.columns:
            name = column.strip()
            values = self.numbers[name].add(frame[column])
            if name == "t":
                self.clock.add(values)
            elif name.endswith(".tau"):
                self.torque = self.torque or bool(values.any())

    def finish(self, step: float) -> None:
        """Refuse the file if anything is wrong with it."""
        for numbers in self.numbers.values():
            numbers.finish()
        self.clock.finish(step)


def _usual_step(table: LongTable, columns: list[str]) -> float:
    """Return the median step of the clock [s] over the windows that decisions are made on."""
    time = [c for c in columns if c.strip() == "t"]
    steps = [
        np.diff(np.concatenate(list(table.arrays(a, b, time)))[:, 0])
        for a, b in spread_windows(table.rows)
    ]
    return float(np.median(np.concatenate(steps)))


def _stamp(path: Path) -> tuple[int, int]:
    state = path.stat()
    return state.st_size, state.st_mtime_ns


def open_log(path: str | Path) -> Log | LogFile:
    """Return a log in memory, or as a file if it is long.

    Raises
    ------
    LogError
    """
    path = Path(path)
    bag = is_bag(split_topic(path)[0])
    with parsing(path):
        long = not bag and path.is_file() and is_long(path)
    return LogFile.read(path) if long else Log.read(path)
