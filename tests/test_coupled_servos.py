"""Fingers: joints that follow another joint, behind servos or tendons, recorded by MuJoCo alone."""

import mujoco
import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

import studies.drawn_hands as hands
from identifiability import Robot, analyze, export, predict
from identifiability.foundation.findings import of_key
from identifiability.report.analysis import analysis_moving

from .marks import everything

FINGER = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="l1"><joint name="j1" axis="0 1 0" {first} armature=".01"/>
<inertial pos="0 0 -.1" mass=".3" diaginertia=".001 .001 .0005"/>
<body name="l2" pos="0 0 -.2"><joint name="j2" axis="0 1 0" {second}/>
<inertial pos="0 0 -.05" mass=".2" diaginertia=".0005 .0005 .0002"/>
<body name="l3" pos="0 0 -.1"><joint name="j3" axis="0 1 0" {third}/>
<inertial pos="0 0 -.05" mass=".1" diaginertia=".0003 .0003 .0001"/></body></body></body>
</worldbody><tendon><fixed name="pull" {tendon}><joint joint="j2" coef=".6"/>
<joint joint="j3" coef=".5"/></fixed></tendon>
<equality><joint joint1="j3" joint2="j2" polycoef="0 0.8 0 0 0"/></equality>
<actuator><position name="j1" joint="j1" kp="20" kv="1"/>
<position name="second" {place} kp="10" kv=".5"/></actuator></mujoco>"""
URDF = """<robot name="finger"><link name="base"/>{links}
<joint name="j1" type="continuous"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
</joint>
<joint name="j2" type="continuous"><parent link="l1"/><child link="l2"/><axis xyz="0 1 0"/>
<origin xyz="0 0 -.2"/></joint>
<joint name="j3" type="continuous"><parent link="l2"/><child link="l3"/><axis xyz="0 1 0"/>
<origin xyz="0 0 -.1"/><mimic joint="j2" multiplier="0.8"/></joint></robot>"""
LINK = """<link name="l{}"><inertial><origin xyz="0 0 {}"/><mass value="{}"/>
<inertia ixx="{a}" iyy="{a}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
SIDECAR = "[servo]\nkp = {j1 = 20, j2 = 10}\nkv = {j1 = 1, j2 = 0.5}\n"
FIT = '[servo]\nkp = "fit"\n[prior_share]\nl1 = 0.001\n'
COUPLED = "[transmission]\nmotors = ['m1', 'm2']\ncoupling = [[1, 0], [0, 1]]\n"
RATE = 50.0
STEPS = 100


def write_finger(folder, kind, gains):
    """Write a finger without friction, and return it and the true MJCF."""
    place = 'tendon="pull"' if kind == "tendon" else 'joint="j2"'
    parts = {"place": place, "second": "", "third": "", "tendon": ""}
    own = "tendon" if kind == "tendon" else "second"
    text = FINGER.format(first='damping=".1"', **parts)
    parts["third"] = 'damping=".02" frictionloss=".01"' * (kind != "tendon")
    parts[own] = 'damping=".08" frictionloss=".06" armature=".005"'
    true = FINGER.format(first='damping=".1" frictionloss=".12"', **parts)
    path = folder / ("finger.urdf" if kind == "mimic" else "finger.xml")
    if kind == "mimic":
        sizes = (
            (1, -0.1, 0.3, 0.0005, 0.001),
            (2, -0.05, 0.2, 0.0002, 0.0005),
            (3, -0.05, 0.1, 0.0001, 0.0003),
        )
        text = URDF.format(links="".join(LINK.format(*x[:4], a=x[4]) for x in sizes))
    path.write_text(text)
    said = 'actuated = ["j1", "j2"]\n' * (kind == "mimic") + (gains or SIDECAR * (kind == "mimic"))
    if said:
        path.with_suffix(".toml").write_text(said)
    return path, true


