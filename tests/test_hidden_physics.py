"""The cases of another physics: studies/hidden_physics*.py in short."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
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
import hidden_physics_exam as exam  # noqa: E402
import hidden_physics_laws as laws  # noqa: E402


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


def test_a_joint_at_rest_stays_where_it_is_while_forces_are_within_its_level():
    m = _machine("two-link", 30.0)

    def push(share):
        def begin(_runs):
            return lambda s: (share * 30.0 * np.sin(40 * s.t), 0.0, 0.0)

        return [physics.Law(0, begin)]

    held = m.run(_still(m.robot), push(0.4))  # its motor bears the arm
    assert np.all(held.q == held.q[:, :1])
    assert np.all(held.v == 0)
    assert held.stuck.all()
    slips = m.run(_still(m.robot), push(4.0))
    assert np.ptp(slips.q[:, :, 0]) > 1e-3


def test_friction_is_within_its_levels_against_the_motion_and_leaves_rest_at_rest():
    rng = np.random.default_rng(0)
    for _ in range(50):
        B = rng.standard_normal((3, 4, 4))
        A = B @ B.swapaxes(1, 2) + 0.1 * np.eye(4)
        free, v = rng.standard_normal((2, 3, 4))
        up, down = rng.uniform(0.0, 2.0, (2, 3, 4))
        f, rests = physics.stick(free, A, up, down, v * rng.integers(0, 2, (3, 4)))
        ahead = free + physics.times(A, f)
        assert np.all((f >= -up - 1e-12) & (f <= down + 1e-12))
        assert np.all(f * ahead <= 1e-9)  # it takes energy
        assert np.all(np.abs(ahead[rests]) < 1e-6)
        assert np.allclose(np.where(ahead > 0, -up, down)[~rests], f[~rests])


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


def test_loops_stay_closed():
    m = _machine("five-bar", 0.5)
    runs = m.run(_circle(m.robot, 1.0))
    data, apart = mujoco.MjData(m.model), []
    for q, _, _ in runs.full[0]:
        data.qpos[:] = q
        mujoco.mj_fwdPosition(m.model, data)
        apart.append(np.abs(data.efc_pos).max())
    assert max(apart) < 1e-5


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A case that hides one effect in a two-link arm, made twice from the same seed."""
    patch = pytest.MonkeyPatch()
    patch.setattr(cases, "SECONDS", 1.0)
    patch.setattr(cases, "ROBOTS", {"two-link": "two-link"})
    patch.setattr(cases, "INSIDE", {"joint_stiffness": laws.INSIDE["joint_stiffness"]})
    folders = [tmp_path_factory.mktemp(name) for name in ("first", "again")]
    paths = [cases.make_case(folder, "0", 3, "inside") for folder in folders]
    yield paths
    patch.undo()


def test_the_same_seed_gives_the_same_bytes(made):
    first, again = ({p.name: p.read_bytes() for p in path.iterdir()} for path in made)
    assert first == again


def test_the_truth_is_complete(made):
    truth = json.loads((made[0] / "truth.json").read_text())
    (effect,) = truth["effects"]
    assert {"family", "place", "shape", "z", "share", "fits", "numbers"} <= set(effect)
    assert effect["place"] in truth["joints"]
    assert {"stream", "number", "kind", "robot", "starts", "noise", "masses"} <= set(truth)
    masses = np.abs(np.array(truth["masses"]) - 1)
    assert np.all((masses >= 0.1) & (masses <= 0.3))
    logs = cases.load_logs(made[0])
    assert [log.name for log in logs] == list(cases.LOGS)
    assert cases.load_robot(made[0]).joints == tuple(truth["joints"])


