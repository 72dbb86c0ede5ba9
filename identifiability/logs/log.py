"""`Log`: measured motion and torque of the actuated joints, read from CSV, Parquet or a DataFrame.

Each row is a sample: ``t`` [s], and ``<joint>.q`` and ``<joint>.tau`` of every actuated joint.
Optional columns are ``<joint>.dq`` and ``<joint>.ddq``, and the commands ``<joint>.q_ref`` (or
``.cmd``), ``.dq_ref`` and ``.tau_ff``. Units are SI (rad or m, N·m or N). A log that is too long
for memory stays in its file. The file is checked once and then read by ranges of rows:
`Log.pieces`, `Log.windows`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, Strings, numbered, shorten_paths
from identifiability.foundation.options import Expected, FilePath, Names, check_option, checked
from identifiability.foundation.quoting import option_for_shell
from identifiability.foundation.result import shown
from identifiability.foundation.values import Fields, frozen

from . import signals
from .base import measure_way, read_base
from .checks import CHANNELS, COMMANDS, Clock
from .codes import Code
from .columns import tell_missing
from .conventions import Conventions
from .form import PLAIN
from .formats.containers import stack_arrays
from .formats.list_cells import spread_lists
from .formats.reader import Whole
from .rows import divide_rows, find_range, gather, is_long, spread_windows
from .rules import RULES
from .spikes import Spike, find_spikes
from .table_reader import TableReader
from .tables import read_pieces, write_table

if TYPE_CHECKING:
    import pandas as pd

Numbers = Annotated[
    Any, Expected("an array of numbers", lambda x: np.asarray(x).dtype.kind in "fiu")
]


def too_long(name: str) -> LogError:
    """Return the error for a request of all rows of a long log at once."""
    return LogError(
        f"{name} is too long to be held in memory, which this needs; give a stretch of it."
    )


@frozen
class Log:
    """One recording, in memory, or in its file if it is too long.

    Attributes
    ----------
    name : str
        Name in messages: its path, shortened as far as it differs from other logs.
    joints : tuple of str
        Joints (or motors) in column order.
    t : (N,) [s]
    q, tau : (N, n) [rad or m; N·m or N]
    dq, ddq, q_ref, dq_ref, tau_ff : (N, n) or None
        Derivatives, and commanded positions, velocities and torques (feed-forward of a servo), if
        the log has them for every joint.
    q_m, tau_m : (N, n) or None
        Position and torque of the motors as their joints see them (times or over the gear ratio),
        if torque was measured on both sides of gears.
    sha256 : str
        Hash of the file, or of the values for a DataFrame.
    notes : tuple of str
        Interpretations that are not literal, half a sentence each.
    motion_alone : bool
        Whether it has no torque; `tau` is then zero.
    unmeasured : (N, n) bool or None
        Mask of unmeasured torque, which is interpolated or zero in `tau`; None if all was measured.
    servo_delay : float or None [s]
        Delay of the commands, if torque was computed from them; None if torque was measured.
    rollout : (N, n) or None [rad or m]
        Positions of a simulated robot under the commands: a record without sensors.
    start : float or None [s]
        Origin of its times on a clock that other logs share, such as seconds since 1970.
    base : (N, k) or None
        Motion and contacts of a floating base, as `identifiability.logs.base.read_base` returns
        them.
    held_way : tuple of float [m, rad]
        How far the columns of a base that is stated as fixed move and turn it.
    path : str
        The given path, with the topic of a bag; empty for arrays.
    speed_error : (n,) or None [rad/s or m/s]
        Standard deviation of its velocities if its motion is a fitted series; None for measured
        motion.
    codes : mapping of str to Code
        Codes of signed numbers that its table shows, by the kind of column.
    drives_alone : bool
        Whether `tau` is motor torque minus link torque.
    arrivals : (N,) or None [s]
        Time since which the commands of each row are held, if they arrived irregularly.
    aside : (N, n) bool or None
        Mask of joints that move as they were measured, whatever their command; None if all follow.
    """

    name: str
    joints: Strings
    t: Array
    q: Array
    tau: Array
    dq: Array | None
    ddq: Array | None
    sha256: str
    notes: Strings = ()
    q_ref: Array | None = None
    motion_alone: bool = False
    start: float | None = None
    unmeasured: Array | None = None
    dq_ref: Array | None = None
    tau_ff: Array | None = None
    q_m: Array | None = None
    tau_m: Array | None = None
    servo_delay: float | None = None
    rollout: Array | None = None
    base: Array | None = None
    held_way: tuple[float, float] = (0.0, 0.0)
    path: str = ""
    speed_error: Array | None = None
    codes: Mapping[str, Code] = {}
    drives_alone: bool = False
    arrivals: Array | None = None
    aside: Array | None = None

    def __len__(self) -> int:
        return len(self.t)

    @property
    def long(self) -> bool:
        """Return whether it has so many rows that they stay on the disk."""
        return is_long(len(self))

    @cached_property
    def commands_since(self) -> Array:
        """Return the time since which the commands of each row are held, (N,) [s]."""
        if self.arrivals is not None:
            return self.arrivals
        told = [x for x in (self.q_ref, self.dq_ref, self.tau_ff) if x is not None]
        none = np.zeros(self.q.shape)
        # A joint that is set aside moves as it was measured, by no command.
        aside = none > 0 if self.aside is None else self.aside
        sizes = [np.abs(np.diff(x, axis=0, prepend=x[:1])) for x in told]
        changes = np.where(aside, 0.0, sum(sizes, none)).sum(1)
        return signals.held_since(self.t, changes)

    @staticmethod
    @checked
    def read(path: FilePath, conventions: Conventions | None = None) -> Log:
        """Read a table (CSV, Parquet, .npz, .mat, .xlsx) or bag (``run.mcap:/joint_states``).

        Parameters
        ----------
        conventions : Conventions, optional
            Conventions of its robot, ``Conventions.of(robot)``; by default it is read literally.

        Raises
        ------
        LogError
            If the file is missing, is no table, lacks columns or holds impossible values.
        """
        reader = TableReader(str(path), conventions or Conventions())
        log = _read_log(reader, read_pieces(Path(path), reader.known))
        (name,) = shorten_paths([str(path)])
        return replace(
            log,
            name=name,
            path=str(path),
        )

    @staticmethod
    def from_frame(
        frame: pd.DataFrame, name: str = "DataFrame", conventions: Conventions | None = None
    ) -> Log:
        """Return the log in a DataFrame with the same columns as a file.

        Parameters
        ----------
        name : str
            Name of the log in reports.
        conventions : Conventions, optional
            As in `read`. Commands count with those of a robot that has servos.
        """
        import pandas as pd  # noqa: PLC0415 - heavy, and files do not need it

        check_option("frame", frame, pd.DataFrame)
        check_option("name", name, str)
        frame = spread_lists(name, frame)
        log = _read_log(TableReader(name, conventions or Conventions()), [(frame, PLAIN, "")])
        values = log.to_frame()
        digest = hashlib.sha256(",".join(values.columns).encode())
        digest.update(np.ascontiguousarray(values.to_numpy(float)).tobytes())
        return replace(log, sha256=digest.hexdigest())

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
            Velocity and acceleration, if they were measured.
        joints : sequence of str, optional
            Joint of each column; by default the robot's actuated joints in its order.
        name : str
            Name of the log in reports.

        Raises
        ------
        LogError
            If the arrays do not fit each other, or hold impossible values.

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

    def rows(self, start: int, stop: int, name: str = "") -> Log:
        """Return the samples [start, stop) as a log, of the same name by default."""
        t = self.t[start:stop]
        return self.each(
            lambda x: x[start:stop],
            t=t,
            name=name or self.name,
        )

    def windows(self) -> list[tuple[int, Log]]:
        """Return the stretches that decide for the whole log, with the first row of each."""
        return [(a, self.rows(a, b)) for a, b in spread_windows(len(self))]

    @property
    def shown(self) -> Log:
        """Its windows as one log with gaps."""
        return join_logs([window for _, window in self.windows()])

    def changed(self, change: Callable[[Log, int], Log]) -> Log:
        """Return the log after a change of its rows.

        Parameters
        ----------
        change : callable(Log, int) -> Log
            Function of some rows and the index of the first; it changes each row by itself.
        """
        pieces = (change(self.rows(a, b), a)._arrays for a, b in divide_rows(len(self)))
        return replace(self, **gather(pieces))

    @property
    def _arrays(self) -> Fields:
        """Return the arrays that have a row for every sample, by name."""
        names = ("t", *self.channels, "rollout", "base", "unmeasured", "aside", "arrivals")
        found = {name: getattr(self, name) for name in names}
        return {name: x for name, x in found.items() if x is not None}

    @property
    def spikes(self) -> dict[str, list[Spike]]:
        """Wrong samples of each column that has any; commands jump as they like."""
        skipped = COMMANDS if self.commanded else ()
        found = {
            f"{joint}.{c}": find_spikes(x)
            for c in self.channels
            if c not in skipped
            for joint, x in zip(self.joints, getattr(self, c).T, strict=True)
        }
        return {name: spikes for name, spikes in found.items() if spikes}

    def each(self, change: Callable[[Array], Array], **others: Any) -> Log:
        """Return the log with one change for all its channels, and with the given other fields."""
        arrays = {name: change(x) for name, x in self._arrays.items() if name != "t"} | others
        masks = {k: arrays[k] > 0 for k in ("unmeasured", "aside") if k in arrays}
        return replace(self, **arrays | masks)

    def without(self, channels: Sequence[str]) -> Log:
        """Return the log without some of its derivatives."""
        none: Fields = dict.fromkeys(channels)
        return replace(self, **none)

    @cached_property
    def clock(self) -> Clock:
        """Return the properties of its times."""
        return Clock.of(self.t)

    @property
    def channels(self) -> Strings:
        """Which of `CHANNELS` it has."""
        return tuple(c for c in CHANNELS if getattr(self, c) is not None)

    @property
    def commanded(self) -> bool:
        """Return whether it holds commands, and no measured torque."""
        commands = self.q_ref is not None or self.dq_ref is not None
        return commands and (self.motion_alone or self.servo_delay is not None)

    @property
    def is_unmeasured(self) -> np.ndarray:
        """Joints of which no row is data, (n,) bool."""
        if self.unmeasured is None:
            return np.zeros(len(self.joints), bool)
        return np.all(self.unmeasured, axis=0)

    @property
    def torque(self) -> bool:
        """Return whether any torque is not zero."""
        return any(self.tau[a:b].any() for a, b in divide_rows(len(self)))

    def __repr__(self) -> str:
        span = f"{len(self)} samples over {self.clock.last - self.clock.first:.4g} s"
        return f"<Log {self.name}: {span}, {len(self.joints)} joints>"

    def _repr_html_(self) -> str:
        return shown(repr(self)[1:-1], self.rows(0, 10).to_frame(), "to_frame()")

    def split_sensors(self, joints: Sequence[str]) -> tuple[Log, ...]:
        """Return the log as its sensors behind and before gears measured it.

        The first has link torque along the motion of the links. The second has motor torque minus
        link torque, along the motion of the motors where it was measured. A log with one sensor is
        returned as it is.

        Parameters
        ----------
        joints : sequence of str
            Joints with both sensors; torque of other joints is no data in the second.
        """
        if self.tau_m is None or not joints:
            return (self,)
        links = replace(self, q_m=None, tau_m=None)
        other = np.array([joint not in joints for joint in self.joints])
        unmeasured = np.broadcast_to(other, self.tau.shape)
        if self.unmeasured is not None:
            unmeasured = unmeasured | self.unmeasured
        moved = Fields()
        if self.q_m is not None:
            moved = {"q": np.where(other, self.q, self.q_m), "dq": None, "ddq": None}
        unmeasured_some = unmeasured if unmeasured.any() else None
        drives = replace(
            links,
            name=f"{self.name} (motors)",
            path="",
            tau=self.tau_m - self.tau,
            unmeasured=unmeasured_some,
            drives_alone=True,
            **moved,
        )
        return links, drives

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
            If it cannot be written, or has another ending.
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
        missing = [f"{j}.{kind}" for j in wanted if j not in self.joints for kind in ("q", "tau")]
        if missing:
            others = [name for name in self.joints if name not in (*joints, *motors)]
            raise LogError(tell_missing(self.name, missing, wanted, others))
        if tuple(wanted) == self.joints:
            return self
        order = [self.joints.index(j) for j in wanted]
        ordered = self.each(lambda x: x[:, order], joints=tuple(wanted))
        return replace(ordered, base=self.base, arrivals=self.arrivals)


def join_logs(logs: Sequence[Log]) -> Log:
    """Return stretches of one log as a log with gaps."""
    parts = [log._arrays for log in logs]
    joined: Fields = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    return replace(logs[0], **joined)


def bridge_gaps(t: Array, tau: Array, unmeasured: np.ndarray) -> Array:
    """Return torque (N, n) with linear interpolation where it is unmeasured, (N, n) bool.

    Torque that is missing entirely is zero.
    """
    bridged = np.zeros(tau.shape)
    for k, known in enumerate(~unmeasured.T):
        if known.any():
            bridged[:, k] = np.interp(t, t[known], tau[known, k])
    return bridged


def _read_log(reader: TableReader, pieces: Iterable[Whole]) -> Log:
    """Return the log in the pieces of a table."""
    values = reader.read(pieces)
    naming = reader.naming
    fields: Fields = dict.fromkeys(("q", "dq", "ddq", "tau")) | values
    notes = naming.notes
    t = values["t"]
    tau = values["tau"]
    if np.isnan(find_range(tau)[0]).any():
        gone = fields["unmeasured"] = np.isnan(tau)
        fields["tau"] = bridge_gaps(t, tau, gone)
    if reader.known.base is not None:
        beside = reader.known.base, t, reader.beside, reader.source
        fields["base"], told = read_base(*beside)
        notes = (*notes, told)
    elif reader.known.is_held:
        fields["held_way"] = measure_way(reader.beside)
    return Log(
        reader.source,
        naming.joints,
        sha256=reader.sha256,
        notes=notes,
        motion_alone=bool(naming.made),
        start=reader.start,
        codes=naming.codes,
        **fields,
    )


# Logs that are given twice, and the clock of a session.


def check_held_out(train: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse a log that is given twice: its repetition would pass for new evidence.

    Stretches of one log that share no time are no repetition.

    Raises
    ------
    LogError
    """
    for k, log in enumerate((*train, *held_out)):
        held = k >= len(train)
        for other in train[:k]:
            if (held or log.sha256) and _same(log, other):
                key = "twice.held" if held else "twice.fitted"
                raise LogError(Finding(key, "", log=log.name, other=other.name))


