"""Bags: recordings of ROS 1 and ROS 2 in, a table of joint states out. Needs the extra ``ros``.

A bag is a folder of rosbag2, or one file: ``.mcap``, ``.db3`` or ``.bag``. Of its topics one of
type ``sensor_msgs/JointState`` is read; name it behind a colon where there are several, as in
``run.mcap:/arm/joint_states``. Position, velocity and effort become ``<joint>.q``, ``<joint>.dq``
and ``<joint>.tau`` as they are: the message type promises rad, rad/s and N·m (m, m/s, N), but some
drivers publish motor currents as effort, which are no torques. Joints without effort (NaN) are
passive and left out.

Commands are those of one topic of ``control_msgs/JointTrajectoryControllerState`` (its reference),
``control_msgs/MultiDOFCommand`` or ``std_msgs/Float64MultiArray`` (values in the robot's order), if
there is just one that tells of the joints; else it is named, too: ``run.mcap:/joint_states,/goal``.
They stand for torque where no joint has effort.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, numbered
from identifiability.logs.form import PLAIN
from identifiability.logs.formats.reader import Whole, hash_files, reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from identifiability.logs.conventions import Conventions

#: Files that are bags by themselves.
BAGS = (".mcap", ".db3", ".bag")

#: What ROS 2 and ROS 1 call the type.
JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")

#: Types of commands, and the fields of their names, positions and velocities.
COMMANDS = {
    "control_msgs/msg/JointTrajectoryControllerState": ("joint_names", "reference", ""),
    "control_msgs/msg/MultiDOFCommand": ("dof_names", "values", "values_dot"),
    "std_msgs/msg/Float64MultiArray": ("", "data", ""),
}

#: What of messages about a base that floats is a column of logs: where a vector is, and its name.
BASE = {
    "sensor_msgs/msg/Imu": (
        ("linear_acceleration", "base.acc", "xyz"),
        ("angular_velocity", "base.gyro", "xyz"),
    ),
    "nav_msgs/msg/Odometry": (
        ("pose.pose.position", "odom.position", "xyz"),
        ("pose.pose.orientation", "odom.orientation", "xyzw"),
        ("twist.twist.linear", "odom.linear", "xyz"),
        ("twist.twist.angular", "odom.angular", "xyz"),
    ),
    "geometry_msgs/msg/PoseStamped": (
        ("pose.position", "pose.position", "xyz"),
        ("pose.orientation", "pose.orientation", "xyzw"),
    ),
    "geometry_msgs/msg/WrenchStamped": (
        ("wrench.force", "{topic}.force", "xyz"),
        ("wrench.torque", "{topic}.torque", "xyz"),
    ),
}

#: Field of the message for every channel of a log.
FIELDS = {"q": "position", "dq": "velocity", "tau": "effort"}


def split_topic(path: str | Path) -> tuple[Path, str]:
    """Return the bag and the topic in ``bag:/topic``; the topic is empty if none is named."""
    bag, colon, topic = str(path).rpartition(":/")
    if colon and is_bag(Path(bag)):
        return Path(bag), f"/{topic}"
    return Path(path), ""


def is_bag(path: Path) -> bool:
    """Whether a path is, or by its name wants to be, a bag."""
    try:
        return path.suffix.lower() in BAGS or (path / "metadata.yaml").is_file()
    except OSError:  # no name of a file
        return False


def read_bag(path: str | Path, known: Conventions) -> pd.DataFrame:
    """Read the joint states of a bag as a table with the columns of a log.

    Parameters
    ----------
    path : str or Path
        The bag, or ``bag:/topic``; behind a comma the topic of commands.
    known : Conventions
        Of the robot: where messages differ, those that lack one of its joints (as of a gripper) are
        passed over; positions of its joints count though no effort tells of them.

    Returns
    -------
    DataFrame
        ``t`` [s] from the first message on, ``<joint>.q``, ``<joint>.dq``, ``<joint>.tau`` or
        ``<joint>.cmd``, the command that was recorded last; the stamp of the first message [s] is
        ``attrs["start"]``.

    Raises
    ------
    LogError
        If the bag has no such topic or joints.
    """
    bag, named = split_topic(path)
    with _opened(bag) as reader:
        name, _, of = named.partition(",")
        states = _choose_topic(bag, reader, name)
        goal = _choose_commands(bag, reader, of)
        told = _Told(f"{bag}: the joint states on {states}", known)
        frame = told.read(_messages(reader, states, JOINT_STATE), commanded=bool(goal))
        if goal:
            _add_commands(reader, frame, goal)
        _add_base(reader, frame)
        return frame


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag; old ones that do not define their messages are read by today's definitions."""
    if not path.exists():
        raise LogError(f"There is no bag '{path}'; give a .mcap, .db3 or .bag file or a folder.")
    try:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise LogError(Finding("bag.extra", path)) from None
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        yield reader


