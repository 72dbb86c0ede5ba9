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
import sqlite3
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array, numbered
from identifiability.logs.form import PLAIN, Form
from identifiability.logs.formats.reader import (
    MOST_BYTES,
    MOST_DESCRIBED,
    Whole,
    check_values,
    reader,
)

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

#: Bytes of a message of joint states: some ten thousand joints.
MOST_MESSAGE = 1_000_000


#: How long the longest is, by what stands before each; nothing of them is read.
_LONGEST = (
    "select max(length(data)) from messages join topics on topics.id = messages.topic_id "
    "where topics.type in (?, ?)"
)

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


class MixedJointsError(LogError):
    """Messages of one topic tell of different joints.

    Attributes
    ----------
    groups : list of tuple of str
        Those of each kind of message.
    """

    groups: list[tuple[str, ...]]


def read_bag(
    path: str | Path,
    topic: str | None = None,
    joints: Sequence[str] | None = None,
    still: Callable[[str], bool] | None = None,
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
        them are passed over. By default all, and every message must hold the same.
    still : callable(str), optional
        Whether a joint's positions count though no effort tells of it: such as is locked, or has a
        motor that nobody measures.

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
    bag, named = split_topic(path)
    try:
        with _opened(bag) as reader:
            name, _, of = (topic or named or "").partition(",")
            states = _choose_topic(bag, reader, name or None)
            goal = _choose_commands(bag, reader, of)
            messages = _messages(bag, reader, states)
            frame = _collect(bag, states, messages, joints, still, commanded=bool(goal))
            frame = _add_commands(bag, reader, frame, goal) if goal else frame
            return _add_base(bag, reader, frame)
    except LogError:
        raise
    except MemoryError:  # mostly a length that was spoilt
        raise LogError(
            f"{bag} cannot be read as a bag: it is damaged, or larger than the memory."
        ) from None
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
        raise LogError(
            f"{path} is a bag, which needs the extra 'ros': "
            "pip install 'robot-identifiability[ros]'."
        ) from None
    _check_files(path)
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        for part in reader.readers:
            _check_chunks(getattr(part, "storage", None))
        yield reader


def _check_files(path: Path) -> None:
    """Refuse a bag that would be read without end.

    Raises
    ------
    LogError
    """
    described = path / "metadata.yaml"
    if described.is_file() and described.stat().st_size > MOST_DESCRIBED:
        raise LogError(f"{described} is larger than {MOST_DESCRIBED // 10**6} MB; record anew.")
    for file in [path, *path.glob("*.db3")] if path.is_dir() else [path]:
        if file.suffix == ".db3" and file.is_file():
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as base:
                found = base.execute("select type, name, sql from sqlite_master").fetchall()
                unreal = ("view", "trigger")
                if any(kind in unreal or "VIRTUAL" in (sql or "") for kind, _, sql in found):
                    raise LogError(f"{file} computes its messages and holds none; record anew.")
                if {"messages", "topics"} <= {name for _, name, _ in found}:
                    _check_length(file, base.execute(_LONGEST, JOINT_STATE).fetchone()[0] or 0)


def _check_chunks(storage: Any) -> None:
    """Refuse an MCAP whose messages stand together in parts that do not fit in memory.

    Raises
    ------
    LogError
    """
    for part in getattr(storage, "storages", [storage]):
        longest = max((c.uncompressed_size for c in getattr(part, "chunks", ())), default=0)
        if longest > MOST_BYTES:
            raise LogError(
                f"{part.path} has {longest / 1e6:.0f} MB together in one part; up to "
                f"{MOST_BYTES // 10**6} MB are read: record joint states alone."
            )


def _check_length(path: Path, length: int) -> None:
    """Refuse a message of joint states that no robot sends.

    Raises
    ------
    LogError
    """
    if length > MOST_MESSAGE:
        raise LogError(
            f"{path} has a message of joint states of {length / 1e6:.0f} MB; up to "
            f"{MOST_MESSAGE // 10**6} MB are read: it is damaged, or no robot's."
        )


def _choose_topic(path: Path, reader: Any, wanted: str | None) -> str:
    found = sorted({str(c.topic) for c in reader.connections if c.msgtype in JOINT_STATE})
    if wanted is None and len(found) == 1:
        return found[0]
    if wanted in found:
        return str(wanted)
    if not found:
        others = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        raise LogError(
            f"{path} has no topic of type sensor_msgs/JointState; it holds "
            f"{listing(others) or 'nothing'}."
        )
    if wanted is None:
        first = {topic: next(_messages(path, reader, topic), None) for topic in found}
        told = [t for t, x in first.items() if x and np.isfinite(x[1].effort).any()]
        raise LogError(
            f"{path} has joint states on the topics {listing(found)}; name one of them as "
            f"'{path}:{(told or found)[0]}'."
        )
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


def _add_commands(path: Path, reader: Any, frame: pd.DataFrame, topic: str) -> pd.DataFrame:
    """Return a table of joint states with the commands that were recorded last before each."""
    connections = [c for c in reader.connections if c.topic == topic and c.msgtype in COMMANDS]
    names_of, of, dot_of = COMMANDS[connections[0].msgtype]
    when, rows, called = list[int](), list[tuple[Array, ...]](), tuple[str, ...]()
    for connection, recorded, raw in reader.messages(connections=connections):
        _check_length(path, len(raw))
        message = reader.deserialize(raw, connection.msgtype)
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


def _add_base(path: Path, reader: Any, frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table of joint states with what messages about a base, and of wrenches, hold.

    By their own stamps, on straight lines, at the times of the joint states. Of a type on several
    topics nothing says which is the base's, but for wrenches, which have the names of theirs.
    """
    topics = {str(c.topic): c.msgtype for c in reader.connections if c.msgtype in BASE}
    several = [kind for kind in topics.values() if [*topics.values()].count(kind) > 1]
    for topic, kind in topics.items():
        if kind in several and "{topic}" not in BASE[kind][0][1]:
            continue
        connections = [c for c in reader.connections if c.topic == topic and c.msgtype == kind]
        when, rows = list[float](), list[list[float]]()
        for connection, _, raw in reader.messages(connections=connections):
            _check_length(path, len(raw))
            message = reader.deserialize(raw, connection.msgtype)
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


def _messages(path: Path, reader: Any, topic: str) -> Iterator[tuple[int, Any]]:
    """Time of recording [ns] and message, for every message of a topic."""
    connections = [c for c in reader.connections if c.topic == topic and c.msgtype in JOINT_STATE]
    for connection, recorded, raw in reader.messages(connections=connections):
        _check_length(path, len(raw))
        yield recorded, reader.deserialize(raw, connection.msgtype)


def _collect(
    path: Path,
    topic: str,
    messages: Iterable[tuple[int, Any]],
    joints: Sequence[str] | None,
    still: Callable[[str], bool] | None,
    *,
    commanded: bool,
) -> pd.DataFrame:
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    wanted = () if joints is None else tuple(joints)
    clocks, rows, groups = [], [], dict[tuple[str, ...], Array]()
    for recorded, message in messages:
        names = tuple(message.name)
        groups.setdefault(names, np.asarray(message.position, float))
        if joints is None:
            wanted = wanted or names
            if sorted(names) != sorted(wanted) or len(set(names)) < len(names):
                continue
        places = {name: k for k, name in reversed([*enumerate(names)])}
        if wanted and places.keys() >= set(wanted):
            order = [places[j] for j in wanted]
            rows.append({c: _pick(getattr(message, f), names, order) for c, f in FIELDS.items()})
            measured = message.header.stamp
            if not len(rows) % 100_000:
                check_values(path, len(rows) * len(wanted) * len(FIELDS))
            clocks.append((measured.sec * 10**9 + measured.nanosec, recorded))
    if joints is None:
        _check_same(path, topic, list(groups))
    if not rows:
        _refuse_parts(path, topic, groups, wanted)
    stamped, recordings = np.array(clocks, dtype=np.int64).T
    stamp = stamped if stamped.min() > 0 else recordings
    sequence = np.argsort(stamp, kind="stable")
    columns = {"t": (stamp[sequence] - stamp.min()) * 1e-9}
    values = {c: _joined([row[c] for row in rows], len(wanted))[sequence] for c in FIELDS}
    known: dict[str, Array] = {c: np.any(np.isfinite(x), axis=0) for c, x in values.items()}
    lacking = [channel for channel in ("q", "tau") if not known[channel].any()]
    if lacking and (lacking != ["tau"] or not commanded):
        raise LogError(
            f"{path}: the joint states on {topic} have no {FIELDS[lacking[0]]} in some or all "
            "messages; record a topic that has position and effort, or commands beside position."
        )
    driven = np.flatnonzero(known["q" if lacking else "tau"])  # the others are passive
    # Velocities that nobody measured are none, and torque that stands for commands is not there.
    for channel in FIELDS:
        if channel not in lacking and (channel != "dq" or known["dq"][driven].all()):
            columns |= {f"{wanted[k]}.{channel}": values[channel][:, k] for k in driven}
    for k, name in enumerate(wanted):
        if still and still(name) and known["q"][k]:
            columns.setdefault(f"{name}.q", values["q"][:, k])
    frame = pd.DataFrame(columns)
    frame.attrs["start"] = float(stamp.min()) * 1e-9  # on the clock of the stamps
    frame.attrs["recorded"] = recordings[sequence]
    return frame


def _joined(rows: Sequence[Array | None], joints: int) -> Array:
    """Return the values of all messages, (N, n); NaN if some message leaves the field empty."""
    known = [row for row in rows if row is not None]
    return np.array(known) if len(known) == len(rows) else np.full((len(rows), joints), np.nan)


def _check_same(path: Path, topic: str, groups: Sequence[Sequence[str]]) -> None:
    """Refuse messages that tell of different joints.

    Raises
    ------
    MixedJointsError
    """
    for names in groups:
        if sorted(names) != sorted(groups[0]) or len(set(names)) < len(names):
            error = MixedJointsError(
                f"{path}: messages on {topic} tell of different joints ({listing(groups[0])}; then "
                f"{listing(names)}), and no message of all joints that are needed; if they are "
                "called otherwise, add --map 'OLD=NEW', or in Python read_bag(path, joints=[…])."
            )
            error.groups = [tuple(names) for names in groups]
            raise error


def _refuse_parts(
    path: Path, topic: str, groups: Mapping[tuple[str, ...], Array], wanted: Sequence[str]
) -> NoReturn:
    """Refuse a topic of which no message tells of all joints; say which those lack that tell most.

    Raises
    ------
    LogError
    """
    most = max(groups, key=lambda names: len(set(names) & set(wanted)), default=())
    there, lacking = ([j for j in wanted if (j in most) is told] for told in (True, False))
    if not there:
        raise LogError(f"{path} has no joint states on {topic} that tell of {listing(wanted, 4)}.")
    at = {n: p for names, position in groups.items() for n, p in zip(names, position, strict=False)}
    locks = " ".join(f"--lock {j}={at.get(j, 0.0):.4g}" for j in lacking)
    raise LogError(
        f"{path}: the messages on {topic} that tell of {listing(there, 3)} do not tell of "
        f"{listing(lacking, 4)}, which the robot has a motor for. If it does not move (a gripper, "
        f"say), lock it where it stands: {locks}."
    )


def _pick(values: Any, names: Sequence[str], order: Sequence[int]) -> Array | None:
    """Values of some joints, or None where the message leaves the field empty."""
    array = np.asarray(values, float)
    return array[list(order)] if len(array) == len(names) else None


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
    frame, form = _read_asked(path, known)
    if hash_files(bag) != digest:
        raise LogError(f"{bag} changed while it was read; wait until it is complete.")
    return frame, form, digest


def _read_asked(path: Path, known: Conventions) -> tuple[pd.DataFrame, Form]:
    own = {*known.motors, *known.joints, *known.locked}

    def still(name: str) -> bool:
        return known.columns.apply(name) in own

    try:
        return read_bag(path, still=still), PLAIN
    except MixedJointsError as mixed:
        names = {name for group in mixed.groups for name in group}
        called = {known.columns.apply(name): name for name in sorted(names)}
        for joints in (known.motors, known.joints):
            if joints and set(joints) <= set(called):
                note = "messages that do not tell of the robot's joints were passed over"
                needed = [called[j] for j in joints]
                group = next((g for g in mixed.groups if set(needed) <= set(g)), ())
                needed += [x for x in group if known.columns.apply(x) in known.locked]
                return read_bag(path, joints=needed, still=still), replace(PLAIN, notes=(note,))
        raise
