"""A motion as a bag that a ROS 2 controller plays: one message of ``JointTrajectory``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from identifiability.foundation.errors import LogError
from identifiability.foundation.output import check_writable, temporary_folder, write_bytes

if TYPE_CHECKING:
    from identifiability.simulation.motion import PrescribedMotion

TOPIC = "/joint_trajectory"


def write_trajectory_bag(path: str | Path, joints: Sequence[str], motion: PrescribedMotion) -> Path:
    """Write a motion as an MCAP file with one ``trajectory_msgs/msg/JointTrajectory``.

    Parameters
    ----------
    path : path
    joints : sequence of str
    motion : PrescribedMotion

    Raises
    ------
    LogError
        If the extra ``ros`` is missing.
    OutputError
    """
    path = check_writable(Path(path))
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415 - an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise LogError(
            f"'{path}' would be a bag, which needs the extra 'ros': "
            "pip install 'identifiability[ros]'."
        ) from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    points = []
    for t, q, dq, ddq in zip(motion.t, motion.q, motion.dq, motion.ddq, strict=True):
        whole = round(float(t) * 1e9)
        after = make["builtin_interfaces/msg/Duration"](whole // 10**9, whole % 10**9)
        point = make["trajectory_msgs/msg/JointTrajectoryPoint"]
        points.append(point(q.copy(), dq.copy(), ddq.copy(), 0 * q[:0], after))
    stamp = make["builtin_interfaces/msg/Time"](0, 0)
    header = make["std_msgs/msg/Header"](stamp, "")
    kind = "trajectory_msgs/msg/JointTrajectory"
    message = make[kind](header, list(joints), points)
    with temporary_folder() as folder:
        bag = Path(folder) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, kind, typestore=store)
            writer.write(connection, 0, store.serialize_cdr(message, kind))
        (file,) = bag.glob("*.mcap")
        return write_bytes(path, file.read_bytes())
