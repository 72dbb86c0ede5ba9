"""The cases of another physics: studies/hidden_physics*.py in short."""

import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identifiability import Log, Robot
from identifiability.effects import default_effects
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.regression import Model

STUDIES = Path(__file__).resolve().parents[1] / "studies"
sys.path.insert(0, str(STUDIES))

import hidden_physics as physics  # noqa: E402
import hidden_physics_cases as cases  # noqa: E402


def _machine(name, dry, viscous=0.0):
    m = physics.Machine.of(Robot.load(name))
    n = len(m.robot.joints)
    levels = np.zeros(len(m.axes))
    levels[:n] = dry
    return replace(m, dry=levels, viscous=viscous * (levels > 0))


def _still(robot, seconds=0.4, runs=1):
    q = robot.actuated_positions(robot.home[None])
    return np.tile(q[None], (runs, round(seconds / physics.STEP), 1))


def _circle(robot, seconds):
    """Positions about home: every joint swings once a second."""
    t = np.arange(0.0, seconds, physics.STEP)
    swing = 0.3 * np.sin(2 * np.pi * t) * (t / seconds)
    return _still(robot, seconds) + swing[None, :, None] * np.ones(len(robot.joints))


def test_a_robot_that_swings_freely_keeps_its_energy_and_friction_takes_it():
    m = _machine("two-link", 0.0)
    stiff = m.run(_circle(m.robot, 1.2), every=1)

    def energy(m, runs):
        data = mujoco.MjData(m.model)
        out = []
        for q, v, _ in runs.full[0]:
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_fwdPosition(m.model, data)
            mujoco.mj_energyPos(m.model, data)
            M = np.empty((2, 2))
            mujoco.mj_fullM(m.model, data, M)
            out.append(data.energy[0] + 0.5 * v @ M @ v)
        return np.array(out)

    m.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    power = (stiff.tau * stiff.v)[0].sum(1) * physics.STEP
    gain = energy(m, stiff)
    assert np.abs(gain - gain[0] - np.cumsum(power)).max() < 0.01 * np.abs(gain - gain[0]).max()
    rough = _machine("two-link", 2.0, 1.0)
    runs = rough.run(_circle(rough.robot, 1.2), every=1)
    gain = energy(rough, runs)
    work = np.cumsum((runs.tau * runs.v)[0].sum(1)) * physics.STEP
    lost = work - (gain - gain[0])
    assert lost[-1] > 1.0
    assert np.diff(lost).min() > -0.01 * lost[-1]


@pytest.mark.parametrize("name", ["two-link", "3-rrr"])
def test_torque_is_what_the_regressor_says_along_true_motion(name):
    m = _machine(name, 0.1, 1.0)
    runs = m.run(_circle(m.robot, 1.2), settle=200)
    assert np.isfinite(runs.tau).all()
    frame = {"t": runs.t}
    for j, joint in enumerate(m.robot.joints):
        motion = {"q": runs.q, "dq": runs.v, "ddq": runs.a, "tau": runs.tau}
        frame |= {f"{joint}.{word}": x[0, :, j] for word, x in motion.items()}
    how = Preparation(derivatives="given", keep_rest=True)
    log = Log.from_frame(cases.pd.DataFrame(frame))
    motion = prepare_log(m.robot, log, how).motion
    W = Model.of(*default_effects(m.robot, USUAL_EFFECTS)).regressor(m.robot, motion)
    moves = np.abs(runs.v[0, :, : len(m.robot.joints)])[motion.kept] > 1e-3
    tau = runs.tau[0][motion.kept]
    left = tau[moves] - W[moves] @ np.linalg.lstsq(W[moves], tau[moves], rcond=1e-10)[0]
    assert np.sqrt(np.mean(left**2)) < 2e-3 * np.sqrt(np.mean(tau**2))