def record(true, seed, seconds):
    """Return a log at 50 Hz and 12 bits of the joints of a finger, moved by sums of sines."""
    model = mujoco.MjModel.from_xml_string(true)
    model.opt.timestep = 1 / RATE / STEPS
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    stiff = [2 * model.opt.timestep, 1]
    model.eq_solref[:] = model.dof_solref[:] = model.tendon_solref_fri[:] = stiff
    model.dof_solimp[:, :2] = model.tendon_solimp_fri[:, :2] = 0.9999
    data = mujoco.MjData(model)
    rng = default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    frequency = rng.uniform(0.2, 2, (2, 4, 1))
    phase = rng.uniform(0, 6, (2, 4, 1))
    commands = 0.25 * np.sin(2 * np.pi * frequency * t + phase).sum(1).T
    positions = []
    for command in commands:
        positions.append(data.qpos[:2].copy())
        data.ctrl[:] = command
        mujoco.mj_step(model, data, STEPS)
    step = 2 * np.pi / 2**12
    q = np.rint(np.array(positions) / step) * step
    second = "pull" if 'tendon="pull"' in true else "j2"
    names = ["t", "j1.q", "j2.q", "j1.cmd", f"{second}.cmd"]
    return pd.DataFrame(np.column_stack([t, q, commands]), columns=names)


@pytest.mark.parametrize(
    "kind, gains",
    [
        ("joint", ""),
        everything("joint", FIT),
        ("mimic", ""),
        ("tendon", ""),
        ("tendon", FIT),
    ],
)
def test_a_finger_that_follows_is_fitted_rolled_out_and_exported(tmp_path, kind, gains):
    path, true = write_finger(tmp_path, kind, gains)
    unseen = record(true, 1, 6.0)
    result = analyze(path, record(true, 0, 12.0), unseen, quick=True)
    rolled = result.recordings.rolled
    assert np.all(rolled.errors < 2e-3)
    factor = rolled.numbers["kp"] / [20.0, 10.0]
    # Friction of the joint that follows is part of the friction of the joint that it follows.
    second = 0.06 + 0.8 * 0.01 * (kind != "tendon")
    assert_allclose(rolled.numbers["Fc"] / factor, [0.12, second], rtol=0.1)
    if not gains:
        low, high = result.to_frame(details=True).set_index("name").loc["j1.Fc", "interval95"]
        assert low < 0.12 < high
    target = tmp_path / f"fitted{path.suffix}"
    export(path, result, target)
    fitted = Robot.load(target)
    moved = predict(fitted, fitted, unseen, forward=True)
    # The step of the encoders is 1.5 mrad.
    assert moved.totals[-1] < 2e-3
    assert analysis_moving(result) is not None


def test_torque_tells_the_delay_of_a_finger_that_is_not_rolled_out(tmp_path):
    path, true = write_finger(tmp_path, "joint", COUPLED)
    frames = [record(true, seed, 12.0) for seed in (0, 1)]
    for frame in frames:  # commands that act a row later, 20 ms
        frame[["j1.cmd", "j2.cmd"]] = frame[["j1.cmd", "j2.cmd"]].shift(-1).ffill()
    result = analyze(path, *frames, quick=True)
    low, high = result.to_frame(details=True).set_index("name").loc["j2.Fv", "interval95"]
    assert low < 0.08 < high
    saved = result.to_json(tmp_path / "result.json")
    assert predict(path, saved, frames[1]).error_ra < 0.06  # .64 without the delay
    export(path, saved, tmp_path / "fitted.xml", validate=frames[1])
    assert abs(Robot.load(tmp_path / "fitted.xml").servo.delay - 0.02) < 5e-4
    later = [f.assign(**f[["j1.cmd", "j2.cmd"]].shift(4).bfill()) for f in frames]
    assert of_key(analyze(path, *later, quick=True).hints, "early_commands")
    assert not of_key(result.hints, "early_commands")


def test_bodies_of_the_file_alone_determine_the_scale_of_gains_that_nobody_states(tmp_path):
    rng = default_rng(3)
    hand = hands.draw_hand("tendon", rng, 2)
    log = hands.record(hand, 8.0, 0.008, 500.0, rng)
    result = analyze(hand.write(tmp_path, fitted=True), log, quick=True)
    stated, variance = np.split(
        np.diag(result.recordings.rolled.covariance), [2 * len(hand.servos)]
    )
    assert not stated.any()
    # Of two to four bodies within 20 %.
    assert_allclose(np.sqrt(variance), 0.1, atol=0.03)
