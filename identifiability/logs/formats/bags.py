"""Read ROS 1 and ROS 2 recordings as a table of joint states. This needs the extra ``ros``.

A bag is a folder of rosbag2, or one file: ``.mcap``, ``.db3`` or ``.bag``. One topic of type
``sensor_msgs/JointState`` is read. If there are several, the user names one after a colon, as in
``run.mcap:/arm/joint_states``. Position, velocity and effort become ``<joint>.q``, ``<joint>.dq``
and ``<joint>.tau`` without conversion. The message type promises rad, rad/s and N·m (m, m/s, N),
but some drivers publish motor currents as effort. Joints without effort (NaN) are passive and left
out.

Commands come from one topic of type ``control_msgs/JointTrajectoryControllerState`` (its
reference), ``control_msgs/MultiDOFCommand`` or ``std_msgs/Float64MultiArray`` (values in the
robot's order). If several topics command the joints, the user names one:
``run.mcap:/joint_states,/goal``. Commands replace torque if no joint has effort.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, Strings, numbered
from identifiability.foundation.quoting import path_for_shell
from identifiability.logs.form import PLAIN

from .reader import Whole, check_unpacked, hash_files, list_files, reader

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from identifiability.logs.conventions import Conventions

#: Files that are bags by themselves.
BAGS = (".mcap", ".db3", ".bag")

#: Bytes before the records of MCAP, and the type of its chunks; bytes of a record's header in bags.
_MCAP_MAGIC, _MCAP_CHUNK, _BAG_HEADER = 8, 6, 4096

#: Names of the type in ROS 2 and ROS 1.
JOINT_STATE = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")

_TABLES = tomllib.loads(Path(__file__).with_name("bags.toml").read_text(encoding="utf-8"))

#: Fields of commands, and vectors about a base that floats, by type of message.
COMMANDS: Mapping[str, Sequence[str]] = _TABLES["commands"]
BASE: Mapping[str, Sequence[Sequence[str]]] = _TABLES["base"]

#: Field of the message for every channel of a log.
FIELDS = {"q": "position", "dq": "velocity", "tau": "effort"}


def split_topic(path: str | Path) -> tuple[Path, str]:
    """Return the bag and the topic in ``bag:/topic``; the topic is empty if none is named."""
    bag, colon, topic = str(path).rpartition(":/")
    if colon and is_bag(Path(bag)):
        return Path(bag), f"/{topic}"
    return Path(path), ""


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag, or has the name of one."""
    try:
        return path.suffix.lower() in BAGS or (path / "metadata.yaml").is_file()
    except OSError:  # no name of a file
        return False


def read_bag(path: str | Path, known: Conventions) -> pd.DataFrame:
    """Read the joint states of a bag as a table with the columns of a log.

    Parameters
    ----------
    path : str or Path
        The bag, or ``bag:/topic``; after a comma the topic of commands.
    known : Conventions
        Conventions of the robot. If messages have different joints, those that lack one of the
        robot's joints (as of a gripper) are skipped. Positions of the robot's joints are read even
        without effort.

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
        states, chosen = _choose_topic(bag, reader, name, known)
        goal = _choose_commands(bag, reader, of)
        source = f"{bag}: the joint states on {states}"
        told = _messages(reader, states, JOINT_STATE)
        frame = _read_states(source, told, known, commanded=bool(goal))
        if goal:
            _add_commands(reader, frame, goal)
        _add_base(reader, frame)
        frame.attrs["notes"] += chosen
        return frame


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag; old ones that do not define their messages are read by today's definitions."""
    try:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise LogError(Finding("bag.extra", path)) from None
    for file in list_files(path):
        check_unpacked(file, _count_chunks(file))
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        yield reader


def _count_chunks(path: Path) -> int:
    """Return the unpacked size of the chunks of a bag in bytes, by their headers."""
    count = {".mcap": _mcap_chunks, ".bag": _bag_chunks}.get(path.suffix.lower())
    if count is None:
        return 0
    with path.open("rb") as file:
        return sum(count(file))


def _mcap_chunks(file: BinaryIO) -> Iterator[int]:
    """Yield the stated sizes of chunks: records of type 6, whose size follows two times."""
    file.seek(_MCAP_MAGIC)
    while len(head := file.read(9)) == 9:
        kind = head[0]
        length = int.from_bytes(head[1:], "little")
        begin = file.read(min(length, 24))
        if kind == _MCAP_CHUNK and len(begin) == 24:
            yield int.from_bytes(begin[16:], "little")
        file.seek(length - len(begin), 1)


