"""Joints that bend, of arms that MuJoCo alone moves, are found with their stiffness; others not."""

from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

from identifiability import Log, Robot, diagnose
from identifiability.bending.deflection import LinkEquation, integrate
from identifiability.bending.stretch import Springs, cut_stretches
from identifiability.effects import default_effects
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure

STEP, EVERY, SECONDS = 5e-4, 10, 10.0
STIFFNESS = 400.0
NAMES = ["shoulder.q", "elbow.q", "shoulder.tau", "elbow.tau"]


def arm(spring: bool) -> str:
    """Return two links whose second has a rotor of its own, behind a spring if it bends."""
    flex = f'<joint name="flex" axis="0 1 0" stiffness="{STIFFNESS}" damping="0.4"/>'
    motor = '<joint name="elbow" axis="0 1 0" armature="0.05" damping="0.5"/>'
    small = '<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'
    link = '<inertial pos="0.2 0 0.05" mass="2" diaginertia="0.01 0.03 0.03"/>'
    inner = f'{small}<body name="forearm">{flex}{link}</body>' if spring else link
    name = "rotor" if spring else "forearm"
    return (
        '<mujoco><compiler angle="radian"/><worldbody><body name="arm">'
        '<inertial pos="0.15 0 0" mass="4" diaginertia="0.02 0.06 0.06"/>'
        '<joint name="shoulder" axis="0 1 0" armature="0.1" damping="1"/>'
        f'<body name="{name}" pos="0.4 0 0">{motor}{inner}</body></body></worldbody><actuator>'
        '<motor name="a" joint="shoulder"/><motor name="b" joint="elbow"/></actuator></mujoco>'
    )


def run(spring: bool, seed: int) -> pd.DataFrame:
    """Return positions and torque of the motors, under a controller that follows sines to 4 Hz."""
    rng = np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_string(arm(spring))
    model.opt.timestep = STEP
    data = mujoco.MjData(model)
    places = [model.joint(name).qposadr[0] for name in ("shoulder", "elbow")]
    t = np.arange(round((1 + SECONDS) / STEP)) * STEP
    frequency = rng.uniform(0.2, 4.0, (8, 2))
    phase = rng.uniform(0, 2 * np.pi, (8, 2))
    waves = np.sin(2 * np.pi * frequency * t[:, None, None] + phase) / (1 + frequency**1.5)
    wanted = 0.25 * waves.sum(1)
    rows = []
    for k in range(len(t)):
        error = wanted[k] - data.qpos[places]
        torque = np.array([800.0, 200.0]) * error - np.array([40.0, 8.0]) * data.qvel[places]
        if t[k] >= 1 and k % EVERY == 0:
            rows.append([t[k], *data.qpos[places], *torque])
        data.ctrl[:] = torque
        mujoco.mj_step(model, data)
    log = pd.DataFrame(rows, columns=["t", *NAMES])
    log[NAMES[2:]] += rng.normal(0, 0.01, (len(log), 2))
    return log


@pytest.fixture
def robot(tmp_path) -> Path:
    path = tmp_path / "arm.xml"
    path.write_text(arm(spring=False))
    return path


def test_a_joint_that_bends_is_found_and_explains_unseen_torque(robot):
    found = diagnose(robot, run(True, 1), run(True, 2), quick=True, bending=True)
    (joint,) = found.bending.joints
    assert joint.stiffness == pytest.approx(STIFFNESS, rel=0.03)
    assert joint.joint == "elbow"
    before, after = found.bending.held_before[1], found.bending.held_after[1]
    assert after < before / 2
    assert "elbow bends" in found.statement
    assert found.to_dict()["bending"]["joints"][0]["joint"] == "elbow"


def test_late_torque_of_a_rigid_arm_is_no_spring(robot):
    log = run(False, 3)
    log["elbow.tau"] = np.interp(log["t"] - 0.004, log["t"], log["elbow.tau"])
    found = diagnose(robot, log, run(False, 4), quick=True, bending=True)
    assert not found.bending.joints
    assert "None that these logs can show" in found.statement


def test_the_fastest_motion_is_used_and_values_that_make_links_unstable_are_refused(robot):
    arm_robot = Robot.load(robot)
    bodies = Model.of(*default_effects(arm_robot, ("rigid_body", "actuator_inertia")))
    how = Preparation(cutoff=25.0, outputs=10.0)
    t = np.arange(8000) / 200
    swing = np.sin(np.where(t < 20, t, 9 * t - 160))
    frame = pd.DataFrame({"t": t} | dict.fromkeys(NAMES, swing))
    log = prepare_log(arm_robot, Log.from_frame(frame), how)
    (stretch,) = cut_stretches(Structure.of(arm_robot, bodies), [log])
    assert stretch.piece.motion.t[0] > 15
    springs = Springs((1,), np.array([[6.0]]), np.array([[0.05]]))
    with np.errstate(over="ignore", invalid="ignore"):
        torque, slopes = stretch.sensitivities(springs, np.ones(2), -stretch.stated)
    assert np.isinf(torque).all()
    assert not slopes.any()


def test_the_deflection_is_that_of_an_oscillator():
    step, frequency, inertia, stiffness = 0.005, 3.0, 2.0, 900.0
    t = np.arange(4000) * step
    one = np.ones((len(t), 1, 1))
    links = LinkEquation(step, 0 * one, 0 * one, inertia * one)
    rate = 2 * np.pi * frequency
    torque = np.sin(rate * t)[:, None, None]
    damping = 8.0
    found = integrate(links, torque, np.array([[stiffness]]), np.array([[damping]]))
    response = 1 / (stiffness - inertia * rate**2 + 1j * damping * rate)
    steady = (response * np.exp(1j * rate * t)).imag
    late = t > 10
    assert found.position[late, 0, 0] == pytest.approx(steady[late], abs=2e-3 * abs(response))
