"""Torque sensors behind gears, before them, and on both sides, on an arm with known drives."""

import numpy as np
import pandas as pd
import pytest

from identifiability import Robot, analyze, export
from identifiability.simulation.mujoco_robot import MujocoRobot

from ..roads import waves

ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="upper">
  <joint name="a" axis="0 1 0" ARMATURE/><inertial pos=".3 0 0" mass="2" diaginertia=".01 .05 .05"/>
  <body name="fore" pos=".5 0 0"><joint name="b" axis="0 1 0" ARMATURE/>
  <inertial pos=".2 .1 0" mass="1" diaginertia=".01 .02 .02"/></body></body></worldbody>
<actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>"""
JOINTS = ["a", "b"]
DRIVE = {"Ia": 0.6, "Fv": 2.0, "Fc": 3.0}


@pytest.fixture
def make(load_text):
    return lambda armature="", side="": load_text(ARM.replace("ARMATURE", armature), sidecar=side)


def move(make, rng):
    """Return a log with link torque, and the torque of the drives (N, 2)."""
    t = np.arange(0.0, 10.0, 0.01)
    rates = np.array([[1.1, 2.7, 4.9], [1.7, 3.1, 4.3]])
    q, v, a = waves(t, rates.T, 0.4, rng.uniform(0, 6, (2, 3)).T)
    link = MujocoRobot(make()).inverse_dynamics(q, v, a).tau
    drive = DRIVE["Ia"] * a + DRIVE["Fv"] * v + DRIVE["Fc"] * np.sign(v)
    frame = pd.DataFrame({"t": t})
    for kind, values in (("q", q), ("dq", v), ("ddq", a), ("tau", link)):
        noise = 0.02 * rng.standard_normal(q.shape) if kind == "tau" else 0.0
        frame[[f"{joint}.{kind}" for joint in JOINTS]] = values + noise
    return frame, drive


@pytest.fixture
def logs(make):
    return [move(make, np.random.default_rng(seed)) for seed in range(2)]


def test_a_sensor_behind_the_gear_is_recognised_and_files_keep_their_rotors(make, logs, tmp_path):
    frames = [frame for frame, _ in logs]
    robot = make('armature=".5"')
    found = analyze(robot, frames, replicates=0)
    assert "sit behind the gear" in found.hints[0]
    assert "a, b" in found.hints[0]
    assert found["b.Ia"].verdict == "not identifiable"
    assert "not observed by this sensor" in found["b.Ia"].reason
    assert Robot.load(export(robot, found, tmp_path / "fitted.xml").robot).nominal["b.Ia"] == 0.5


@pytest.mark.parametrize("armature", ["", 'armature=".5"'])
def test_a_drive_without_rotor_in_the_file_or_with_one_in_the_logs_is_no_such_sensor(
    make, logs, armature
):
    frames = []
    for frame, drive in logs:
        torque = frame[["a.tau", "b.tau"]] + (drive if armature else 0.0)
        frames.append(frame.assign(**{name: torque[name] for name in torque}))
    assert "behind the gear" not in " ".join(analyze(make(armature), frames, replicates=0).hints)


def test_both_sensors_determine_bodies_and_drives(make, logs):
    frames = []
    for frame, drive in logs:
        motors = {f"motor_torque_{j}": frame[f"{j}.tau"] + drive[:, k] for k, j in enumerate("ab")}
        frames.append(frame.assign(**motors))
    found = analyze(make(side='[torque]\nside = "both"\n'), frames, replicates=0)
    for joint in JOINTS:
        for kind, value in DRIVE.items():
            row = found[f"{joint}.{kind}"]
            assert row.verdict == "identifiable"
            assert row.estimate == pytest.approx(value, rel=0.02)
    # Without its rotor, the first joint shows the inertia of its bodies alone.
    assert found["upper.Iyy"].estimate == pytest.approx(0.05 + 2 * 0.3**2 + 0.5**2, rel=0.02)


def test_a_log_with_torque_of_both_sides_is_refused_with_the_setting_that_reads_it(make, rejected):
    names = [
        "t",
        "a.q",
        "b.q",
        "motor_torque_a",
        "motor_torque_b",
        "link_torque_a",
        "link_torque_b",
    ]
    with rejected(r"both sides of a gear\. Say side = \"both\""):
        analyze(make(), pd.DataFrame(np.tile(np.arange(50.0)[:, None], 7), columns=names))