def _same(one: Log, other: Log) -> bool:
    """Return whether two logs are from one record and share some of its time."""
    if one.sha256 != other.sha256:
        return False
    if not (len(one) and len(other)):
        return True
    before = one.t[0] <= other.t[-1]
    return bool(before and other.t[0] <= one.t[-1])


def share_clock(logs: Sequence[Log]) -> list[Log]:
    """Return logs with starts relative to the first log, or all without a start.

    A robot records one log at a time, so logs that overlap do not share a clock. If one log has no
    start, the order of all is unknown.
    """
    spans = [
        (log.start + log.clock.first, log.start + log.clock.last)
        for log in logs
        if log.start is not None
    ]
    order = sorted(spans)
    several = len(spans) < len(logs)
    if several or any(last >= first for (_, last), (first, _) in pairwise(order)):
        return [log if log.start is None else replace(log, start=None) for log in logs]
    return [replace(log, start=(log.start or 0.0) - order[0][0]) for log in logs]


def refuse_silent(logs: Sequence[Log]) -> None:
    """Refuse joints without motion and torque in any log: as free joints they hide others.

    Raises
    ------
    LogError
        If there are such joints. The error lists locks that hold them, as for a gripper's fingers.
    """
    gone = [log.unmeasured for log in logs if log.unmeasured is not None]
    if len(gone) < len(logs) or len({log.joints for log in logs}) > 1:
        return
    q = np.concatenate([log.q for log in logs])
    lost = np.concatenate(gone).all(0)
    stays = lost & (np.ptp(q, axis=0) <= RULES.small)
    if 0 < stays.sum() < len(stays):
        joints = np.array(logs[0].joints)[stays]
        medians = np.median(q, axis=0)[stays]
        at = zip(
            joints,
            medians,
            strict=True,
        )
        silent = {str(j): option_for_shell("--lock", f"{j}={x:.4g}") for j, x in at}
        names = [log.name for log in logs]
        locks = " ".join(silent.values())
        raise LogError(
            Finding(
                "logs.unmeasured",
                names=names,
                joints=[*silent],
                locks=locks,
            )
        )
