"""`Log`: measured motion and torque of the actuated joints, read from CSV, Parquet or a DataFrame.

One row a sample: ``t`` [s], ``<joint>.q`` and ``<joint>.tau`` for every actuated joint, optional
``<joint>.dq`` and ``<joint>.ddq``, and what was commanded, ``<joint>.q_ref`` (or ``.cmd``),
``.dq_ref`` and ``.tau_ff``; SI units (rad or m, N·m or N). A log that is too long for memory stays
in its file, which is checked once and then read by ranges of rows: `Log.pieces`, `Log.windows`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, numbered, shorten_paths
from identifiability.foundation.options import Expected, FilePath, Names, check_option, checked
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen
from identifiability.logs import signals, tables
from identifiability.logs.base import read_base
from identifiability.logs.checks import CHANNELS, COMMANDS, Clock, find_channels
from identifiability.logs.columns import Naming, as_times, propose_locks
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.containers import stack_arrays
from identifiability.logs.reading import Reading
from identifiability.logs.spikes import Spike, Wraps, find_spikes, find_wraps
from identifiability.logs.tables import Table, is_long, parsing, scan_file, write_table

if TYPE_CHECKING:
    import pandas as pd

Numbers = Annotated[
    Any, Expected("an array of numbers", lambda x: np.asarray(x).dtype.kind in "fiu")
]


def too_long(name: str) -> LogError:
    """Return what is said of a log whose rows are asked for all at once."""
    return LogError(
        f"{name} is too long to be held in memory, which this needs; give a stretch of it."
    )


class Unread:
    """A channel of a log that is too long for memory: who needs all of it is told so."""

    def __init__(self, name: str) -> None:
        self._name = name

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise too_long(self._name)

    __array__ = __getitem__ = __len__ = __iter__ = _refuse

    def __getattr__(self, attribute: str) -> NoReturn:
        if attribute.startswith("_"):  # whoever copies or pickles it asks for what it may have
            raise AttributeError(attribute)
        self._refuse()


@frozen
class File:
    """A CSV or Parquet file with the rows of a log of any length, which was checked once.

    Attributes
    ----------
    table : Table
    naming : Naming
        Which columns are read, and what they are.
    clock : Clock
        First and last time, longest and shortest step.
    torque : bool
        Whether any torque is not zero.
    stamp : (int, int)
        Size and time of change of the file when it was checked.
    span : (int, int)
        Rows of the file that the log is about.
    spikes : mapping of str to tuple of Spike
        Wrong values of each column.
    wraps : mapping of str to Wraps
        Jumps by a turn of each column of angles.
    changes : tuple of callable(Log, int) -> Log
        What is done with rows that were read, of which the first has that number.
    """

    table: Table
    naming: Naming
    clock: Clock
    torque: bool
    stamp: tuple[int, int]
    span: tuple[int, int]
    spikes: Mapping[str, tuple[Spike, ...]]
    wraps: Mapping[str, Wraps]
    changes: tuple[Callable[[Log, int], Log], ...] = ()

    def arrays(self, start: int, stop: int) -> Iterator[Array]:
        """Yield the columns (N, c) of the rows [start, stop), some thousand rows at a time.

        Raises
        ------
        LogError
            If the file changed since it was checked.
        """
        if _stamp(self.table.path) != self.stamp:
            raise changed(self.table.path)
        wanted, first = self.naming.columns, self.span[0]
        reading = {c.source: partial(as_times, time=c) for c in wanted if c.is_time}
        columns = [c.source for c in wanted]
        yield from self.table.arrays(first + start, first + stop, columns, reading)


def changed(path: Path) -> LogError:
    """Return what is said of a file that is not what was checked."""
    return LogError(
        f"{path} changed while it was analysed; wait until it is complete, then start again."
    )


def _stamp(path: Path) -> tuple[int, int]:
    """Return size and time of change of a file; zeros if there is none."""
    if not path.is_file():
        return 0, 0
    state = path.stat()
    return state.st_size, state.st_mtime_ns


@frozen
class Log:
    """One recording, in memory, or in its file where it is too long for that.

    Attributes
    ----------
    name : str
        What it is called in print: its path, as short as it differs from those beside it.
    joints : tuple of str
        Joints (or motors) in column order.
    t : (N,) [s]
    q, tau : (N, n) [rad or m; N·m or N]
    dq, ddq, q_ref, dq_ref, tau_ff : (N, n) or None
        Derivatives, and commanded positions, velocities and torques (fed forward by a servo),
        where the log has them for every joint.
    sha256 : str
        Hash of the file, or of the values for a DataFrame.
    notes : tuple of str
        What was read otherwise than literally, half a sentence each.
    motion_alone : bool
        Whether it came without torque, for which zeros stand.
    unmeasured : (N, n) bool or None
        Where torque was not measured, for which what lies between its neighbours stands, or zeros;
        None where all was.
    servo_delay : float or None [s]
        Of the commands, where torque is what servos make of them; None where it was measured.
    rollout : (N, n) or None [rad or m]
        Positions to which the commands take a simulated robot: a record without sensors.
    start : float or None [s]
        What its times count from, on a clock that other logs share, such as seconds since 1970.
    base : (N, k) or None
        How a base that floats moved and what touches it, as `identifiability.logs.base.read_base`
        has it.
    path : str
        The path that was given, behind which a bag names its topic; empty for arrays.
    file : File or None
        Where its rows are, if it is too long for memory: its channels refuse to be held then.
    """

    name: str
    joints: tuple[str, ...]
    t: Array
    q: Array
    tau: Array
    dq: Array | None
    ddq: Array | None
    sha256: str
    notes: tuple[str, ...] = ()
    q_ref: Array | None = None
    motion_alone: bool = False
    start: float | None = None
    unmeasured: np.ndarray | None = None
    dq_ref: Array | None = None
    tau_ff: Array | None = None
    servo_delay: float | None = None
    rollout: Array | None = None
    base: Array | None = None
    path: str = ""
    file: File | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.t) if self.file is None else self.file.span[1] - self.file.span[0]

    @property
    def long(self) -> bool:
        """Whether it is too long for memory."""
        return self.file is not None

    @cached_property
    def commands_since(self) -> Array:
        """Since when the commands of each row are held, (N,) [s]: they may have another clock."""
        told = [x for x in (self.q_ref, self.dq_ref, self.tau_ff) if x is not None]
        changes = np.zeros(len(self), bool)
        for x in told:
            changes[1:] |= (np.diff(x, axis=0) != 0).any(1)
        return signals.held_since(self.t, changes)

    @staticmethod
    @checked
    def read(path: FilePath, conventions: Conventions | None = None) -> Log:
        """Read a table (CSV, Parquet, .npz, .mat, .xlsx) or bag (``run.mcap:/joint_states``).

        Parameters
        ----------
        conventions : Conventions, optional
            What is known of logs of its robot, ``Conventions.of(robot)``; by default it is read
            as it is.

        Raises
        ------
        LogError
            If the file is missing, is no table, lacks columns or holds values that cannot be.
        """
        reading = Reading(str(path), conventions or Conventions())
        digest, _ = scan_file(Path(path), reading.add, reading.known)
        values = reading.finish()
        (name,) = shorten_paths([str(path)])
        log = _with_base(build_log(name, reading.naming, values, digest), reading)
        return replace(log, motion_alone=bool(reading.made), start=reading.start, path=str(path))

    @staticmethod
    @checked
    def scan(path: FilePath, conventions: Conventions | None = None) -> Log:
        """Check a CSV or Parquet file from its first row to its last, without keeping it.

        Parameters
        ----------
        conventions : Conventions, optional
            As in `read`.

        Raises
        ------
        LogError
            What `read` would say of it, with the same row.
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
            raise changed(path)
        known, naming = reading.numbers, reading.naming
        file = File(
            table=table,
            naming=naming,
            clock=reading.clock,
            torque=reading.torque > 0,
            stamp=stamp,
            span=(0, table.rows),
            spikes={c: tuple(reading.finders[c].finish()) for c in known if c != "t"},
            wraps={c: w for c, f in reading.turns.items() if (w := f.finish()) is not None},
        )
        (name,) = shorten_paths([str(path)])
        channels: dict[str, Any] = dict.fromkeys(CHANNELS)
        channels |= dict.fromkeys(("t", *find_channels(naming.joints, known)), Unread(name))
        what: dict[str, Any] = {"sha256": digest, "notes": naming.notes, "start": reading.start}
        return Log(name, naming.joints, path=str(path), file=file, **what, **channels)

    @staticmethod
    def open(path: str | Path, conventions: Conventions | None = None) -> Log:
        """Return a log in memory, or in its file if it is long.

        Raises
        ------
        LogError
        """
        if is_long(Path(path)):
            try:
                return Log.scan(path, conventions)
            except LogError:  # columns at rates of their own are brought together in memory alone
                if is_long(Path(path), tables.MOST):
                    raise
        return Log.read(path, conventions)

    @staticmethod
    def from_frame(
        frame: pd.DataFrame, name: str = "DataFrame", conventions: Conventions | None = None
    ) -> Log:
        """Return the log in a DataFrame with the same columns as a file.

        Parameters
        ----------
        name : str
            What reports call it.
        conventions : Conventions, optional
            As in `read`.
        """
        import pandas as pd  # noqa: PLC0415 - heavy, and files do not need it

        check_option("frame", frame, pd.DataFrame)
        reading = Reading(name, conventions or Conventions())
        reading.add(frame)
        columns = reading.finish()
        log = replace(build_log(name, reading.naming, columns, ""), start=reading.start)
        log = _with_base(log, reading)
        values = log.to_frame()
        digest = hashlib.sha256(",".join(values.columns).encode())
        digest.update(np.ascontiguousarray(values.to_numpy(float)).tobytes())
        return replace(log, sha256=digest.hexdigest(), motion_alone=bool(reading.made))

    @staticmethod
    @checked
    def from_arrays(
        t: Numbers,
        q: Numbers,
        tau: Numbers,
        dq: Numbers | None = None,
        ddq: Numbers | None = None,
        *,
        joints: Names | None = None,
        name: str = "arrays",
    ) -> Log:
        """Return the log in arrays.

        Parameters
        ----------
        t : (N,) [s]
        q, tau : (N, n) or, of one joint, (N,) [rad or m; N·m or N]
        dq, ddq : (N, n), optional
            Velocity and acceleration, where they were measured.
        joints : sequence of str, optional
            Which joint each column is about; by default the robot's actuated joints in its order.
        name : str
            What reports call it.

        Raises
        ------
        LogError
            If the arrays do not fit each other, or hold what no log can.

        Example
        -------
        >>> t = np.linspace(0, 1, 100)
        >>> q = np.stack([np.sin(t), np.cos(t)], 1)
        >>> Log.from_arrays(t, q, 2 * q, joints=["shoulder", "elbow"]).joints
        ('shoulder', 'elbow')
        """
        channels = {"q": q, "dq": dq, "ddq": ddq, "tau": tau}
        given = {kind: x for kind, x in channels.items() if x is not None}
        return Log.from_frame(stack_arrays(t, given, joints, name), name)

    def rows(self, start: int, stop: int) -> Log:
        """Return the samples [start, stop) as a log of the same name, in memory.

        Raises
        ------
        LogError
            If the file of a long log changed since it was checked.
        """
        if self.file is None:
            return self.each(lambda x: x[start:stop], t=self.t[start:stop])
        parts = list(self.file.arrays(start, stop))
        none = np.empty((0, len(self.file.naming.columns)))
        return self._made(np.concatenate([none, *parts]), start)

    def windows(self) -> list[tuple[int, Log]]:
        """Return stretches on which what holds for all of it is decided, and where each begins."""
        return [(a, self.rows(a, b)) for a, b in signals.spread_windows(len(self))]

    @property
    def shown(self) -> Log:
        """Its windows as one log with gaps."""
        return join_logs([window for _, window in self.windows()])

    def pieces(
        self, size: int, margin: int = 0, start: int = 0, stop: int | None = None
    ) -> Iterator[tuple[int, int, int, Log]]:
        """Yield the samples [start, stop) in pieces with margins, reading each row once.

        Parameters
        ----------
        size : int
            Samples a piece, at most.
        margin : int
            Samples that are added on both sides, as far as there are any.
        start, stop : int
            All by default.

        Yields
        ------
        first, last : int
            Rows of the piece itself.
        origin : int
            Row of the log's first sample.
        log : Log
            In memory.

        Raises
        ------
        LogError
            If the file of a long log changed since it was checked.
        """
        stop = len(self) if stop is None else stop
        file, origin, kept = self.file, max(0, start - margin), np.empty((0, 0))
        if file is not None:
            arrays = file.arrays(origin, min(len(self), stop + margin))
            kept = np.empty((0, len(file.naming.columns)))
        for first in range(start, stop, size):
            last = min(first + size, stop)
            low, high = max(0, first - margin), min(len(self), last + margin)
            if file is None:
                yield first, last, low, self.rows(low, high)
                continue
            parts, end = [kept[low - origin :]], origin + len(kept)
            while end < high:
                part = next(arrays, None)
                if part is None:
                    raise changed(file.table.path)
                parts.append(part)
                end += len(part)
            kept, origin = np.concatenate(parts) if len(parts) > 1 else parts[0], low
            yield first, last, origin, self._made(kept[: high - low], low)

    def _made(self, values: Array, start: int) -> Log:
        """Return rows of the file, (N, c) from row `start` on, as a log in memory."""
        assert self.file is not None
        given = zip(self.file.naming.columns, values.T, strict=True)
        columns = {c.name: x if c.name == "t" else c.scale(x) for c, x in given}
        log = build_log(self.name, self.file.naming, columns, self.sha256)
        log = replace(log, start=self.start, path=self.path)
        for change in self.file.changes:
            log = change(log, self.file.span[0] + start)
        return log

    def changed(self, change: Callable[[Log, int], Log]) -> Log:
        """Return the log with its rows changed, each by itself: those of a long one when read.

        Parameters
        ----------
        change : callable(Log, int) -> Log
            Of some rows, of which the first has that number; it can be pickled.
        """
        if self.file is None:
            return change(self, 0)
        return replace(self, file=replace(self.file, changes=(*self.file.changes, change)))

    @property
    def spikes(self) -> dict[str, tuple[Spike, ...]]:
        """Wrong samples of each column that has any; commands jump as they like."""
        if self.file is not None:  # where an angle jumps by a turn, and back, nothing is wrong
            known, wraps = self.file.spikes, self.file.wraps
            return {c: x for c, x in known.items() if x and c not in wraps}
        skipped = COMMANDS if self.commanded else ()
        found = {
            f"{joint}.{c}": tuple(find_spikes(x))
            for c in self.channels
            if c not in skipped
            for joint, x in zip(self.joints, getattr(self, c).T, strict=True)
        }
        return {name: spikes for name, spikes in found.items() if spikes}

    @property
    def wraps(self) -> dict[str, Wraps]:
        """Jumps by a turn of every joint whose angle has any."""
        if self.file is not None:
            return {j: w for j in self.joints if (w := self.file.wraps.get(f"{j}.q")) is not None}
        found = {j: find_wraps(x) for j, x in zip(self.joints, self.q.T, strict=True)}
        return {j: w for j, w in found.items() if w is not None}

    def each(self, change: Callable[[Array], Array], **others: Any) -> Log:
        """Return the log with all its channels changed alike, and other fields as given."""
        others |= {channel: change(getattr(self, channel)) for channel in self.channels}
        for name in ("rollout", "base"):
            if getattr(self, name) is not None:
                others[name] = change(getattr(self, name))
        if self.unmeasured is not None:
            others["unmeasured"] = change(self.unmeasured.astype(float)) > 0
        return replace(self, **others)

    def without(self, channels: Sequence[str]) -> Log:
        """Return the log without some of its derivatives."""
        left: dict[str, Any] = dict.fromkeys(channels)
        if self.file is not None:  # nor are they read
            kept = [c for c in self.file.naming.columns if c.name.rpartition(".")[2] not in left]
            naming = replace(self.file.naming, columns=tuple(kept))
            left["file"] = replace(self.file, naming=naming)
        return replace(self, **left)

    def cut(self, start: int, stop: int, name: str) -> Log:
        """Return the samples [start, stop) under another name."""
        if self.file is None:
            return replace(self.rows(start, stop), name=name)
        first, last = (float(self.rows(k, k + 1).t[0]) for k in (start, stop - 1))
        before = self.file.span[0]
        span, clock = (before + start, before + stop), self.clock.cut(start, stop, first, last)
        return replace(self, name=name, file=replace(self.file, clock=clock, span=span))

    @cached_property
    def clock(self) -> Clock:
        """What is to be known of its times."""
        if self.file is not None:
            return self.file.clock
        clock = Clock(self.name)
        clock.add(self.t)
        return clock

    @property
    def channels(self) -> tuple[str, ...]:
        """Which of `CHANNELS` it has."""
        return tuple(c for c in CHANNELS if getattr(self, c) is not None)

    @property
    def commanded(self) -> bool:
        """Whether it holds commands, and no torque of its own."""
        commands = self.q_ref is not None or self.dq_ref is not None
        return commands and (self.motion_alone or self.servo_delay is not None)

    @property
    def torque(self) -> bool:
        """Whether any torque is not zero."""
        return bool(self.tau.any()) if self.file is None else self.file.torque

    def __repr__(self) -> str:
        span = f"{len(self)} samples over {self.clock.last - self.clock.first:.4g} s"
        return f"<Log {self.name}: {span}, {len(self.joints)} joints>"

    def _repr_html_(self) -> str:
        return shown(repr(self)[1:-1], self.rows(0, 10).to_frame(), "to_frame()")

    def to_frame(self) -> pd.DataFrame:
        """Return the log as a DataFrame that `from_frame` accepts."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        columns = {"t": self.t}
        for kind in self.channels:
            values = getattr(self, kind)
            if kind == "tau" and self.unmeasured is not None:
                values = np.where(self.unmeasured, np.nan, values)
            columns |= {f"{j}.{kind}": values[:, k] for k, j in enumerate(self.joints)}
        return pd.DataFrame(columns)

    def write(self, path: str | Path) -> Path:
        """Write a CSV or Parquet file, whole or not at all; CSV keeps every digit.

        Raises
        ------
        OutputError
            If it cannot be written, or is none of these.
        """
        return write_table(path, self.to_frame())

    def select(self, joints: Sequence[str], motors: Sequence[str] = ()) -> Log:
        """Return the log with its joints in a robot's order.

        Parameters
        ----------
        joints : sequence of str
            The robot's actuated joints.
        motors : sequence of str
            Names of motors that the log may have instead (coupled transmissions).

        Raises
        ------
        LogError
            If the log lacks a joint.
        """
        if self.joints == numbered(len(joints)):  # arrays, in the robot's order
            return replace(self, joints=tuple(joints))
        wanted = motors if motors and all(m in self.joints for m in motors) else joints
        missing = [j for j in wanted if j not in self.joints]
        if missing:
            others = [name for name in self.joints if name not in (*joints, *motors)]
            has = f", but for {listing(others)}, which the robot does not have" if others else ""
            raise LogError(
                f"{self.name} has no columns for the actuated joint"
                f"{'s' if len(missing) > 1 else ''} {listing(missing)}{has}; every actuated joint "
                f"needs '<joint>.q' and '<joint>.tau'{propose_locks(missing, wanted)}."
            )
        if tuple(wanted) == self.joints:
            return self
        order = [self.joints.index(j) for j in wanted]
        return replace(self.each(lambda x: x[:, order], joints=tuple(wanted)), base=self.base)


def join_logs(logs: Sequence[Log]) -> Log:
    """Return stretches of one log as a log with gaps."""
    kinds = ("t", *logs[0].channels)
    kinds += tuple(k for k in ("unmeasured", "base") if getattr(logs[0], k) is not None)
    joined: dict[str, Any] = {k: np.concatenate([getattr(x, k) for x in logs]) for k in kinds}
    return replace(logs[0], **joined)


def _with_base(log: Log, reading: Reading) -> Log:
    """Return a log with how the base of its robot moved, if that floats."""
    if reading.beside is None or reading.known.base is None:
        return log
    record, notes = read_base(reading.known.base, reading.beside, reading.source)
    return replace(log, base=record, notes=(*log.notes, *notes))


def build_log(name: str, naming: Naming, values: Mapping[str, Array], digest: str) -> Log:
    """Return the log of some columns, each (N,), that were checked."""
    channels: dict[str, Any] = dict.fromkeys(CHANNELS)
    joints = naming.joints
    for kind in find_channels(joints, values):
        channels[kind] = np.stack([values[f"{j}.{kind}"] for j in joints]).T
    t, gone = values["t"], np.isnan(channels["tau"])
    if gone.any():
        channels["unmeasured"] = gone
        pairs = zip(channels["tau"].T, gone.T, strict=True)
        channels["tau"] = np.stack([_bridge(t, x, missing) for x, missing in pairs], 1)
    return Log(name=name, joints=joints, t=t, sha256=digest, notes=naming.notes, **channels)


def _bridge(t: Array, x: Array, lost: np.ndarray) -> Array:
    """Return a column (N,) with straight lines where it is lost, zeros if all of it is."""
    return np.zeros(len(x)) if lost.all() else np.interp(t, t[~lost], x[~lost])


# Logs that are given twice, and the clock of a session.


def check_held_out(train: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse a log that is given twice: its repetition would pass for new evidence.

    Stretches of one log that share no time are no repetition.

    Raises
    ------
    LogError
    """
    for k, s in enumerate(train):
        for other in train[:k]:
            if s.sha256 and _same(s, other):
                raise LogError(Finding("twice.fitted", "", log=s.name, other=other.name))
    for s in held_out:
        for other in train:
            if _same(s, other):
                raise LogError(Finding("twice.held", "", log=s.name, other=other.name))


def _same(one: Log, other: Log) -> bool:
    """Whether two logs are from one record and share some of its time."""
    if one.sha256 != other.sha256:
        return False
    if one.long or other.long or not (len(one) and len(other)):
        return True
    return bool(one.t[0] <= other.t[-1] and other.t[0] <= one.t[-1])


def share_clock(logs: Sequence[Log]) -> list[Log]:
    """Return logs whose starts count from where the first of them begins, or all without a start.

    A robot records one log at a time: logs of which two overlap are not of one clock, and where one
    does not say when it began, nothing is known of the order of all.
    """
    spans = [
        (log.start + log.clock.first, log.start + log.clock.last)
        for log in logs
        if log.start is not None
    ]
    order = sorted(spans)
    if len(spans) < len(logs) or any(last >= first for (_, last), (first, _) in pairwise(order)):
        return [log if log.start is None else replace(log, start=None) for log in logs]
    return [replace(log, start=(log.start or 0.0) - order[0][0]) for log in logs]
