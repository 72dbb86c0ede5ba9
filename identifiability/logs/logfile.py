"""`LogFile`: a log too long for memory; it is checked once and then read by ranges of rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from pathlib import Path

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array, shorten_paths
from identifiability.foundation.values import frozen
from identifiability.logs import source
from identifiability.logs.checks import Clock, find_channels
from identifiability.logs.columns import Naming, as_times
from identifiability.logs.conventions import Conventions
from identifiability.logs.log import Log, build_log
from identifiability.logs.names import Column
from identifiability.logs.reading import MixedRatesError, Reading
from identifiability.logs.source import is_long, scan_file
from identifiability.logs.spikes import Spike, Wraps, mend_column
from identifiability.logs.tables import Table, parsing


@frozen
class LogFile:
    """A CSV or Parquet file with a log of any length. Make one with `LogFile.read`.

    Attributes
    ----------
    name : str
        As of a `Log`.
    joints : tuple of str
        Joints (or motors) in column order.
    channels : tuple of str
        Which of position, derivatives and torque it has for every joint.
    table : Table
        The file.
    naming : Naming
        Which columns are read, and what they are.
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
    spikes, mended : mapping of str to tuple of Spike
        Wrong values of each column, and those that are replaced when it is read.
    wraps, unwrapped : mapping of str to Wraps
        Jumps by a turn of each column of angles, and those that are undone when it is read.
    start : float or None [s]
    path : str
        As of a `Log`.
    silent : tuple of str
        Joints whose torque was not measured.
    """

    name: str
    joints: tuple[str, ...]
    channels: tuple[str, ...]
    table: Table
    naming: Naming
    clock: Clock
    torque: bool
    sha256: str
    stamp: tuple[int, int]
    span: tuple[int, int] = (0, -1)
    spikes: Mapping[str, tuple[Spike, ...]] = field(default_factory=dict)
    mended: Mapping[str, tuple[Spike, ...]] = field(default_factory=dict)
    wraps: Mapping[str, Wraps] = field(default_factory=dict)
    unwrapped: Mapping[str, Wraps] = field(default_factory=dict)
    start: float | None = None
    silent: tuple[str, ...] = ()
    path: str = ""

    @property
    def motion_alone(self) -> bool:
        """Whether it came without torque, as no long log may."""
        return False

    @property
    def notes(self) -> tuple[str, ...]:
        """What was read otherwise than literally, half a sentence each."""
        return self.naming.notes

    def __len__(self) -> int:
        """Return the number of samples."""
        return (self.table.rows if self.span[1] < 0 else self.span[1]) - self.span[0]

    def cut(self, start: int, stop: int, name: str) -> LogFile:
        """Return the samples [start, stop) of the file under another name."""
        first, last = (float(self.rows(k, k + 1).t[0]) for k in (start, stop - 1))
        clock = self.clock.cut(start, stop, first, last)
        span = (self.span[0] + start, self.span[0] + stop)
        return replace(self, name=name, clock=clock, span=span)

    def without(self, channels: Sequence[str]) -> LogFile:
        """Return the log without some of its derivatives."""
        ends = tuple(f".{channel}" for channel in channels)
        left = tuple(c for c in self.naming.columns if not c.name.endswith(ends))
        own = tuple(c for c in self.channels if c not in channels)
        return replace(self, naming=replace(self.naming, columns=left), channels=own)

    @staticmethod
    def read(path: str | Path, conventions: Conventions | None = None) -> LogFile:
        """Check a file from its first row to its last, without keeping it.

        Parameters
        ----------
        path : str or Path
        conventions : Conventions, optional
            As in `Log.read`.

        Raises
        ------
        LogError
            What `Log.read` would say of it, with the same row.
        """
        path = Path(path)
        with parsing(path):
            stamp = _stamp(path)
        reading = Reading(str(path), conventions or Conventions(), keep=False)
        digest, table = scan_file(path, reading.add, reading.known)
        reading.finish()
        if reading.made:
            raise LogError(
                f"{path} has no torque and is too long to be held in memory; give stretches of it."
            )
        assert table is not None  # a bag is no file of rows
        if _stamp(path) != stamp:
            raise LogError(f"{path} changed while it was read; wait until it is complete.")
        known = reading.numbers
        return LogFile(
            name=shorten_paths([str(path)])[0],
            path=str(path),
            joints=reading.naming.joints,
            channels=find_channels(reading.naming.joints, known),
            table=table,
            naming=reading.naming,
            clock=reading.clock,
            torque=reading.torque > 0,
            sha256=digest,
            stamp=stamp,
            spikes={c: tuple(reading.finders[c].finish()) for c in known if c != "t"},
            wraps={c: w for c, f in reading.turns.items() if (w := f.finish()) is not None},
            start=reading.start,
        )

    def rows(self, start: int, stop: int) -> Log:
        """Return the samples [start, stop) as a log of the same name.

        Raises
        ------
        LogError
            If the file changed since it was checked.
        """
        parts = list(self._arrays(start, stop))
        values = np.concatenate(parts) if parts else np.empty((0, len(self.naming.columns)))
        return self._log(values, start)

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
        kept = np.empty((0, len(self.naming.columns)))
        for first in range(start, stop, size):
            last = min(first + size, stop)
            low, high = max(0, first - margin), min(len(self), last + margin)
            parts, end = [kept[low - origin :]], origin + len(kept)
            while end < high:
                parts.append(next(arrays))
                end += len(parts[-1])
            kept, origin = np.concatenate(parts) if len(parts) > 1 else parts[0], low
            yield first, last, origin, self._log(kept[: high - low], low)

    def _arrays(self, start: int, stop: int) -> Iterator[Array]:
        """Yield the columns (N, c) of the rows [start, stop)."""
        self._check_unchanged()
        wanted = self.naming.columns
        count, first, columns = 0, self.span[0], [c.source for c in wanted]
        reading = {c.source: partial(as_times, time=c) for c in wanted if c.is_time}
        try:
            for values in self.table.arrays(first + start, first + stop, columns, reading):
                count += len(values)
                yield values
        except LogError:
            self._check_unchanged()
            raise
        self._check_unchanged(whole=count == stop - start)

    def _log(self, values: Array, start: int) -> Log:
        given = zip(self.naming.columns, values.T, strict=True)
        columns = {c.name: self._settle(c, x, start) for c, x in given}
        log = build_log(self.name, self.naming, columns, self.sha256)
        lost = np.isin(log.joints, self.silent)
        gone = np.tile(lost, (len(log), 1)) if lost.any() else None
        return replace(log, start=self.start, unmeasured=gone, path=self.path)

    def _settle(self, column: Column, values: Array, start: int) -> Array:
        """Return values of a column, (N,) from row `start` on, in SI units and without faults."""
        if column.name == "t":
            return values
        values = column.scale(values)
        if column.name in self.mended:
            values = mend_column(values, self.mended[column.name], self.span[0] + start)
        if column.name in self.unwrapped:
            values = self.unwrapped[column.name].undo(values, self.span[0] + start)
        return values

    def _check_unchanged(self, *, whole: bool = True) -> None:
        path = self.table.path
        with parsing(path):
            if not whole or _stamp(path) != self.stamp:
                raise LogError(
                    f"{path} changed while it was analysed; wait until it is complete, then start "
                    "again."
                )


def _stamp(path: Path) -> tuple[int, int]:
    """Return size and time of change of a file; zeros if there is none."""
    if not path.is_file():
        return 0, 0
    state = path.stat()
    return state.st_size, state.st_mtime_ns


def open_log(path: str | Path, conventions: Conventions | None = None) -> Log | LogFile:
    """Return a log in memory, or as a file if it is long.

    Raises
    ------
    LogError
    """
    if is_long(Path(path)):
        try:
            return LogFile.read(path, conventions)
        except MixedRatesError:
            if is_long(Path(path), source.MOST):
                raise
    return Log.read(path, conventions)
