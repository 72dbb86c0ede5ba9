"""Logs of commands in the forms in which others keep them: LeRobot, ROS 2."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import IdentifiabilityError, Robot, predict
from identifiability.logs.conventions import Conventions
from identifiability.quality.recordings import read_logs

DATASETS = Path(__file__).parent / "lerobot"
SHIPPED = Path(__file__).resolve().parents[2] / "models/hobby-arm"


@pytest.fixture(scope="module")
def arm():
    return Robot.load("hobby-arm")


@pytest.fixture(scope="module")
def frame():
    return pd.read_csv(SHIPPED / "logs/run1.csv")[:300]


def read(robot, given):
    (log,) = read_logs(given, Conventions.of(robot))
    return log.select(robot.joints)


def refused(robot, given):
    with pytest.raises(IdentifiabilityError) as error:
        read(robot, given)
    assert "\n" not in str(error.value)
    return str(error.value)


# LeRobot. The datasets were written by the package itself (`lerobot/write.py`).


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_every_episode_of_a_dataset_is_the_log_that_was_recorded(version, arm):
    logs = read_logs(DATASETS / version, Conventions.of(arm))
    assert [log.name for log in logs] == [f"{version}:0", f"{version}:1"]
    for k, log in enumerate(logs, start=1):
        table = pd.read_csv(SHIPPED / "logs" / f"run{k}.csv")[:75]
        own = log.select(arm.joints)
        for kind, given in (("q", own.q), ("cmd", own.q_ref)):
            wanted = table[[f"{j}.{kind}" for j in arm.joints]].to_numpy(np.float32)
            assert_array_equal(given, wanted)
        assert_allclose(log.t, np.arange(75) / 50, atol=1e-12)
    (second,) = read_logs(f"{DATASETS / version}:1", Conventions.of(arm))
    assert second.sha256 == logs[1].sha256 != logs[0].sha256
    assert len(read_logs(f"{DATASETS / version}:0-1", Conventions.of(arm))) == 2
    assert predict(arm, arm, f"{DATASETS / version}:1", forward=True).totals[0] < 0.5


def test_an_episode_with_a_file_of_its_own_is_read_from_that_alone(arm, tmp_path):
    folder = tmp_path / "v2.1"
    shutil.copytree(DATASETS / "v2.1", folder)
    (file,) = folder.rglob("episode_000001.parquet")
    file.write_bytes(b"no Parquet")
    assert len(read(arm, f"{folder}:0")) == 75
    assert "cannot be read as a LeRobot dataset" in refused(arm, f"{folder}:1")


def test_units_of_a_dataset_are_stated_by_joint(arm, tmp_path):
    """Normalised units, ticks and degrees in one table; patterns, and names of its own."""
    plain = read(arm, DATASETS / "v3.0:0")
    folder = tmp_path / "robot"
    shutil.copytree(SHIPPED, folder)
    rules = """
