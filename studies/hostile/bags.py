"""Hostile logs: bags, and files that are no logs."""

from __future__ import annotations

import io
import os
import pickle
import struct
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd

from hostile.case import Hostile, Make, Runs, hostile, listed, no_files, sparse, spoilt


def good_bag(frame: pd.DataFrame) -> bytes:
    """Return joint states as an MCAP."""
    from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "sensor_msgs/msg/JointState")
    stamp, header, message = (store.types[k] for k in kinds)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "bag"
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection("/joint_states", kinds[2], typestore=store)
            for k, row in enumerate(frame.to_dict("records")):
                head = header(stamp(*divmod(round(1e9 * (1 + row["t"])), 10**9)), "")
                joints = ["shoulder", "elbow"]
                values = [np.array([row[f"{j}.{c}"] for j in joints]) for c in ("q", "dq", "tau")]
                one = message(head, joints, *values)
                writer.write(connection, k * 1_000_000, store.serialize_cdr(one, kinds[2]))
        return next(folder.glob("*.mcap")).read_bytes()


def bags(good: bytes) -> list[Hostile]:
    """Return hostile bags, made of a good MCAP."""
    import sqlite3  # noqa: PLC0415

    def folder(metadata: str | bytes | Make) -> Make:
        def make(path: Path) -> None:
            path.mkdir()
            file = path / "metadata.yaml"
            if callable(metadata):
                metadata(file)
            else:
                file.write_bytes(metadata if isinstance(metadata, bytes) else metadata.encode())

        return make

    def database(path: Path) -> None:
        with sqlite3.connect(path) as base:
            base.execute(
                "create table topics(id, name, type, serialization_format, offered_qos_profiles)"
            )
            base.execute("create table messages(id, topic_id, timestamp, data)")
            base.execute(
                "insert into topics values(1, '/j', 'sensor_msgs/msg/JointState', 'cdr', '')"
            )
            for k in range(100):
                base.execute(
                    "insert into messages values(?, 1, ?, ?)", (k, k, b"\0\1\0\0" + b"\xff" * 40)
                )

    def view(path: Path) -> None:
        with sqlite3.connect(path) as base:
            base.execute(
                "create table topics(id, name, type, serialization_format, offered_qos_profiles)"
            )
            base.execute(
                "insert into topics values(1, '/j', 'sensor_msgs/msg/JointState', 'cdr', '')"
            )
            base.execute(
                "create view messages as with recursive c(id) as (select 1 union all select id + 1 from c) "
                "select id, 1 as topic_id, id as timestamp, zeroblob(100000) as data from c"
            )

    yaml_head = "rosbag2_bagfile_information:\n  version: 9\n"
    laughs = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"{c}: &{c} [{','.join([f'*{b}'] * 9)}]\n"
        for b, c in zip("abcdefgh", "bcdefghi", strict=True)
    )
    of_folders: dict[str, str | bytes | Make] = {
        "YAML that runs": "!!python/object/apply:os.system ['touch canary']",
        "YAML of a billion laughs": laughs,
        "YAML in brackets": "[" * 50_000,
        "YAML of 30 MB": yaml_head + "  x: 1\n" * 4_000_000,
        "files of /dev/zero": yaml_head
        + "  storage_identifier: mcap\n  relative_file_paths: [/dev/zero]\n",
        "files above": yaml_head
        + "  storage_identifier: mcap\n  relative_file_paths: [../../../etc/passwd]\n",
        "no YAML": b"\0\xff" * 100,
        "nothing in YAML": "",
        "a pipe of YAML": os.mkfifo,
    }
    magic = b"\x89MCAP0\r\n"

    def record(kind: int, body: bytes, size: int | None = None) -> bytes:
        return bytes([kind]) + struct.pack("<Q", len(body) if size is None else size) + body

    def short(text: str) -> bytes:
        return struct.pack("<I", len(text)) + text.encode()

    head = record(1, short("") + short(""))
    schema = record(
        3,
        struct.pack("<H", 1)
        + short("sensor_msgs/msg/JointState")
        + short("ros2msg")
        + short("float64[<=999999999] position\n" * 1000),
    )
    places: dict[str, bytes | Make] = {
        "a record of 2^63 bytes": magic + record(1, b"", 2**63) + magic,
        "a piece that says it unpacks to 1e12 bytes": magic + head
        + record(6, struct.pack("<QQQI", 0, 1, 10**12, 0) + short("zstd") + struct.pack("<Q", 4) + b"\0" * 4) + magic,
        "a definition of 30 kB": magic + head + schema + record(15, b"\0" * 4) + record(2, b"\0" * 20) + magic,
        "nothing but marks": magic + magic,
        "half": good[: len(good) // 2],
        "twice": good + good,
        "zeros, 180 MB": sparse(good, 180_000_000),
        "noise": np.random.default_rng(1).bytes(200_000),
        "empty": b"",
        "a joint of escapes": good.replace(b"shoulder", b"\x1b[2J\x9b2J"[:8].ljust(8, b"x")),
        "a joint that is a formula": good.replace(b"shoulder", b"=1+1+1+1"),
        "lengths that are a lie": good.replace(struct.pack("<I", 9) + b"shoulder", struct.pack("<I", 2**31 - 1) + b"shoulder"),
    }  # fmt: skip
    ros1 = b"#ROSBAG V2.0\n"
    of_ros1 = {
        "a head of 4 GB": ros1 + struct.pack("<I", 2**32 - 1) + b"x" * 100,
        "nothing behind its first line": ros1,
        "noise": ros1 + np.random.default_rng(2).bytes(20_000),
        "an index far behind": ros1 + struct.pack("<I", 69) + struct.pack("<I", 4) + b"op=\x03"
        + struct.pack("<I", 18) + b"index_pos=" + struct.pack("<Q", 2**62) + b"\0" * 100,
    }  # fmt: skip
    of_tables: dict[str, bytes | Make] = {
        "messages that are none": database,
        "messages without end": view,
        "a table by name": b"SQLite format 3\0" + b"\0" * 5000,
    }
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("a.csv", "t\n")
    others = {
        ".pkl": pickle.dumps(Runs()), ".npy": b"\x93NUMPY", ".h5": b"\x89HDF", ".zip": packed.getvalue(),
        ".json": b"[" * 100_000, ".xls": b"\xd0\xcf\x11\xe0", ".exe": b"MZ", ".txt": b"\x1b[2J",
    }  # fmt: skip
    return listed(
        [hostile("bag", k, v, suffix=".mcap", kind="log") for k, v in places.items()],
        [hostile("bag", k, folder(v), file="hostile", kind="log") for k, v in of_folders.items()],
        [hostile("bag", f"ROS 1, {k}", v, suffix=".bag", kind="log") for k, v in of_ros1.items()],
        [
            hostile("bag", f"SQLite, {k}", v, suffix=".db3", kind="log")
            for k, v in of_tables.items()
        ],
        no_files("bag", ".mcap", "log"),
        spoilt("bag", good, ".mcap", 14, "log"),
        [hostile("other", f"a file {k}", v, suffix=k, kind="log") for k, v in others.items()],
    )
