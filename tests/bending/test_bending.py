"""Joints that bend, of arms that MuJoCo alone moves, are found with their stiffness; others not."""

import mujoco
import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from scipy.interpolate import CubicSpline

from identifiability import Log, Model, Preparation, Robot, diagnose, export, inspect, prepare_log
from identifiability.bending.stretch import Springs, cut_stretches
from identifiability.effects import default_effects
from identifiability.regression.structure import Structure
from identifiability.simulation import Campaign, PrescribedMotion

STEP, EVERY, SECONDS = 5e-4, 10, 10.0
STIFFNESS = 400.0
NAMES = ["shoulder.q", "elbow.q", "shoulder.tau", "elbow.tau"]


def arm(spring):
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
        '<motor name="a" joint="shoulder"/><motor name="b" joint="elbow"/></actuator>'
        f'<keyframe><key qpos="{"0 0 0" if spring else "0 0"}"/></keyframe></mujoco>'
    )


def run(spring, seed):
    """Return positions and noisy torque of the motors of an arm."""
    log = roll(mujoco.MjModel.from_xml_string(arm(spring)), seed)
    noise = default_rng(seed).normal(0, 0.01, (len(log), 2))
    log[NAMES[2:]] += noise
    return log[["t", *NAMES]]


def roll(model, seed):
    """Return motion and torque of motors, and the link's angle, under control by sines to 4 Hz."""
    rng = default_rng(seed)
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
            tip = data.qpos[places[1] :].sum()
            rows.append([t[k], *data.qpos[places], *torque, tip])
        data.ctrl[:] = torque
        mujoco.mj_step(model, data)
    return pd.DataFrame(rows, columns=["t", *NAMES, "tip"])


@pytest.fixture
def robot(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(arm(spring=False))
    return path


def test_a_joint_that_bends_is_found_and_exported_so_that_unseen_motion_is_its_own(robot, tmp_path):
    true = roll(mujoco.MjModel.from_xml_string(arm(True)), 3)
    fitted, held_out, last = (run(True, seed) for seed in (1, 2, 4))
    errors = []
    unseen = []
    for bending in (False, True):
        found = diagnose(robot, fitted, held_out, quick=True, bending=bending)
        made = export(robot, found, tmp_path / f"{bending}.xml", validate=last, force=True)
        error = roll(mujoco.MjModel.from_xml_path(str(made.robot)), 3) - true
        errors.append(np.sqrt((error**2).mean()))
        unseen.append(made.unseen.written)
    assert unseen[1] < unseen[0] / 4
    rigid, elastic = errors
    for name in ("elbow.tau", "elbow.q", "tip"):
        assert elastic[name] < rigid[name] / 20
    again = Robot.load(made.robot)
    assert again.bodies == Robot.load(robot).bodies
    (joint,) = found.bending.joints
    assert again.springs["elbow"].stiffness == joint.stiffness
    assert joint.stiffness == pytest.approx(STIFFNESS, rel=0.03)
    assert "elbow bends" in found.details
    assert "URDF" in export(robot, found, tmp_path / "arm.urdf", force=True).statement


def test_simulated_links_bend_as_those_that_mujoco_moves_under_torque(tmp_path, rejected):
    path = tmp_path / "bent.xml"
    path.write_text(arm(True))
    true = roll(mujoco.MjModel.from_xml_string(arm(True)), 3)
    q = true[["shoulder.q", "elbow.q"]].to_numpy()
    along = CubicSpline(true.t, q)
    motion = PrescribedMotion(true.t.to_numpy(), q, along(true.t, 1), along(true.t, 2))
    found = Campaign.of(Robot.load(path), [motion])
    settled = slice(600, -10)
    tip = found.deflection[settled, 1] + q[settled, 1]
    assert tip == pytest.approx(true.tip[settled], abs=2e-4)
    torque = true[["shoulder.tau", "elbow.tau"]][settled]
    assert found.torque[settled] == pytest.approx(torque.to_numpy(), abs=0.2)
    # Linear models are rigid, which is said.
    assert "spring between motor and link at elbow" in " ".join(inspect(path, run(True, 3)).hints)
    with rejected(r"diagnose\(bending=True\)"):
        Model.of("rigid_body", "joint_compliance@elbow")


def test_late_torque_of_a_rigid_arm_is_no_spring(robot):
    log = run(False, 3)
    log["elbow.tau"] = np.interp(log["t"] - 0.004, log["t"], log["elbow.tau"])
    found = diagnose(robot, log, run(False, 4), quick=True, bending=True)
    assert not found.bending.joints
    assert "None that these logs can show" in found.details


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
