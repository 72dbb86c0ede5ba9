"""A torque column of coupled motors that has a wrong sign or name is told, and a right one not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identifiability import Robot, analyze

from .conftest import record, say


def log_motors(columns, signs):
    structure, log = record("differential-wrist")
    gear = structure.robot.transmission
    motors = log.tau @ np.linalg.inv(gear.ratio[:, None] * gear.coupling)
    q = gear.motor_rate(log.q - gear.offset)
    return structure, replace(log, q=q, tau=motors[:, columns] * signs, joints=gear.motors)


@pytest.mark.parametrize(
    "columns, signs, said",
    [
        ([0, 1], [1, 1], ()),
        ([0, 1], [1, -1], ("'right' seems to have the wrong sign",)),
        ([0, 1], [-1, 1], ("'left' seems to have the wrong sign",)),
        ([1, 0], [1, 1], ("left and right seem to be exchanged",)),
    ],
)
def test_columns_of_coupled_motors(columns, signs, said):
    structure, spoilt = log_motors(columns, signs)
    hints = [x for x in say(structure, spoilt) if x.key == "motor"]
    assert len(hints) == len(said)
    assert all(part in hint for part, hint in zip(said, hints, strict=True))


def test_late_torque_of_coupled_motors_is_shifted():
    structure, log = log_motors([0, 1], 1)
    late = replace(log, t=log.t[:-5], q=log.q[5:], tau=log.tau[:-5])
    found = analyze(structure.robot, late, "none", quick=True)
    assert found.alternative.delay == pytest.approx(5 * np.diff(log.t)[0], rel=0.02)


def test_coupled_motors_on_a_moving_base_are_questioned(tmp_path):
    home = Path(__file__).parents[2] / "models/cart-arm"
    side = tmp_path / "side.toml"
    motors = (
        '[transmission]\nmotors = ["a", "b", "c"]\ncoupling = [[1, 0, 0], [0, 1, 0], [0, 1, 1]]\n'
    )
    side.write_text((home / "robot.toml").read_text() + motors)
    log = pd.read_csv(home / "logs/pushed.csv")
    yaw, shoulder, elbow = (log[f"{joint}.tau"] for joint in ("yaw", "shoulder", "elbow"))
    log["a.q"], log["b.q"], log["c.q"] = (
        log["yaw.q"],
        log["shoulder.q"],
        log["elbow.q"] + log["shoulder.q"],
    )
    for sign, said in ((1, 0), (-1, 1)):
        given = log.assign(**{"a.tau": yaw, "b.tau": shoulder - elbow, "c.tau": sign * elbow})
        given = given.drop(columns=[c for c in given if c.startswith(("yaw", "shoulder", "elbow"))])
        found = analyze(Robot.load("cart-arm", sidecar=side), given, "none", quick=True)
        assert sum(hint.key == "motor" for hint in found.hints) == said