def _messages(reader: Any, topic: str, kinds: Collection[str]) -> Iterator[tuple[int, Any]]:
    """Time of recording [ns] and message, for every message of a topic of some types."""
    own = [c for c in reader.connections if c.topic == topic and c.msgtype in kinds]
    for connection, recorded, raw in reader.messages(connections=own):
        yield recorded, reader.deserialize(raw, connection.msgtype)


def _choose_topic(path: Path, reader: Any, wanted: str) -> str:
    found = sorted({str(c.topic) for c in reader.connections if c.msgtype in JOINT_STATE})
    if wanted in found or (not wanted and len(found) == 1):
        return wanted or found[0]
    if not found:
        others = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        raise LogError(Finding("bag.none", path, others=listing(others) or "nothing"))
    if not wanted:
        first = {topic: next(_messages(reader, topic, JOINT_STATE), None) for topic in found}
        told = [t for t, x in first.items() if x and np.isfinite(x[1].effort).any()]
        raise LogError(Finding("bag.several", path, topics=[*found], first=(told or found)[0]))
    raise _no_topic(path, "joint states", wanted, found)


def _no_topic(path: Path, what: str, wanted: str, found: Sequence[str]) -> LogError:
    return LogError(
        f"{path} has no {what} on the topic '{wanted}'{near_match(wanted, found)} It has them on "
        f"{listing(found) or 'none'}."
    )


def _choose_commands(path: Path, reader: Any, wanted: str) -> str:
    """Return the topic of commands; empty if there is none, or several and none is named.

    Raises
    ------
    LogError
        If the named one has none.
    """
    found = {str(c.topic): c.msgtype for c in reader.connections if c.msgtype in COMMANDS}
    if wanted and wanted not in found:
        raise _no_topic(path, "commands", wanted, sorted(found))
    named = [topic for topic, kind in found.items() if COMMANDS[kind][0]]
    chosen = [wanted] if wanted else named or [*found]  # names are better than an order
    return chosen[0] if len(chosen) == 1 else ""


def _add_commands(reader: Any, frame: pd.DataFrame, topic: str) -> None:
    """Add the commands that were recorded last before each row to joint states."""
    kind = next(c.msgtype for c in reader.connections if c.topic == topic)
    names_of, of, dot_of = COMMANDS[kind]
    when, rows, called = list[int](), list[tuple[Array, ...]](), tuple[str, ...]()
    for recorded, message in _messages(reader, topic, COMMANDS):
        point = getattr(message, of)
        values = (getattr(point, "positions", point), getattr(point, "velocities", ()))
        values = (values[0], getattr(message, dot_of)) if dot_of else values
        names = tuple(getattr(message, names_of)) if names_of else numbered(len(values[0]))
        called = called or names
        if names == called and len(values[0]) == len(names):
            when.append(recorded)
            rows.append(tuple(np.asarray(x, float) for x in values))
    if not rows:
        return
    last = np.searchsorted(when, frame.attrs["recorded"], side="right") - 1
    kinds = ["cmd"]
    if all(len(row[1]) == len(called) and np.isfinite(row[1]).all() for row in rows):
        kinds.append("dq_cmd")  # else velocities that nobody commands
    for k, end in enumerate(kinds):
        held = np.array([row[k] for row in rows])[last]
        held[last < 0] = np.nan
        frame[[f"{name}.{end}" for name in called]] = held


def _add_base(reader: Any, frame: pd.DataFrame) -> None:
    """Add what messages about a base, and of wrenches, hold to joint states.

    By their own stamps, on straight lines, at the times of the joint states. Of a type on several
    topics nothing says which is the base's, but for wrenches, which have the names of theirs.
    """
    topics = {str(c.topic): c.msgtype for c in reader.connections if c.msgtype in BASE}
    for topic, kind in topics.items():
        if [*topics.values()].count(kind) > 1 and "{topic}" not in BASE[kind][0][1]:
            continue
        when, rows = list[float](), list[list[float]]()
        for _, message in _messages(reader, topic, BASE):
            when.append(_stamp(message) * 1e-9 - frame.attrs["start"])
            rows.append([attrgetter(f"{of}.{a}")(message) for of, _, ax in BASE[kind] for a in ax])
        if len(rows) > 1:
            names = [f"{name}.{a}" for _, name, ax in BASE[kind] for a in ax]
            order = np.argsort(when, kind="stable")
            for name, column in zip(names, np.array(rows, float)[order].T, strict=True):
                own = name.format(topic=topic.strip("/").replace("/", "."))
                frame[own] = np.interp(frame["t"], np.array(when)[order], column)


