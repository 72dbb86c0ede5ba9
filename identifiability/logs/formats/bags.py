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

import hashlib
from collections.abc import Collection, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, numbered
from identifiability.logs.form import PLAIN
from identifiability.logs.formats.reader import Whole, check_values, reader

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


def split_topic(path: str | Path) -> tuple[Path, str | None]:
    """Return the bag and the topic in ``bag:/topic``; the topic is None if none is named."""
    bag, colon, topic = str(path).rpartition(":/")
    if colon and is_bag(Path(bag)):
        return Path(bag), f"/{topic}"
    return Path(path), None


def is_bag(path: Path) -> bool:
    """Whether a path is, or by its name wants to be, a bag."""
    try:
        return path.suffix.lower() in BAGS or (path / "metadata.yaml").is_file()
    except OSError:  # no name of a file
        return False


def hash_files(path: Path) -> str:
    """Return the SHA-256 of a file, or of a folder's files in order of name."""
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    digest = hashlib.sha256()
    for file in files:
        with file.open("rb") as stream:
            hashlib.file_digest(stream, lambda: digest)
    return digest.hexdigest()


def read_bag(
    path: str | Path,
    topic: str | None = None,
    joints: Sequence[str] | None = None,
    known: Conventions | None = None,
) -> pd.DataFrame:
    """Read the joint states of a bag as a table with the columns of a log.

    Parameters
    ----------
    path : str or Path
        The bag, or ``bag:/topic``.
    topic : str, optional
        Needed where several topics hold joint states; behind a comma that of commands.
    joints : sequence of str, optional
        Which joints, for topics that also tell of others (grippers); messages that lack one of
        them are passed over. By default those of the robot where messages differ, else all.
    known : Conventions, optional
        Of the robot: of its joints, those that are locked among them, positions count though no
        effort tells of them.

    Returns
    -------
    DataFrame
        ``t`` [s] from the first message on, ``<joint>.q``, ``<joint>.dq``, ``<joint>.tau`` or
        ``<joint>.cmd``, the command that was recorded last; the stamp of the first message [s] is
        ``attrs["start"]``.

    Raises
    ------
    LogError
        If the bag cannot be read, or has no such topic or joints.
    """
    from identifiability.logs.conventions import Conventions  # noqa: PLC0415 - robots are heavy

    bag, named = split_topic(path)
    try:
        with _opened(bag) as reader:
            name, _, of = (topic or named or "").partition(",")
            states = _choose_topic(bag, reader, name or None)
            goal = _choose_commands(bag, reader, of)
            told = _States(bag, states, known or Conventions())
            told.read(_messages(reader, states, JOINT_STATE))
            frame = told.frame(joints, commanded=bool(goal))
            frame = _add_commands(reader, frame, goal) if goal else frame
            return _add_base(reader, frame)
    except LogError:
        raise
    except MemoryError:  # mostly a length that was spoilt
        raise LogError(Finding("bag.damaged", bag)) from None
    except Exception as error:  # noqa: BLE001 - foreign parsers may raise anything
        reason = " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
        raise LogError(f"{bag} cannot be read as a bag: {reason}.") from None


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


