"""Fingers: joints that follow another joint, behind a position servo, recorded by MuJoCo alone."""

import mujoco
import numpy as np
import pandas as pd
import pytest

from identifiability import Robot, analyze, export, predict

FINGER = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody>
<body name="l1"><joint name="j1" axis="0 1 0" {first} armature=".01"/>
<inertial pos="0 0 -.1" mass=".3" diaginertia=".001 .001 .0005"/>
<body name="l2" pos="0 0 -.2"><joint name="j2" axis="0 1 0" {second} armature=".005"/>
<inertial pos="0 0 -.05" mass=".2" diaginertia=".0005 .0005 .0002"/>
<body name="l3" pos="0 0 -.1"><joint name="j3" axis="0 1 0" damping=".02" armature=".002"/>
<inertial pos="0 0 -.05" mass=".1" diaginertia=".0003 .0003 .0001"/></body></body></body>
</worldbody>
<equality><joint joint1="j3" joint2="j2" polycoef="0 0.8 0 0 0"/></equality>
<actuator><position name="j1" joint="j1" kp="20" kv="1"/>
<position name="j2" joint="j2" kp="10" kv=".5"/></actuator></mujoco>"""
FILE = FINGER.format(first='damping=".1"', second='damping=".05"')
TRUE = FINGER.format(
    first='damping=".1" frictionloss=".12"', second='damping=".08" frictionloss=".06"'
)
RATE = 50.0
STEPS = 100


def record(seed, seconds):
    """Return a log at 50 Hz and 12 bits of the true finger, moved by sums of sines."""
    model = mujoco.MjModel.from_xml_string(TRUE)
    model.opt.timestep = 1 / RATE / STEPS
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.eq_solref[:] = model.dof_solref[:] = [2 * model.opt.timestep, 1]
    model.dof_solimp[:, :2] = 0.9999
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    frequency, phase = rng.uniform(0.2, 2, (2, 4, 1)), rng.uniform(0, 6, (2, 4, 1))
    commands = 0.25 * np.sin(2 * np.pi * frequency * t + phase).sum(1).T
    positions = []
    for command in commands:
        positions.append(data.qpos[:2].copy())
        data.ctrl[:] = command
        mujoco.mj_step(model, data, STEPS)
    step = 2 * np.pi / 2**12
    q = np.rint(np.array(positions) / step) * step
    names = ["t", "j1.q", "j2.q", "j1.cmd", "j2.cmd"]
    return pd.DataFrame(np.column_stack([t, q, commands]), columns=names)


@pytest.mark.parametrize("gains", ["", '[servo]\nkp = "fit"\n[prior_share]\nl1 = 0.001\n'])
def test_a_finger_that_follows_is_fitted_rolled_out_and_exported(tmp_path, gains):
    path = tmp_path / "finger.xml"
    path.write_text(FILE)
    if gains:
        path.with_suffix(".toml").write_text(gains)
    unseen = record(1, 6.0)
    result = analyze(path, record(0, 12.0), unseen, quick=True)
    rolled = result.recordings.rolled
    assert np.all(rolled.errors < 2e-3)
    factor = rolled.numbers["kp"] / [20.0, 10.0]
    np.testing.assert_allclose(rolled.numbers["Fc"] / factor, [0.12, 0.06], rtol=0.1)
    if not gains:
        low, high = result.to_frame(details=True).set_index("name").loc["j1.Fc", "interval95"]
        assert low < 0.12 < high
    result.to_json(tmp_path / "result.json")
    export(path, tmp_path / "result.json", tmp_path / "fitted.xml")
    fitted = Robot.load(tmp_path / "fitted.xml")
    moved = predict(fitted, fitted, unseen, forward=True)
    # The step of the encoders is 1.5 mrad.
    assert moved.totals[-1] < 2e-3
