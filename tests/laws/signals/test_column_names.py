"""What columns of other names are taken for, and the rule that a refusal proposes."""

import re

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from identifiability import IdentifiabilityError, Log
from identifiability.foundation.names import Renames
from identifiability.logs.conventions import Conventions
from identifiability.logs.names import DIMENSIONS, SIZES, WORDS, find_unit, guess_column, words_of

ARM = tuple(f"panda_joint{k}" for k in (1, 2, 3))
UR = ("shoulder_pan_joint", "elbow_joint", "wrist_3_joint")
PAIR = ("shoulder", "elbow")


def each(form, names, kinds):
    return [form.format(j=j, k=k) for k in kinds for j in names]


def read(columns, joints, rules=None):
    """The log of a table whose value in each column is the column's place."""
    t = 0.01 * np.arange(30)
    table = {c: t if k == 0 else np.full(30, float(k)) for k, c in enumerate(columns)}
    known = Conventions(joints=joints, columns=rules or Renames())
    return Log.from_frame(pd.DataFrame(table), "log", known)


def first(log):
    return log.q[0].tolist(), log.tau[0].tolist()


#: Joints, positions and torques of columns in the order of the robot.
IN_ORDER = (PAIR, [1, 2], [3, 4])
UNDERSTOOD = {
    "flat": (["t", *each("observation.{k}.{j}", PAIR, ("state", "effort"))], *IN_ORDER),
    "words": (["time", *each("{j}_{k}", ARM, ("position", "effort"))], ARM, [1, 2, 3], [4, 5, 6]),
    "estimates": (["t", *each("{k}_{j}", PAIR, ("q", "tau_est"))], *IN_ORDER),
    "both": (["t", *each("{k}_{j}", PAIR, ("q", "tau_est", "tau"))], PAIR, [1, 2], [5, 6]),
    "PlotJuggler": (
        [
            "__time",
            "/joint_states/header/stamp",
            *each("/joint_states/{j}/{k}", (*ARM, "finger"), ("position", "velocity", "effort")),
        ],
        ARM,
        [2, 3, 4],
        [10, 11, 12],
    ),
    "from zero": (
        [
            "timestamp",
            *each("{k}[{j}]", (0, 1, 2), ("q", "q_d", "dq", "tau_J", "tau_J_d", "dtau_J")),
        ],
        ARM,
        [1, 2, 3],
        [10, 11, 12],
    ),
    "actual and target": (
        ["timestamp", *each("{k}_{j}", (0, 1, 2), ("target_q", "actual_q", "actual_moment"))],
        UR,
        [4, 5, 6],
        [7, 8, 9],
    ),
    "humps": (
        ["t", *each("{k}{j}", ("Elbow", "Shoulder"), ("position", "torque"))],
        PAIR,
        [2, 1],
        [4, 3],
    ),
    "letters": (["time_ms", "theta1", "theta2", "M1_torque", "M2_torque"], *IN_ORDER),
    "levels": (["t", *each("('{j}', '{k}')", PAIR, ("q", "tau"))], *IN_ORDER),
}


@pytest.mark.parametrize("case", UNDERSTOOD)
def test_usual_names_are_understood_and_said(case):
    columns, joints, q, tau = UNDERSTOOD[case]
    log = read(columns, joints)
    assert log.joints == joints
    assert first(log) == (q, tau)
    assert "read by the usual meaning of their names" in log.notes[0]
    numbered = case in ("letters", "from zero", "actual and target")
    assert log.notes[0].endswith("(in the robot's order)") == numbered