def _choose_topic(path: Path, reader: Any, wanted: str | None) -> str:
    found = sorted({str(c.topic) for c in reader.connections if c.msgtype in JOINT_STATE})
    if wanted is None and len(found) == 1:
        return found[0]
    if wanted in found:
        return str(wanted)
    if not found:
        others = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        raise LogError(Finding("bag.none", path, others=listing(others) or "nothing"))
    if wanted is None:
        first = {topic: next(_messages(reader, topic, JOINT_STATE), None) for topic in found}
        told = [t for t, x in first.items() if x and np.isfinite(x[1].effort).any()]
        raise LogError(Finding("bag.several", path, topics=[*found], first=(told or found)[0]))
    raise LogError(
        f"{path} has no joint states on the topic '{wanted}'{near_match(wanted, found)} It has "
        f"them on {listing(found)}."
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
        raise LogError(
            f"{path} has no commands on the topic '{wanted}'{near_match(wanted, [*found])} It has "
            f"them on {listing(sorted(found)) or 'none'}."
        )
    named = [topic for topic, kind in found.items() if COMMANDS[kind][0]]
    chosen = [wanted] if wanted else named or [*found]  # names are better than an order
    return chosen[0] if len(chosen) == 1 else ""


def _add_commands(reader: Any, frame: pd.DataFrame, topic: str) -> pd.DataFrame:
    """Return a table of joint states with the commands that were recorded last before each."""
    kind = next(c.msgtype for c in reader.connections if c.topic == topic)
    names_of, of, dot_of = COMMANDS[kind]
    when, rows, called = list[int](), list[tuple[Array, ...]](), tuple[str, ...]()
    for recorded, message in _messages(reader, topic, COMMANDS):
        point = getattr(message, of)
        if hasattr(point, "positions"):
            given = (point.positions, point.velocities)
        else:
            given = (point, getattr(message, dot_of) if dot_of else ())
        values = tuple(np.asarray(x, float) for x in given)
        names = tuple(getattr(message, names_of)) if names_of else numbered(len(values[0]))
        called = called or names
        if names == called and len(values[0]) == len(names):
            when.append(recorded)
            rows.append(values)
    if not rows:
        return frame
    last = np.searchsorted(when, frame.attrs["recorded"], side="right") - 1
    kinds = ["cmd"]
    if all(len(row[1]) == len(called) and np.isfinite(row[1]).all() for row in rows):
        kinds.append("dq_cmd")  # else velocities that nobody commands
    for k, kind in enumerate(kinds):
        held = np.array([row[k] for row in rows])[last]
        held[last < 0] = np.nan
        for name, column in zip(called, held.T, strict=True):
            frame[f"{name}.{kind}"] = column
    return frame


def _add_base(reader: Any, frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table of joint states with what messages about a base, and of wrenches, hold.

    By their own stamps, on straight lines, at the times of the joint states. Of a type on several
    topics nothing says which is the base's, but for wrenches, which have the names of theirs.
    """
    topics = {str(c.topic): c.msgtype for c in reader.connections if c.msgtype in BASE}
    several = [kind for kind in topics.values() if [*topics.values()].count(kind) > 1]
    for topic, kind in topics.items():
        if kind in several and "{topic}" not in BASE[kind][0][1]:
            continue
        when, rows = list[float](), list[list[float]]()
        for _, message in _messages(reader, topic, BASE):
            stamp = message.header.stamp
            when.append(stamp.sec + 1e-9 * stamp.nanosec - frame.attrs["start"])
            rows.append([attrgetter(f"{of}.{a}")(message) for of, _, ax in BASE[kind] for a in ax])
        if len(rows) > 1:
            names = [f"{name}.{a}" for _, name, ax in BASE[kind] for a in ax]
            order = np.argsort(when, kind="stable")
            for name, column in zip(names, np.array(rows, float)[order].T, strict=True):
                own = name.format(topic=topic.strip("/").replace("/", "."))
                frame[own] = np.interp(frame["t"], np.array(when)[order], column)
    return frame


class _States:
    """Joint states of one topic: names, values and stamps of every message."""

    def __init__(self, path: Path, topic: str, known: Conventions) -> None:
        self.path, self.topic, self.known = path, topic, known
        self.names: list[tuple[str, ...]] = []
        self.values: list[dict[str, Array]] = []
        self.clocks: list[tuple[int, int]] = []
        self.mixed = False

    def read(self, messages: Iterable[tuple[int, Any]]) -> None:
        """Take in all messages, with the times at which they were recorded [ns]."""
        for recorded, message in messages:
            self.names.append(tuple(message.name))
            own = {c: np.asarray(getattr(message, f), float) for c, f in FIELDS.items()}
            self.values.append(own)
            stamp = message.header.stamp
            self.clocks.append((stamp.sec * 10**9 + stamp.nanosec, recorded))
            if not len(self.names) % 100_000:
                check_values(self.path, len(self.names) * len(self.names[0]) * len(FIELDS))

    def choose(self) -> tuple[str, ...]:
        """Return the joints of all messages; where these differ, those of the robot.

        Raises
        ------
        LogError
        """
        groups = [*dict.fromkeys(self.names)]
        first = groups[0] if groups else ()
        odd = [g for g in groups if sorted(g) != sorted(first) or len({*g}) < len(g)]
        if not odd:
            return first
        self.mixed = True
        rename = self.known.columns.apply
        called = {rename(name): name for name in sorted({n for g in groups for n in g})}
        for joints in (self.known.motors, self.known.joints):
            if joints and {*joints} <= {*called}:
                needed = [called[j] for j in joints]
                group = next((g for g in groups if {*needed} <= {*g}), ())
                return (*needed, *(n for n in group if rename(n) in self.known.locked))
        raise LogError(
            f"{self.path}: messages on {self.topic} tell of different joints ({listing(first)}; "
            f"then {listing(odd[0])}), and no message of all joints that are needed; if they are "
            "called otherwise, add --map 'OLD=NEW', or in Python read_bag(path, joints=[…])."
        )

    def frame(self, joints: Sequence[str] | None, *, commanded: bool) -> pd.DataFrame:
        """Return what messages of all wanted joints say, by their stamps."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        wanted = self.choose() if joints is None else tuple(joints)
        at = [k for k, names in enumerate(self.names) if wanted and {*wanted} <= {*names}]
        if not at:
            self._refuse(wanted)
        stamped, recordings = np.array([self.clocks[k] for k in at], np.int64).T
        stamp = stamped if stamped.min() > 0 else recordings
        sequence = np.argsort(stamp, kind="stable")
        columns = {"t": (stamp[sequence] - stamp.min()) * 1e-9}
        values = {c: self._stack(c, wanted, at)[sequence] for c in FIELDS}
        told: dict[str, Array] = {c: np.any(np.isfinite(x), axis=0) for c, x in values.items()}
        lacking = [channel for channel in ("q", "tau") if not told[channel].any()]
        if lacking and (lacking != ["tau"] or not commanded):
            raise LogError(
                f"{self.path}: the joint states on {self.topic} have no {FIELDS[lacking[0]]} in "
                "some or all messages; record a topic that has position and effort, or commands "
                "beside position."
            )
        driven = np.flatnonzero(told["q" if lacking else "tau"])  # the others are passive
        # Velocities that nobody measured are none, torque that stands for commands is not there.
        for channel in FIELDS:
            if channel not in lacking and (channel != "dq" or told["dq"][driven].all()):
                columns |= {f"{wanted[k]}.{channel}": values[channel][:, k] for k in driven}
        own = {*self.known.motors, *self.known.joints, *self.known.locked}
        for k, name in enumerate(wanted):
            if self.known.columns.apply(name) in own and told["q"][k]:
                columns.setdefault(f"{name}.q", values["q"][:, k])
        frame = pd.DataFrame(columns)
        frame.attrs["start"] = float(stamp.min()) * 1e-9  # on the clock of the stamps
        frame.attrs["recorded"] = recordings[sequence]
        frame.attrs["mixed"] = self.mixed
        return frame

    def _stack(self, channel: str, wanted: Sequence[str], at: Sequence[int]) -> Array:
        """Return a channel of some messages, (m, n); NaN if one leaves the field empty."""
        rows = []
        for k in at:
            names, values = self.names[k], self.values[k][channel]
            if len(values) != len(names):
                return np.full((len(at), len(wanted)), np.nan)
            rows.append(values[[names.index(j) for j in wanted]])
        return np.array(rows)

    def _refuse(self, wanted: Sequence[str]) -> None:
        """Refuse a topic of which no message tells of all joints; say what those lack.

        Raises
        ------
        LogError
        """
        most = max(self.names, key=lambda names: len({*names} & {*wanted}), default=())
        there, lacking = ([j for j in wanted if (j in most) is told] for told in (True, False))
        if not there:
            raise LogError(
                f"{self.path} has no joint states on {self.topic} that tell of "
                f"{listing(wanted, 4)}."
            )
        pairs = [*zip(self.names, self.values, strict=True)][::-1]  # the first counts
        stands = {n: x for names, own in pairs for n, x in zip(names, own["q"], strict=False)}
        locks = " ".join(f"--lock {j}={stands.get(j, 0.0):.4g}" for j in lacking)
        raise LogError(
            f"{self.path}: the messages on {self.topic} that tell of {listing(there, 3)} do not "
            f"tell of {listing(lacking, 4)}, which the robot has a motor for. If it does not move "
            f"(a gripper, say), lock it where it stands: {locks}."
        )


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
    bag = split_topic(path)[0]
    digest = hash_files(bag) if bag.exists() else ""
    frame = read_bag(path, known=known)
    if hash_files(bag) != digest:
        raise LogError(f"{bag} changed while it was read; wait until it is complete.")
    note = "messages that do not tell of the robot's joints were passed over"
    form = replace(PLAIN, notes=(note,)) if frame.attrs.pop("mixed") else PLAIN
    return frame, form, digest