def _bag_chunks(file: BinaryIO) -> Iterator[int]:
    """Yield the stated sizes of chunks: records whose header has a size."""
    file.readline()
    while len(length := file.read(4)) == 4:
        size = int.from_bytes(length, "little")
        header = file.read(min(size, _BAG_HEADER))
        file.seek(size - len(header), 1)
        _, found, after = header.partition(b"size=")
        if found and b"compression=" in header:
            yield int.from_bytes(after[:4], "little")
        file.seek(int.from_bytes(file.read(4), "little"), 1)


def _messages(reader: Any, topic: str, kinds: Collection[str]) -> Iterator[tuple[int, Any]]:
    """Time of recording [ns] and message, for every message of a topic of some types."""
    own = [c for c in reader.connections if c.topic == topic and c.msgtype in kinds]
    for connection, recorded, raw in reader.messages(connections=own):
        yield recorded, reader.deserialize(raw, connection.msgtype)


def _choose_topic(
    path: Path, reader: Any, wanted: str, known: Conventions
) -> tuple[str, list[str]]:
    """Return the topic of joint states, and a note if it was chosen among several.

    Raises
    ------
    LogError
        If there is none of this name, or several, and not one alone has all joints of the robot.
    """
    found = sorted({str(c.topic) for c in reader.connections if c.msgtype in JOINT_STATE})
    if wanted in found or (not wanted and len(found) == 1):
        return wanted or found[0], []
    if not found:
        others = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        raise LogError(Finding("bag.none", path, others=listing(others) or "nothing"))
    if wanted:
        raise _no_topic(path, "joint states", wanted, found)
    first = {topic: next(_messages(reader, topic, JOINT_STATE), None) for topic in found}
    told = {topic: x[1] for topic, x in first.items() if x}
    names = {topic: {*map(known.columns.apply, x.name)} for topic, x in told.items()}
    sides = [{*side} for side in (known.motors, known.joints) if side]
    whole = [topic for topic, own in names.items() if any(side <= own for side in sides)]
    if len(whole) == 1:
        note = f"joint states on {whole[0]} were read: no other topic has all joints of the robot"
        return whole[0], [note]

    def suits(topic: str) -> tuple[int, bool]:
        shared = max((len(side & names[topic]) for side in sides), default=0)
        return shared, bool(np.isfinite(told[topic].effort).any())

    example = max(told, key=suits, default=found[0])
    proposed = path_for_shell(f"{path}:{example}", always=True)
    raise LogError(Finding("bag.several", path, topics=[*found], example=proposed))


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


def _table(messages: Iterable[tuple[Sequence[str], Mapping[str, Any]]]) -> pd.DataFrame:
    """Return the joint data of messages, a row each, by columns of a log.

    Parameters
    ----------
    messages : iterable of (names, channels)
        Names of joints, and values in their order by channel; empty arrays do not count.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    groups: dict[Strings, tuple[list[int], list[Array]]] = {}
    for k, (names, channels) in enumerate(messages):
        told = {kind: x for kind, x in channels.items() if len(x) == len(names)}
        columns = tuple(f"{n}.{kind}" for kind in told for n in names)
        at, own = groups.setdefault(columns, ([], []))
        at.append(k)
        own.append(np.concatenate([[], *told.values()]))
    parts = [pd.DataFrame(np.array(own), at, [*c]) for c, (at, own) in groups.items()]
    if parts:
        return pd.concat(parts).sort_index()
    return pd.DataFrame()


def _add_commands(reader: Any, frame: pd.DataFrame, topic: str) -> None:
    """Add the commands that were recorded last before each row to joint states."""
    kind = next(c.msgtype for c in reader.connections if c.topic == topic)
    names_of, of, dot_of = COMMANDS[kind]
    when = list[int]()

    def told() -> Iterator[tuple[Sequence[str], Mapping[str, Any]]]:
        for recorded, message in _messages(reader, topic, COMMANDS):
            point = getattr(message, of)
            dot = getattr(message, dot_of) if dot_of else getattr(point, "velocities", ())
            q = getattr(point, "positions", point)
            when.append(recorded)
            names = getattr(message, names_of) if names_of else numbered(len(q))
            yield names, {"cmd": q, "dq_cmd": dot}

    table = _table(told()).dropna(axis=1)  # velocities without a command
    if when:
        last = np.searchsorted(when, frame.attrs["recorded"], side="right") - 1
        held = np.where((last < 0)[:, None], np.nan, table.to_numpy()[last])
        frame[[*table]] = held


def _add_base(reader: Any, frame: pd.DataFrame) -> None:
    """Add the data of messages about a base, and of wrenches, to joint states.

    The data are interpolated linearly by their stamps at the times of the joint states. A type on
    several topics is skipped, because the base's topic is not known. Wrenches are an exception:
    their topics name them.
    """
    topics = {str(c.topic): c.msgtype for c in reader.connections if c.msgtype in BASE}
    for topic, kind in topics.items():
        count = [*topics.values()].count(kind)
        if count > 1 and "{topic}" not in BASE[kind][0][1]:
            continue
        when = list[float]()
        rows = list[list[float]]()
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
    """Return the time stamp of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _read_states(
    source: str, messages: Iterable[tuple[int, Any]], known: Conventions, *, commanded: bool
) -> pd.DataFrame:
    """Return the joint data of messages, by their stamps; joints without effort are passive.

    Raises
    ------
    LogError
        If no message has all joints of the robot, or position and effort.
    """
    clocks = list[tuple[int, int]]()
    groups = dict[frozenset[str], Sequence[str]]()

    def told() -> Iterator[tuple[Sequence[str], Mapping[str, Any]]]:
        for recorded, message in messages:
            clocks.append((_stamp(message), recorded))
            groups.setdefault(frozenset(message.name), message.name)
            yield message.name, {kind: getattr(message, field) for kind, field in FIELDS.items()}

    table = _table(told())
    times = np.array(clocks, np.int64).reshape(-1, 2)
    if len(groups) > 1:
        whole = _find_whole(table, groups, known, source)
        table = table[whole]
        times = times[whole]
    table = table.dropna(axis=1, how="all")
    table = table[_driven(table, known, source, commanded=commanded)]
    stamp = times[:, 0] if times[:, 0].min() > 0 else times[:, 1]
    order = np.argsort(stamp, kind="stable")
    frame = table.iloc[order].reset_index(drop=True)
    frame.insert(0, "t", (stamp[order] - stamp.min()) * 1e-9)
    frame.attrs["start"] = float(stamp.min()) * 1e-9  # on the clock of the stamps
    frame.attrs["recorded"] = times[order, 1]
    note = "messages that do not tell of the robot's joints were passed over"
    frame.attrs["notes"] = [note] if len(groups) > 1 else []
    return frame