def test_the_oracles_z_is_the_size_over_the_noise(monkeypatch, tmp_path):
    """Twice the effect is twice the z, and whitened noise has unit variance."""
    monkeypatch.setattr(cases, "SECONDS", 1.0)
    monkeypatch.setattr(cases, "ROBOTS", {"two-link": "two-link"})
    rng = np.random.default_rng(1)
    robot = cases.write_robot(tmp_path, "two-link", rng)
    case = cases.Case(robot, "inside", rng)
    _, runs, parts = case.simulate(
        [(laws.INSIDE["joint_stiffness"](rng, case.joint("elbow")), "elbow")]
    )
    assert np.allclose(
        parts[0][:, :, 1], parts[0][:, :, 1][0, 0] / runs.q[0, 0, 1] * runs.q[:, :, 1]
    )
    one, two = (case.oracle(runs, [k * parts[0]], 0.9)[0] for k in (1, 2))
    assert two == pytest.approx(2 * one)
    noise = cases.coloured(rng, 20_000, 1, 0.9)
    rows = cases.whitened(noise[:, :, None], np.ones(1), 0.9, case.rate)
    assert np.mean(rows**2) == pytest.approx(1.0, abs=0.1)


def _named(family, joint, *, unnamed=False, weight=0.99, rivals=()):
    rivals = [list(r) for r in rivals]
    return {"family": family, "joint": joint, "unnamed": unnamed, "weight": weight, "or": rivals}


def _truth(*effects, kind="inside"):
    held = [{"family": f, "place": p, "z": z, "fits": fits} for f, p, z, fits in effects]
    return {"effects": held, "kind": kind, "joints": ["j1", "j2"], "stands": [0.2, 0.0]}


STRIBECK = ("stribeck_friction", "j1", 9.0, ["stribeck_friction"])
LUGRE = ("lugre", "j2", 9.0, ["stribeck_friction", "function_of_velocity"])


@pytest.mark.parametrize(
    ("truth", "named", "outcome"),
    [
        (_truth(STRIBECK), [_named("stribeck_friction", "j1")], "exact"),
        (_truth(STRIBECK), [_named("rising_friction", "j1", rivals=[("stribeck_friction", "j1")])],
         "A or B"),
        (_truth(STRIBECK), [_named("stribeck_friction", "j2")], "wrong"),
        (_truth(STRIBECK), [_named("stribeck_friction", "j1"), _named("hysteresis", "j1")],
         "truth and more"),
        (_truth(STRIBECK), [_named("function_of_velocity", "j1", unnamed=True)], "function"),
        (_truth(STRIBECK), [], "missed"),
        (_truth((*STRIBECK[:2], 2.0, STRIBECK[3])), [], "silent"),
        (_truth(kind="null"), [_named("hysteresis", "j1")], "wrong"),
        (_truth(kind="null"), [], "silent"),
        (_truth(LUGRE, kind="outside"), [_named("function_of_velocity", "j2", unnamed=True)],
         "described"),
        (_truth(LUGRE, kind="outside"), [_named("hysteresis", "j1")], "elsewhere"),
        (_truth(LUGRE, kind="outside"), [_named("hysteresis", "j2")], "wrong"),
    ],
)  # fmt: skip
def test_answers_are_classed_beside_the_truth(truth, named, outcome):
    assert exam.judge(truth, named, falls=True)["outcome"] == outcome


def test_wilsons_interval_holds_its_share():
    low, high = exam.wilson(1, 40)
    assert 0 < low < 1 / 40 < high < 0.13
    assert exam.wilson(0, 10)[0] == pytest.approx(0.0, abs=1e-12)


def test_a_limit_counts_the_upper_end_of_an_interval_and_the_second_z_has_none():
    null = {"kind": "null", "z": 0.0, "z_measured": 0.0, "outcome": "silent", "card": "green"}
    null |= {"said": "", "wrong": "", "described": False, "before": np.nan, "after": np.nan}
    null |= {"sure": 0, "sure_right": 0}
    found = {**null, "kind": "inside", "z": 5.0, "z_measured": 3.0, "outcome": "exact", "said": "x"}
    few, many = (
        exam.check(pd.DataFrame([null] * count + [{**found, "before": 2.0, "after": 1.0}]))
        for count in (10, 100)
    )
    assert [few[0]["holds"], many[0]["holds"]] == [False, True]  # none of 10, none of 100
    by_name = {r["what"]: r for r in many}
    assert by_name["inside, visible: exact or A or B"]["holds"]
    assert by_name["inside, visible in measured motion: exact or A or B"]["of"] == 0
