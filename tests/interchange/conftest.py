"""Bags are written by the library that reads them."""

import numpy as np
import pytest

#: Time of the first message [ns]; a float cannot hold it to the nanosecond.
START = 1_700_000_000_123_456_789


@pytest.fixture
def joint_state():
    """A function (names, q, dq, tau, time [ns]) -> message."""
    rosbags = pytest.importorskip("rosbags.typesys")
    types = rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY).types

    def make(names, q, dq, tau, nanoseconds):
        stamp = types["builtin_interfaces/msg/Time"](*divmod(nanoseconds, 10**9))
        header = types["std_msgs/msg/Header"](stamp, "base")
        return types["sensor_msgs/msg/JointState"](
            header, list(names), *map(np.array, (q, dq, tau))
        )

    return make


@pytest.fixture
def write_bag(tmp_path):
    """A function ({topic: messages}, storage, name) -> the folder; messages 1 ms apart."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)

    def write(topics, storage="MCAP", name="bag"):
        plugin = rosbag2.StoragePlugin[storage]
        folder = tmp_path / name
        with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
            for topic, messages in topics.items():
                kind = None
                connection = None
                for k, message in enumerate(messages):
                    if connection is None:
                        kind = message.__msgtype__
                        connection = writer.add_connection(topic, kind, typestore=store)
                    raw = store.serialize_cdr(message, kind)
                    writer.write(connection, START + 5_000_000 + k * 1_000_000, raw)
        return folder

    return write


@pytest.fixture
def states(joint_state):
    """A function (log as DataFrame, joints, **fields left out) -> messages."""

    def make(frame, joints, without=(), start=START):
        n = len(joints)
        for k in range(len(frame)):
            row = {
                c: []
                if c in without
                else [frame.get(f"{j}.{c}", {}).get(k, np.nan) for j in joints]
                for c in ("q", "dq", "tau")
            }
            assert all(len(v) in (0, n) for v in row.values())
            stamp = start + round(frame["t"][k] * 1e9) if start else 0
            yield joint_state(joints, row["q"], row["dq"], row["tau"], stamp)

    return make


@pytest.fixture
def frame(simulated):
    """A log of the two-link arm."""
    return simulated("two-link", "a", samples=200).to_frame()