def _stamp(message: Any) -> int:
    """Return when a message says that it was made [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


class _Told:
    """Joint states of one topic, of which messages may tell of other joints than others do."""

    def __init__(self, source: str, known: Conventions) -> None:
        self.source, self.known = source, known

    def read(self, messages: Iterable[tuple[int, Any]], *, commanded: bool) -> pd.DataFrame:
        """Return what messages of all wanted joints say, by their stamps."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        rows: dict[tuple[str, ...], list[Array]] = {}
        clocks: dict[tuple[str, ...], list[tuple[int, int]]] = {}
        for recorded, message in messages:
            names = tuple(message.name)
            each = [np.asarray(getattr(message, field), float) for field in FIELDS.values()]
            none = np.full(len(names), np.nan)
            each = [x if len(x) == len(names) else none for x in each]
            rows.setdefault(names, []).append(np.concatenate(each))
            clocks.setdefault(names, []).append((_stamp(message), recorded))
        wanted = self._choose([*rows])
        told = [names for names in rows if wanted and {*wanted} <= {*names}]
        if not told:
            raise LogError(
                f"{self.source} have no message that tells of all of {listing(wanted, 4)}; "
                f"they tell of {listing([*dict.fromkeys(chain(*rows))], 6)}."
            )
        columns = {names: [f"{n}.{kind}" for kind in FIELDS for n in names] for names in told}
        parts = [pd.DataFrame(np.array(rows[names]), columns=columns[names]) for names in told]
        table = pd.concat(parts, ignore_index=True)
        stamped, recordings = np.array([x for names in told for x in clocks[names]], np.int64).T
        stamp = stamped if stamped.min() > 0 else recordings
        order = np.argsort(stamp, kind="stable")
        frame: pd.DataFrame = self._columns(table.iloc[order], wanted, commanded=commanded)
        frame.insert(0, "t", (stamp[order] - stamp.min()) * 1e-9)
        frame.attrs["start"] = float(stamp.min()) * 1e-9  # on the clock of the stamps
        frame.attrs["recorded"] = recordings[order]
        frame.attrs["mixed"] = len({frozenset(names) for names in rows}) > 1
        return frame

    def _choose(self, groups: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
        """Return the joints of all messages; where these differ, those of the robot.

        Raises
        ------
        LogError
        """
        first = groups[0] if groups else ()
        odd = [g for g in groups if {*g} != {*first}]
        if not odd:
            return first
        rename = self.known.columns.apply
        called = {rename(name): name for name in sorted({*chain(*groups)})}
        for joints in (self.known.motors, self.known.joints):
            if joints and {*joints} <= {*called}:
                needed = [called[j] for j in joints]
                group = next((g for g in groups if {*needed} <= {*g}), ())
                return (*needed, *(n for n in group if rename(n) in self.known.locked))
        raise LogError(
            f"{self.source} tell of different joints ({listing(first)}; then {listing(odd[0])}), "
            "and no message of all joints that are needed: if they are called otherwise, add "
            "--map 'OLD=NEW', and lock what does not move (a gripper, say), --lock JOINT=VALUE."
        )

    def _columns(self, table: pd.DataFrame, wanted: Sequence[str], *, commanded: bool) -> Any:
        """Return the columns that say something; joints without effort are passive.

        Raises
        ------
        LogError
        """
        there = table.notna()
        told = {kind: [n for n in wanted if there[f"{n}.{kind}"].any()] for kind in FIELDS}
        lacking = [kind for kind in ("q", "tau") if not told[kind]]
        if lacking and (lacking != ["tau"] or not commanded):
            raise LogError(
                f"{self.source} have no {FIELDS[lacking[0]]} in some or all messages; record a "
                "topic that has position and effort, or commands beside position."
            )
        driven = told["q" if lacking else "tau"]
        # Velocities that nobody measured are none, torque that stands for commands is not there.
        kinds = [k for k in FIELDS if k not in lacking and (k != "dq" or {*driven} <= {*told[k]})]
        own = {*self.known.motors, *self.known.joints, *self.known.locked}
        still = [n for n in told["q"] if n not in driven and self.known.columns.apply(n) in own]
        names = [*(f"{n}.{kind}" for kind in kinds for n in driven), *(f"{n}.q" for n in still)]
        return table[names].reset_index(drop=True)


@reader(
    "a bag",
    *BAGS,
    sniff=lambda path: is_bag(split_topic(path)[0]),
    place=lambda path: split_topic(path)[0],
    missing="There is no bag '{}'; give a .mcap, .db3 or .bag file or a folder.",
)
def read_joints(path: Path, known: Conventions) -> Whole:
    """Return the joint states of a bag; where messages differ, those of the robot's joints.

    Raises
    ------
    LogError
        If the bag cannot be read, or has no such topic or joints.
    """
    frame = read_bag(path, known)
    note = "messages that do not tell of the robot's joints were passed over"
    form = replace(PLAIN, notes=(note,)) if frame.attrs.pop("mixed") else PLAIN
    return frame, form, hash_files(split_topic(path)[0])