def _find_whole(
    table: pd.DataFrame,
    groups: Mapping[frozenset[str], Sequence[str]],
    known: Conventions,
    source: str,
) -> Array:
    """Return a mask of messages with all joints of the robot, (N,) bool.

    Raises
    ------
    LogError
        If there is no such message.
    """
    joints = sorted(frozenset().union(*groups))
    called = {known.columns.apply(n): f"{n}.q" for n in joints}
    sides = (known.motors, known.joints)
    needed = next(([called[j] for j in x] for x in sides if x and {*x} <= {*called}), [])
    whole = table[needed].notna().all(axis=1).to_numpy() & bool(needed)
    if not whole.any():
        first, other, *_ = groups.values()
        raise LogError(
            f"{source} tell of different joints ({listing(first)}; then {listing(other)}), and "
            "no message of all joints that are needed: if they have other names, add "
            "--map 'OLD=NEW', and lock joints that do not move, such as a gripper "
            "(--lock JOINT=VALUE)."
        )
    return whole


def _driven(table: pd.DataFrame, known: Conventions, source: str, *, commanded: bool) -> list[str]:
    """Return the columns of joints that have effort, and positions of the robot's joints.

    Raises
    ------
    LogError
        If there is no position or effort.
    """
    pairs = {str(name): str(name).rsplit(".", 1) for name in table}
    driven = {joint for joint, kind in pairs.values() if kind == "tau"}
    lacking = [k for k in ("q", "tau") if all(kind != k for _, kind in pairs.values())]
    if lacking and (lacking != ["tau"] or not commanded):
        raise LogError(
            f"{source} have no {FIELDS[lacking[0]]} in some or all messages; record a topic that "
            "has position and effort, or position and commands."
        )
    own = {*known.motors, *known.joints, *known.locked}

    def counts(joint: str, kind: str) -> bool:
        return joint in driven or (kind == "q" and known.columns.apply(joint) in own)

    return [name for name, pair in pairs.items() if lacking or counts(*pair)]


@reader(
    "a bag",
    *BAGS,
    sniff=lambda path: is_bag(split_topic(path)[0]),
    place=lambda path: split_topic(path)[0],
)
def read_joints(path: Path, known: Conventions) -> Whole:
    """Return the joint states of a bag; if messages differ, those with the robot's joints.

    Raises
    ------
    LogError
        If the bag cannot be read, or has no such topic or joints.
    """
    frame = read_bag(path, known)
    notes = tuple(frame.attrs.pop("notes"))
    form = replace(PLAIN, notes=notes)
    return frame, form, hash_files(split_topic(path)[0])