[columns]
"*" = {scale = 0.02, offset = 0.1}
jaw_joint = {scale = -0.0015339807878856412, offset = 3.14159}
yaw = "base_yaw"
base_yaw = {scale = 0.017453292519943295}
"""
    (folder / "robot.toml").write_text((SHIPPED / "robot.toml").read_text() + rules)
    robot = Robot.load(folder / "robot.xml")

    def own(joint, rad):
        if joint == "jaw_joint":
            return (3.14159 - rad) / 0.0015339807878856412
        return np.degrees(rad) if joint == "base_yaw" else (rad - 0.1) / 0.02

    table = pd.DataFrame({"t": plain.t})
    for k, joint in enumerate(arm.joints):
        name = {"base_yaw": "yaw"}.get(joint, joint)
        table[f"{name}.q"], table[f"{name}.action"] = (
            own(joint, x[:, k]) for x in (plain.q, plain.q_ref)
        )
        table[f"{name}.current"] = 9
    log = read(robot, table)
    assert_allclose(log.q, plain.q, atol=1e-12)
    assert_allclose(log.q_ref, plain.q_ref, atol=1e-12)
    assert any("scaled and shifted as the sidecar says" in note for note in log.notes)
    table[f"{joint}.q [deg]"] = np.degrees(table.pop(f"{joint}.q"))  # the header counts, too
    saved = robot.save(tmp_path / "again.xml")
    assert_allclose(read(Robot.load(saved), table).q, plain.q, atol=1e-12)


@pytest.mark.parametrize(
    "scale, said",
    [
        (57.29578, "it looks like degrees: say .*angles='deg'.* −100 … 100 of each joint's range"),
        (4096 / (2 * np.pi), "scale = 0.00153398, offset = -3.14159"),
    ],
)
def test_units_that_nobody_stated_are_refused_with_what_to_write(scale, said, arm, frame, rejected):
    motion = frame.drop(columns="t")
    table = motion * scale if scale < 60 else (motion * scale + 2048).round()
    table = table.assign(t=frame["t"])
    with rejected(said) as error:
        predict(arm, arm, table, forward=True)
    assert '[columns] "*" = {scale = …, offset = …} in the sidecar' in str(error.value)


def spoilt(tmp_path, **changed):
    folder = tmp_path / "dataset"
    shutil.copytree(DATASETS / "v2.1", folder)
    info = json.loads((folder / "meta/info.json").read_text()) | changed
    (folder / "meta/info.json").write_text(json.dumps(info))
    return folder


def test_names_tell_channels_and_a_dataset_without_names_has_the_robots_order(arm, tmp_path):
    folder = spoilt(tmp_path, total_episodes=1)
    meta = folder / "meta/info.json"
    info = json.loads(meta.read_text())
    for feature in ("observation.state", "action"):
        info["features"][feature]["names"] = None
    meta.write_text(json.dumps(info))
    assert_array_equal(read(arm, folder).q_ref, read(arm, DATASETS / "v2.1:0").q_ref)
    names = [f"main_{j}.{kind}" for kind in ("pos", "vel") for j in arm.joints]
    info["features"]["observation.state"] = {"names": {"motors": names}}
    meta.write_text(json.dumps(info))
    path = folder / "data/chunk-000/episode_000000.parquet"
    table = pq.read_table(path)
    state = [[*row, *(2 * x for x in row)] for row in table["observation.state"].to_pylist()]
    at = table.schema.get_field_index("observation.state")
    pq.write_table(table.set_column(at, "observation.state", pa.array(state)), path)
    log = read(arm, folder)
    assert_allclose(log.dq, 2 * log.q)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize(
    "shown",
    [
        (),
        ("[", ", ", "]"),
        ("(", ", ", ")"),
        ("array([", ", ", "], dtype=float32)"),
        ("tensor([", ", ", "], device='cuda:0')"),
        ("[np.float32(", "), np.float32(", ")]"),
    ],
)
def test_cells_that_hold_lists_are_one_column_a_joint(ending, shown, arm, frame, tmp_path):
    table = pd.DataFrame({"timestamp": frame["t"]})
    for feature, kind in (("observation.state", "q"), ("action", "cmd")):
        lists = frame[[f"{j}.{kind}" for j in arm.joints]].to_numpy().tolist()
        if shown:
            start, between, end = shown
            lists = [start + between.join(map(str, numbers)) + end for numbers in lists]
        table[feature] = lists
    path = tmp_path / f"run.{ending}"
    (table.to_csv if ending == "csv" else table.to_parquet)(path, index=False)
    plain = read(arm, frame)
    for log in (read(arm, path), read(arm, table)):
        assert_array_equal(log.q, plain.q)
        assert_array_equal(log.q_ref, plain.q_ref)
    table.loc[7, "action"] = "[0.1, 0.2]"
    table.astype({"action": str}).to_csv(tmp_path / "short.csv", index=False)
    assert "lists in column 'action' do not all hold" in refused(arm, tmp_path / "short.csv")


def test_a_table_of_several_episodes_is_refused_with_what_to_give(arm, frame):
    said = refused(arm, pd.concat([frame, frame]))
    assert "time starts again" in said
    assert "of a LeRobot dataset give the folder" in said
    assert "sort the rows" in refused(arm, frame[::-1])
    assert "no column base_yaw.cmd" in refused(arm, frame.filter(regex="^t|q$"))


# ROS 2.


@pytest.fixture(scope="module")
def ros():
    """The types of ROS 2 with those of commands, and a function that writes a bag of messages."""
    typesys = pytest.importorskip("rosbags.typesys", reason="needs the extra 'ros'")
    from rosbags import rosbag2

    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    point = "trajectory_msgs/JointTrajectoryPoint"
    texts = {
        "control_msgs/msg/MultiDOFCommand": "string[] dof_names\nfloat64[] values\n"
        "float64[] values_dot\n",
        "control_msgs/msg/JointTrajectoryControllerState": "std_msgs/Header header\n"
        f"string[] joint_names\n{point} reference\n{point} feedback\n{point} error\n"
        f"{point} output\n",
    }
    for name, text in texts.items():
        store.register(typesys.get_types_from_msg(text, name))

    def write(folder, messages, storage="MCAP"):
        plugin = rosbag2.StoragePlugin[storage]
        with rosbag2.Writer(folder, version=9, storage_plugin=plugin) as writer:
            known = {}
            for t, topic, message in sorted(messages, key=lambda m: m[0]):
                kind = message.__msgtype__
                if topic not in known:
                    known[topic] = writer.add_connection(topic, kind, typestore=store)
                nanoseconds = 1_700_000_000_000_000_000 + round(t * 1e9)
                writer.write(known[topic], nanoseconds, store.serialize_cdr(message, kind))
        return folder

    return store.types, write


def recorded(types, frame, joints, kind, *, effort=False):
    """Yield joint states of every row, and commands whenever they change."""
    stamp = types["builtin_interfaces/msg/Time"]
    header = types["std_msgs/msg/Header"]
    point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = types["builtin_interfaces/msg/Duration"](0, 0)
    empty = np.array([])
    before = None
    for _, row in frame.iterrows():
        now = header(stamp(*divmod(1_700_000_000_000_000_000 + round(row["t"] * 1e9), 10**9)), "")
        q, cmd = (np.array([row[f"{j}.{c}"] for j in joints]) for c in ("q", "cmd"))
        torque = 2 * q if effort else empty
        state = types["sensor_msgs/msg/JointState"](now, list(joints), q, empty, torque)
        yield row["t"], "/joint_states", state
        if before is not None and np.array_equal(cmd, before):
            continue
        before = cmd
        if kind == "JointTrajectoryControllerState":
            wanted = point(cmd, empty, empty, empty, duration)
            none = point(empty, empty, empty, empty, duration)
            made = types[f"control_msgs/msg/{kind}"](
                now, list(joints)[::-1], point(cmd[::-1].copy(), empty, empty, empty, duration),
                none, wanted, none,
            )  # fmt: skip
        elif kind == "MultiDOFCommand":
            made = types[f"control_msgs/msg/{kind}"](list(joints), cmd, 0.0 * cmd)
        else:
            layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
            made = types["std_msgs/msg/Float64MultiArray"](layout, cmd)
        yield row["t"] - 1e-4, "/arm/commands", made


KINDS = ("JointTrajectoryControllerState", "MultiDOFCommand", "Float64MultiArray")


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_joint_states_and_commands_is_the_log(kind, ros, arm, frame, tmp_path):
    types, write = ros
    bag = write(tmp_path / "bag", recorded(types, frame, arm.joints, kind))
    log = read(arm, bag)
    plain = read(arm, frame)
    assert_array_equal(log.q, plain.q)
    assert_array_equal(log.q_ref, plain.q_ref)
    assert_allclose(log.t, plain.t - plain.t[0], atol=1.1e-9)
    assert log.commanded
    assert (log.dq_ref is not None) == (kind == "MultiDOFCommand")


def test_effort_goes_before_commands_and_a_bag_without_either_is_refused(ros, arm, frame, tmp_path):
    types, write = ros
    both = write(tmp_path / "a", recorded(types, frame, arm.joints, KINDS[1], effort=True))
    log = read(arm, both)
    assert not log.commanded
    assert_allclose(log.tau, 2 * log.q)
    alone = [m for m in recorded(types, frame, arm.joints, KINDS[1]) if m[1] == "/joint_states"]
    said = refused(arm, write(tmp_path / "b", alone))
    assert "have no effort" in said
    assert "or position and commands" in said


# Words.
