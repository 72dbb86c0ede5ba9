"""What a log leaves open is asked once, with an option that settles it when it is pasted."""

import re
import shlex
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from identifiability import IdentifiabilityError, Log, Robot
from identifiability.foundation.names import Renames, find_named
from identifiability.logs.conventions import Conventions
from identifiability.report.answers.commands import source_name

ARM = ("shoulder", "elbow", "wrist")


def table(columns, rows=40):
    """Return a table whose column k holds k from row to row, and whose first is time."""
    values = np.tile(np.arange(len(columns), dtype=float), (rows, 1))
    values[:, 0] = 0.01 * np.arange(rows)
    return pd.DataFrame(values, columns=list(columns))


def options_in(sentence, option):
    """Return the values of an option in a sentence, as a shell reads them."""
    flags = sentence[sentence.index(option) :].rstrip(".").split(". ")[0]
    words = shlex.split(flags)
    return [value for name, value in pairwise(words) if name == option]


def named(joints, **rules):
    """Return what is known of logs of these joints."""
    return Conventions(joints=tuple(joints), columns=Renames.of(rules))


def asked(frame, known):
    """Return the question about a table."""
    with pytest.raises(IdentifiabilityError) as refused:
        Log.from_frame(frame, "run", known)
    return refused.value.args[0]


def answered(frame, joints):
    """Return the question about a table, and the log that its own options settle."""
    said = asked(frame, Conventions(joints=joints))
    rules = dict(value.rpartition("=")[::2] for value in options_in(said, "--map"))
    log = Log.from_frame(frame, "run", Conventions(joints=joints, columns=Renames.of(rules)))
    return said, rules, log.select(joints)


