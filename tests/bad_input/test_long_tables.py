"""Tables with one row a joint and time are read as tables with one row a time, and it is said."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import IdentifiabilityError, Log, analyze
from identifiability.logs.conventions import Conventions

from .conftest import known

JOINTS = ("shoulder", "elbow")
CHANNELS = {"position": "q", "velocity": "dq", "effort": "tau"}


def long_of(arm, labels=JOINTS, channels=CHANNELS, time="time", label="joint"):
    """Return a log as a long table: time, joint, position, velocity, effort."""
    parts = []
    for joint, called in zip(JOINTS, labels, strict=True):
        columns = {name: arm[f"{joint}.{kind}"] for name, kind in channels.items()}
        parts.append(pd.DataFrame({time: arm["t"], label: called, **columns}))
    by_joint = pd.concat(parts, ignore_index=True)
    return by_joint.sort_values(time, kind="stable", ignore_index=True)


def refused(given, read=lambda frame: Log.from_frame(frame, "log", known())):
    """Return the sentence with which a table is refused."""
    with pytest.raises(IdentifiabilityError) as refusal:
        read(given)
    return str(refusal.value)


def same(log, arm):
    log = log.select(JOINTS)
    for kind in CHANNELS.values():
        wanted = arm[[f"{j}.{kind}" for j in JOINTS]].to_numpy()
        assert_allclose(getattr(log, kind), wanted, rtol=1e-12)
    assert_allclose(log.t, arm["t"], rtol=1e-12)
    assert any("put side by side by" in note for note in log.notes)


@pytest.mark.parametrize("order", ["time", "joint"])
def test_a_long_table_is_read_from_every_source_and_reported(order, arm, write, read_long):
    frame = long_of(arm).sort_values([order, "time"], kind="stable", ignore_index=True)
    same(Log.from_frame(frame, "frame", known()), arm)
    path = write("log.csv", frame)
    same(Log.read(path, known()), arm)
    parquet = path.with_suffix(".parquet")
    for table in (frame, frame.astype({"joint": "category"})):
        table.to_parquet(parquet)
        same(Log.read(parquet, known()), arm)
    same(Log.read(path), arm)  # without a robot
    file = read_long(path, known())
    assert file.notes == Log.read(path, known()).notes
    same(file.rows(0, len(file)), arm)
    file = read_long(parquet, known())
    same(file.rows(0, len(file)), arm)


def test_a_long_table_gives_the_result_of_a_wide_one(bare):
    channels = {"position": "q", "effort": "tau"}
    found = analyze("two-link", long_of(bare, channels=channels), replicates=0)
    plain = analyze("two-link", bare, replicates=0)
    assert (found.models[0].estimate.value == plain.models[0].estimate.value).all()
    assert any("'effort' as tau" in hint for hint in found.hints)


@pytest.mark.parametrize(
    "labels, names, rules",
    [
        ((0, 1), {"label": "joint_id"}, {}),
        (("1", "2"), {"label": "axis", "time": "timestamp"}, {}),
        (("fer_shoulder", "fer_elbow"), {"label": "name"}, {r"fer_(\w+)": r"\1"}),
        (("A", "B"), {"label": "Joint Name"}, {"A": "shoulder", "B": "elbow"}),
    ],
)
def test_joints_may_be_numbers_or_renamed(labels, names, rules, arm):
    same(Log.from_frame(long_of(arm, labels, **names), "log", known(columns=rules)), arm)


def test_units_and_other_columns_are_those_of_a_wide_table(arm):
    channels = {"position [deg]": "q", "speed": "dq", "torque [mNm]": "tau"}
    frame = long_of(arm, channels=channels).assign(temperature=40.0, mode="run")
    frame["position [deg]"] = np.degrees(frame["position [deg]"])
    frame["torque [mNm]"] *= 1e3
    same(Log.from_frame(frame, "log", known()), arm)


def test_a_row_of_units_counts_for_all_joints(arm, write):
    frame = long_of(arm)
    frame["position"] = np.degrees(frame["position"])
    header, _, rows = frame.to_csv(index=False).partition("\n")
    same(Log.read(write("log.csv", f"{header}\ns,-,deg,rad/s,Nm\n{rows}"), known()), arm)


def test_two_torques_in_a_long_table_are_one_question(arm):
    channels = {"position": "q", "velocity": "dq", "tau_measured": "tau", "tau_feedback": "q"}
    frame = long_of(arm, channels=channels)
    assert r"columns={'(.+)\\.tau_measured': '\\1.tau'}" in refused(frame)
    rules = {r"(.+)\.tau_measured": r"\1.tau"}
    same(Log.from_frame(frame, "log", known(columns=rules)), arm)


def test_rows_at_times_of_their_own_are_brought_together(arm):
    frame = long_of(arm)
    frame.loc[frame["joint"] == "elbow", "time"] += 0.004
    log = Log.from_frame(frame, "log", known())
    assert any("came at rates of their own" in note for note in log.notes)
    assert np.isfinite(log.q).all()


def test_two_rows_of_a_joint_at_one_time_are_refused(arm):
    frame = long_of(arm)
    twice = pd.concat([frame, frame.iloc[[7]]]).sort_values("time", kind="stable")
    assert refused(twice).startswith("log has two rows of the joint 'elbow' at the time 0.1125;")


def test_a_label_in_a_table_of_one_joint_says_nothing(arm):
    frame = arm[["t", "elbow.q", "elbow.tau"]].set_axis(["t", "position", "torque"], axis=1)
    log = Log.from_frame(frame.assign(name="run 3"), "log", Conventions(joints=("elbow",)))
    assert_array_equal(log.q[:, 0], arm["elbow.q"])


def test_a_joint_that_appears_late_is_refused(arm, write, read_long):
    frame = pd.concat([long_of(arm)] * 3, ignore_index=True)
    frame["time"] = np.repeat(0.01 * np.arange(len(frame) // 2), 2)
    frame.loc[len(frame) - 1, "joint"] = "finger"
    path = write("log.csv", frame)
    said = refused(path, lambda given: read_long(given, known()))
    assert "the joint 'finger' appears in 'joint' for the first time" in said
