"""What was recorded under ROS comes out as the log that went in."""

import sys

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import IdentifiabilityError, Log
from identifiability.foundation.names import Renames
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.bags import read_bag

pytest.importorskip("rosbags", reason="needs the extra 'ros'")

JOINTS = ("shoulder", "elbow")
COLUMNS = [f"{j}.{c}" for c in ("q", "dq", "tau") for j in JOINTS]


def check(log, frame):
    pd.testing.assert_frame_equal(log.to_frame()[COLUMNS], frame[COLUMNS])


def refused(path):
    with pytest.raises(IdentifiabilityError) as error:
        Log.read(path)
    return str(error.value)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_is_the_log_that_was_recorded(storage, frame, states, write_bag):
    bag = write_bag({"/joint_states": states(frame, JOINTS)}, storage)
    (single,) = [p for p in bag.iterdir() if p.suffix in (".mcap", ".db3")]
    for path in (bag, single, f"{single}:/joint_states"):
        log = Log.read(path)
        assert log.joints == JOINTS
        # q, dq and tau are doubles in the message; time is cut to a nanosecond.
        check(log, frame)
        assert_allclose(log.t, frame["t"] - frame["t"][0], rtol=0, atol=1.1e-9)
        assert log.start == pytest.approx(1_700_000_000.123456789 + frame["t"][0], abs=1e-6)


def test_joints_in_another_order_and_messages_out_of_order_do_not_matter(frame, states, write_bag):
    there = list(states(frame, JOINTS))
    back = list(states(frame, JOINTS[::-1]))
    mixed = [m for pair in zip(there[1::2], back[::2], strict=True) for m in pair]
    log = Log.read(write_bag({"/joint_states": mixed})).select(JOINTS)
    check(log, frame)


def test_messages_without_a_stamp_have_the_time_at_which_they_were_recorded(
    frame, states, write_bag
):
    bag = write_bag({"/joint_states": states(frame, JOINTS, start=0)})
    assert_allclose(Log.read(bag).t, 1e-3 * np.arange(len(frame)), atol=1e-9)


def test_passive_joints_and_velocities_that_nobody_measured_are_left_out(frame, states, write_bag):
    columns = [c for c in frame if not c.endswith(".dq")]
    log = Log.read(write_bag({"/a": states(frame[columns], ("wheel", *JOINTS))}))
    assert log.joints == JOINTS
    assert log.dq is None
    empty = Log.read(write_bag({"/a": states(frame, JOINTS, without=("dq",))}, name="empty"))
    assert empty.dq is None


def test_one_of_several_topics_is_named_behind_a_colon(frame, states, write_bag):
    other = frame.assign(**{"elbow.q": 0.0})
    bag = write_bag({"/arm/states": states(frame, JOINTS), "/b": states(other, JOINTS)})
    assert refused(bag) == (
        f"{bag} has joint states on the topics /arm/states, /b; name one of them as "
        f"'{bag}:/arm/states'."
    )
    assert Log.read(f"{bag}:/b").q[:, 1].max() == 0.0
    assert Log.read(f"{bag}:/arm/states").q[:, 1].max() > 0.0
    assert refused(f"{bag}:/arm/state") == (
        f"{bag} has no joint states on the topic '/arm/state', did you mean '/arm/states'? It has "
        "them on /arm/states, /b."
    )


def test_a_topic_shared_with_a_gripper_is_read_by_naming_the_joints(
    frame, states, write_bag, rejected, two_link
):
    arm = list(states(frame, JOINTS))
    finger = list(states(frame.rename(columns=lambda c: c.replace("elbow", "finger")), ["finger"]))
    bag = write_bag({"/joint_states": [m for pair in zip(arm, finger, strict=True) for m in pair]})
    assert "tell of different joints (shoulder, elbow; then finger)" in refused(bag)
    known = Conventions.of(two_link)
    log = Log.read(bag, known)
    check(log, frame)
    assert log.notes == ("messages that do not tell of the robot's joints were passed over",)
    apart = Log.read(write_bag({"/gripper": finger, "/joint_states": arm}, name="apart"), known)
    assert_array_equal(apart.q, log.q)
    other = Conventions(joints=("a", "b"), columns=Renames.of({"shoulder": "a", "elbow": "b"}))
    renamed = Log.read(bag, other)
    assert_array_equal(renamed.q, log.q)
    assert renamed.joints == ("a", "b")
    assert renamed.notes[1].startswith("columns were renamed (shoulder.q is a.q")
    with rejected("and no message of all joints that are needed"):
        Log.read(bag, Conventions(joints=("a", "b")))


def test_bags_without_torque_or_without_joint_states_are_refused(
    frame, states, joint_state, write_bag
):
    bag = write_bag({"/joint_states": states(frame, JOINTS, without=("tau",))})
    assert refused(bag) == (
        f"{bag}: the joint states on /joint_states have no effort in some or all messages; record "
        "a topic that has position and effort, or position and commands."
    )
    header = joint_state((), [], [], [], 1).header
    bag = write_bag({"/clock": [header]}, name="clock")
    assert refused(bag) == (
        f"{bag} has no topic of type sensor_msgs/JointState; it holds /clock (std_msgs/msg/Header)."
    )


def test_without_the_extra_the_sentence_says_what_to_install(frame, states, write_bag, monkeypatch):
    bag = write_bag({"/joint_states": states(frame, JOINTS)})
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    assert refused(bag) == (
        f"{bag} is a bag, which needs the extra 'ros': in a checkout pip install '.[ros]'."
    )


def test_inertial_sensor_and_wrenches_are_read_at_the_times_of_the_joint_states(
    frame, states, write_bag
):
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_JAZZY).types
    vector = types["geometry_msgs/msg/Vector3"]
    none = np.zeros(9)
    still = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    start = next(iter(states(frame, JOINTS))).header.stamp
    imu = []
    hand = []
    for k in range(3 * len(frame)):
        stamp = types["builtin_interfaces/msg/Time"](start.sec, start.nanosec + 400_000 * k)
        header = types["std_msgs/msg/Header"](stamp, "base")
        spin = vector(0.1, 0.2, 1e-4 * k)
        push = vector(1.0, 2.0, 3.0 + k)
        imu.append(types["sensor_msgs/msg/Imu"](header, still, none, spin, none, push, none))
        wrench = types["geometry_msgs/msg/Wrench"](push, spin)
        hand.append(types["geometry_msgs/msg/WrenchStamped"](header, wrench))
    topics = {"/joint_states": states(frame, JOINTS), "/imu": imu, "/left/foot": hand}
    bag = write_bag(topics)
    read = read_bag(bag, Conventions())
    k = (read["t"] / 4e-4).clip(upper=3 * len(frame) - 1)
    assert_allclose(read["base.acc.z"], 3 + k, atol=1e-3)
    assert_allclose(read["base.gyro.z"], 1e-4 * k, atol=1e-6)
    assert_allclose(read["left.foot.force.z"], 3 + k, atol=1e-3)
    assert (read["left.foot.torque.y"] == 0.2).all()
    check(Log.read(bag), frame)