REFUSED = {
    "two torques": (
        ["t", *each("{j}_{k}", PAIR, ("pos", "torque", "effort"))],
        PAIR,
        r"several columns that may be 'shoulder\.tau'.*columns={'\(\.\+\)_torque': '\\+1\.tau'}",
    ),
    "more numbers": (
        ["t", *each("{k}{j}", (1, 2, 3), ("q", "tau"))],
        PAIR,
        r"numbers its joints differently .* the robot has 2: .*columns={'q1': 'shoulder\.q'}",
    ),
    "fewer numbers": (
        ["t", *each("{k}{j}", (1,), ("q", "tau"))],
        ("shoulder", "el bow"),
        r"columns={'q1': 'shoulder\.q'}\)\. If joints .* lock them: .*lock=\['el bow'\]",
    ),
    "other order": (
        ["t", *each("{k}{j}", (1, 2), ("q", "tau"))],
        ("j2", "j1"),
        r"numbers its joints differently from the robot .*the robot has 2: j2, j1",
    ),
    "other names": (
        ["t", *each("M{j}_Act{k}_deg", ("L", "R"), ("Pos", "Torque"))],
        PAIR,
        r"columns={'ML_ActPos_deg': 'shoulder\.q \[deg\]', .*'MR_ActTorque_deg': 'elbow\.tau'}",
    ),
    "commands": (
        ["t", *each("{k}_{j}", (0, 1), ("actual_q", "target_moment"))],
        PAIR,
        r"no column shoulder.* If one of target_moment_0, .*columns={'OLD': 'shoulder\.tau'}",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_certain_is_refused_with_the_remedy(case, rejected):
    columns, joints, sentence = REFUSED[case]
    with rejected(sentence):
        read(columns, joints)


@pytest.mark.parametrize("form", ["{j}.{k}", "{j}_{k}", "/joint_states/{j}/{k}"])
def test_a_rule_of_the_form_that_is_proposed_helps(form):
    fer = [f"fer_joint{k}" for k in (1, 2, 3)]
    kinds = ("q", "tau") if form == "{j}.{k}" else ("position", "effort")
    columns = ["t", *each(form, (*fer, "fer_finger_joint1"), kinds)]
    with pytest.raises(IdentifiabilityError) as refusal:
        read(columns, ARM)
    assert "columns={'OLD': 'panda_joint1'}" in str(refusal.value)
    rules = dict(zip(fer, ARM, strict=True))
    assert all(name in str(refusal.value) for name in fer)
    assert first(read(columns, ARM, Renames.of(rules))) == ([1, 2, 3], [5, 6, 7])


def test_names_that_stand_in_the_log_decide():
    """As ``rostopic echo -p`` writes joint states: in the order of the message."""
    frame = pd.DataFrame({"%time": 0.01 * np.arange(30), "field.name0": "elbow",
                          "field.name1": "shoulder", "field.position0": 1.0, "field.position1": 2.0,
                          "field.effort0": 3.0, "field.effort1": 4.0})  # fmt: skip
    log = Log.from_frame(frame, "log", Conventions(joints=PAIR)).select(PAIR)
    assert first(log) == ([2, 1], [4, 3])


def test_the_documented_names_need_no_note_and_win():
    columns = ["t", *each("{j}.{k}", PAIR, ("q", "tau")), "time", "q1", "q2", "elbow_position"]
    log = read(columns, PAIR)
    assert log.notes == ()
    assert first(log) == ([1, 2], [3, 4])


def test_words_and_units():
    assert words_of("/joint_states/pandaJoint10.position[2]") == [
        "joint", "states", "panda", "joint", "10", "position", "2",
    ]  # fmt: skip
    known = {"N·m": 1, "[mN m]": 1e-3, "rad/s^2": 1, "(deg/s)": np.pi / 180, "rad s⁻¹": None,
             "°": np.pi / 180, "rpm": np.pi / 30, "turns": 2 * np.pi, "MNm": None, "furlong": None,
             "": None}  # fmt: skip
    for text, factor in known.items():
        unit = find_unit(text)
        assert (unit and unit.factor) == factor, text


def test_a_word_stands_in_one_row_of_the_table_alone():
    """Of names of joints' columns, of the base's, and of units: what reads two ways reads none."""
    for rows in (
        [row for channel, row in WORDS.items() if not channel.startswith("base.")],
        [row for channel, row in WORDS.items() if channel.startswith("base.")],
        [row for units in SIZES.values() for row in units],
    ):
        words = [word for row in rows for word in row.split()]
        assert len(words) == len(set(words))


@pytest.mark.parametrize(
    "name, kind, factor",
    [
        ("elbow.q_des", "q_ref", None),
        ("elbow_q_des_deg", "q_ref", np.pi / 180),
        ("elbow/q_dot_cmd", "dq_ref", None),
        ("policy/elbow target velocity [rpm]", "dq_ref", np.pi / 30),
        ("elbow feedforward nm", "tau_ff", 1.0),
        ("elbow.Istlänge_mm", "q", 1e-3),
        ("elbow_force_N", "tau", 1.0),
    ],
)
def test_a_command_is_read_as_a_measurement_is(name, kind, factor):
    guess = guess_column(name, name, ["shoulder", "elbow"])
    assert (guess.joint, guess.kind) == ("elbow", kind)
    assert (guess.unit and guess.unit.factor) == (factor and pytest.approx(factor))


T = 0.01 * np.arange(30)
Q, DQ = np.sin(T), np.cos(T)


def read_scaled(columns, size, offset=0.0, **known):
    """Read motion of a joint that counts from an offset in units of some size."""
    known = Conventions(joints=("a",), scales={"a": (size, offset)}, **known)
    log = Log.from_frame(pd.DataFrame({"t": T, **columns, "a.tau": T}), "log", known)
    return [x[:, 0] for x in (log.q, log.dq) if x is not None]


@pytest.mark.parametrize("size", [-1.0, 5e-5])
def test_speeds_with_a_unit_take_the_direction_of_counts_and_not_their_size(size):
    table = {"a.q": Q / size, "a.dq [rad/s]": DQ * np.sign(size)}
    assert_allclose(read_scaled(table, size), (Q, DQ))


@pytest.mark.parametrize("size", [1.0, -1 / 175])
def test_a_scale_multiplies_the_unit_of_the_heading(size):
    """Such as a motor's angle in degrees behind a gear, counted the other way."""
    motor = {"a.q [deg]": np.degrees(Q - 0.3) / size, "a.dq [deg/s]": np.degrees(DQ) / size}
    assert_allclose(read_scaled(motor, size, 0.3), (Q, DQ), atol=1e-12)


def test_a_direction_keeps_degrees():
    (q,) = read_scaled({"a.q": -np.degrees(T)}, -1.0, degrees=("a",))
    assert_allclose(q, T, atol=1e-12)


@pytest.mark.parametrize("kind", DIMENSIONS)
def test_a_refused_unit_has_one_article_that_fits(kind):
    with pytest.raises(IdentifiabilityError) as refused:
        find_unit("N" if kind == "t" else "s").check(kind, "x", "run.csv", "elbow")
    said = str(refused.value)
    assert re.search(r" is (an [aeiou]|a [^aeiou])\w+", said), said