#: Columns, joints, and how many options settle them.
LAYOUTS = {
    "by name": (["{j}.q", "{j}.tau_measured", "{j}.tau_feedback"], ARM, ARM, 1),
    "name last": (["q_{j}", "torque/{j}", "effort/{j}"], ARM, ARM, 1),
    "no word": (["{j}.q", "u_{j}"], ARM, ARM, 1),
    "states": (["{j}.state.q", "{j}.state.theta", "{j}.tau"], ARM, ARM, 1),
    "both": (["{j} q", "{j} theta", "{j} torque [Nm]", "{j} effort [Nm]"], ARM, ARM, 2),
    "numbers": (["q{j}", "theta{j}", "tau_measured_{j}", "tau_feedback_{j}"], ARM, "123", 2),
    "from zero": (["q[{j}]", "tau_measured[{j}]", "tau_feedback[{j}]"], ARM, "012", 1),
    "numbered joints": (
        ["joint_{j}.pos", "joint_{j}.theta", "joint_{j}.effort", "joint_{j}.torque"],
        ("joint_1", "joint_2", "joint_3"),
        "123",
        2,
    ),
    "short names": (
        ["FL_{j}/q", "FL_{j}/torque", "FL_{j}/effort"],
        ("FL_hip_joint", "FL_calf_joint"),
        ("hip", "calf"),
        1,
    ),
    "one joint": (["{j}.q", "{j}.tau_measured", "{j}.tau_feedback"], ("elbow",), ("elbow",), 1),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_one_question_settles_all_joints_when_its_options_are_pasted(layout):
    channels, joints, parts, count = LAYOUTS[layout]
    columns = [channel.format(j=part) for channel in channels for part in parts]
    said, rules, log = answered(table(["t", *columns]), joints)
    assert len(rules) == count, said
    assert said.count("may be") == 1
    first = {"q": 0, "tau": 2 if layout in ("both", "numbers", "numbered joints", "states") else 1}
    for kind, position in first.items():
        values = [1 + position * len(joints) + k for k in range(len(joints))]
        assert getattr(log, kind)[0].tolist() == values, (kind, rules)


def test_the_other_answer_is_given_by_the_other_name():
    columns = [f"{j}.{kind}" for kind in ("q", "tau_measured", "tau_feedback") for j in ARM]
    frame = table(["t", *columns])
    ((old, new),) = answered(frame, ARM)[1].items()
    other = {old.replace("tau_measured", "tau_feedback"): new}
    assert Log.from_frame(frame, "run", named(ARM, **other)).tau[0].tolist() == [7, 8, 9]


def test_joints_without_a_common_pattern_are_settled_by_one_command_all_the_same():
    columns = ["A(q", "B)q", "elbow tau", "elbow effort", "tau shoulder", "shoulder torque"]
    known = named(ARM[:2], **{r"A\(q": "shoulder.q", r"B\)q": "elbow.q"})
    rules = options_in(asked(table(["t", *columns]), known), "--map")
    assert [rule.rpartition("=")[2] for rule in rules] == ["elbow.tau", "shoulder.tau"]


def test_times_and_torques_are_asked_in_one_sentence():
    channels = ("q", "tau_measured", "tau_feedback")
    columns = ["time", "timestamp", *(f"{j}.{kind}" for kind in channels for j in ARM)]
    said, rules, log = answered(table(columns), ARM)
    assert "the time: time, timestamp; 'shoulder.tau': " in said
    assert len(rules) == 2
    assert log.t[1] == pytest.approx(0.01)


def echoed(stamp):
    """Return the table that ``rostopic echo -p`` writes, whose messages were received late."""
    frame = table(["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id",
                   *(f"field.{kind}{k}" for kind in ("position", "effort")
                     for k in range(2))])  # fmt: skip
    frame["%time"] = 10**18 + (1e7 * (np.arange(40) + np.arange(40) % 2 / 2)).astype(np.int64)
    frame["field.header.stamp"] = stamp
    return frame.assign(**{"field.name0": "elbow", "field.name1": "shoulder"})


def test_the_stamp_of_the_header_goes_before_the_time_of_the_recorder_and_is_reported(tmp_path):
    known = named(ARM[:2])
    path = tmp_path / "run.csv"
    frame = echoed(10**18 + 10**7 * np.arange(40))
    frame.to_csv(path, index=False)
    for log in (Log.read(path, known), Log.from_frame(frame, "run", known)):
        assert np.diff(log.t) == pytest.approx(0.01)
        (said,) = [note for note in log.notes if "several times" in note]
        assert re.fullmatch(
            r"of several times 'field\.header\.stamp' was taken, not '%?time'", said
        )


def test_stamps_that_nobody_set_are_passed_over():
    log = Log.from_frame(echoed(0), "run", named(ARM[:2]))
    assert log.t[1] - log.t[0] == pytest.approx(0.015, rel=1e-4)


SHIPPED = ("quadruped", "hobby-arm", "six-ups", "delta", "palletizer", "walking-quadruped")


@pytest.mark.parametrize("name", SHIPPED)
def test_the_joints_that_a_log_lacks_are_locked_by_patterns_that_stand_for_no_other(name):
    robot = Robot.load(name)
    measured = [f"{j}.{kind}" for j in robot.motor_joints[:2] for kind in ("q", "tau")]
    said = asked(table(["t", *measured]), replace(Conventions.of(robot), base=None))
    every = [*robot.motor_joints, *robot.home_table]
    found = {j for text in options_in(said, "--lock") for j in find_named(text, every)}
    assert found == {*robot.motor_joints[2:]}


def test_pasted_locks_let_a_log_of_some_joints_be_read(tmp_path, command, succeeds):
    leg = ("FL_hip_joint", "FL_thigh_joint", "FL_calf_joint")
    path = tmp_path / "run.csv"
    frame = table(["t", *(f"{j}.{kind}" for j in leg for kind in ("q", "tau"))], 400)
    wave = np.sin(np.outer(frame["t"], np.arange(1, 7)))
    frame.iloc[:, 1:] = 0.1 * wave
    frame.to_csv(path, index=False)
    refusal = command("inspect", "quadruped", path)
    assert refusal.exit_code == 2
    locks = options_in(refusal.stderr.strip(), "--lock")
    assert len(locks) <= 3
    words = [word for lock in locks for word in ("--lock", lock)]
    succeeds("inspect", "quadruped", path, *words)


def test_next_lines_repeat_locks_by_the_same_patterns():
    robot = Robot.load("quadruped", lock=["F*", "RL_*=0.1", "RR_hip_joint"])
    given = shlex.split(source_name(robot))
    assert Robot.load("quadruped", lock=given[2::2]).locked == robot.locked
    assert len(given) < 2 * len(robot.locked)
