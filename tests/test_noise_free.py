"""Logs without noise: no effect is named, and values agree with the truth to their digits."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.random import default_rng

from identifiability import Log, Robot, analyze, diagnose, simulate
from identifiability.simulation import PrescribedMotion, random_trajectory

from .marks import everything

LINK = """<link name="{}"><inertial><origin xyz="{} 0 {}"/><mass value="{}"/>
<inertia ixx="0.004" iyy="{}" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/>
<origin xyz="{} 0 0"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="60" velocity="6"/></joint>"""
ARM = "".join(
    (
        '<robot name="arm"><link name="base"/>',
        LINK.format("upper", 0.15, 0.0, 2.0, 0.02),
        LINK.format("fore", 0.12, 0.02, 1.0, 0.019),
        JOINT.format("shoulder", "base", "upper", 0.0),
        JOINT.format("elbow", "upper", "fore", 0.3),
        "</robot>",
    )
)
#: Friction and rotors that the robot file does not state.
ADDED = {"Fv": np.array([0.3, 0.2]), "Fc": np.array([0.4, 0.25]), "Ia": np.array([0.05, 0.03])}


def move(robot, seed, rate, period):
    """Return times, positions, velocities and accelerations of a random motion of nine seconds."""
    trajectory = random_trajectory(robot, default_rng(seed), period=period)
    t = np.arange(int(9 * rate)) / rate
    return t, *trajectory.motion(t)


def simulated_torque(robot, t, q, dq, ddq):
    return simulate(robot, PrescribedMotion(t, q, dq, ddq)).tau


def rigid_torque(robot, t, q, dq, ddq):
    """Return the torque by recursive Newton-Euler, with friction and rotors: no MuJoCo."""
    model = pin.buildModelFromUrdf(str(robot.path))
    data = model.createData()
    rigid = [pin.rnea(model, data, *rows) for rows in zip(q, dq, ddq, strict=True)]
    friction = ADDED["Fv"] * dq + ADDED["Fc"] * np.sign(dq)
    return np.array(rigid) + friction + ADDED["Ia"] * ddq


def store(x, kind):
    """Return numbers as a file keeps them: all digits, single precision, or six digits."""
    if kind == "float32":
        return x.astype(np.float32).astype(float)
    if kind == "six digits":
        digits = np.vectorize(lambda value: float(f"{value:.6g}"))
        return digits(x)
    return x


def make_logs(robot, torque, noise=0.0, kind="", rate=100, period=7.5, derivatives=True):
    """Return three logs, of which the last one is to be held out."""
    rng = default_rng(7)
    logs = []
    for seed in (1, 2, 3):
        t, *motion = move(robot, seed, rate, period)
        tau = torque(robot, t, *motion)
        tau = store(tau + noise * rng.standard_normal(tau.shape), kind)
        q, dq, ddq = (store(x, kind) for x in motion)
        log = Log(f"motion {seed}", robot.joints, t, q, tau, dq, ddq, str(seed))
        logs.append(log if derivatives else replace(log, dq=None, ddq=None))
    return logs


def true_values(structure, submodel):
    """Return the values (k,) of a model's parameters."""
    true = dict(zip(structure.columns, structure.nominal, strict=True))
    if structure.robot.path.name == "arm.urdf":
        joints = structure.robot.joints
        own = {f"{j}.{kind}": x[k] for kind, x in ADDED.items() for k, j in enumerate(joints)}
        true |= {name: value for name, value in own.items() if name in true}
    base = structure.G @ np.array([true[name] for name in structure.columns])
    return np.linalg.lstsq(submodel.M, base - submodel.fixed, rcond=None)[0]


def check_values(found, digits):
    """Values that are sure agree with the truth, and intervals hold as often as they say."""
    model = found.full
    true = true_values(found.structure, model.submodel)
    used = np.linalg.pinv(model.submodel.M) @ (model.physical.base - model.submodel.fixed)
    inside = []
    for verdict, value, real in zip(model.verdicts, true, used, strict=True):
        low, high = verdict.data_interval95
        inside.append(low <= value <= high)
        if model.physical_used:
            assert abs(real - value) <= high - low, verdict.name
        if verdict.sure:
            assert verdict.value == pytest.approx(value, rel=digits, abs=1e-6), verdict.name
            assert real == pytest.approx(value, rel=digits, abs=1e-6), verdict.name
    # Fewer would be as rare as one in a thousand of 95 %.
    assert np.mean(inside) >= 0.95 - 3.1 * np.sqrt(0.95 * 0.05 / len(inside))


PREPARED = [
    ("two-link", {"kind": "float32"}, 1e-6),
    ("five-bar", {"kind": "six digits"}, 0.01),
    ("six-dof-arm", {"noise": 1e-7}, 1e-4),
    ("scara", {"kind": "float32"}, 1e-4),
    ("two-link", {"derivatives": False}, 1e-5),
    everything("3-rps", {}, 1e-3),
    everything("two-link", {"derivatives": False, "rate": 1000}, 1e-6),
]


def analyzed(name, torque=simulated_torque, **how):
    """Return the analysis of three logs without noise, of which no effect is missing."""
    robot = Robot.load(name)
    logs = make_logs(robot, torque, **how)
    found = analyze(robot, logs[:2], logs[2:], replicates=0)
    assert found.missing.named == ()
    return found


@pytest.mark.parametrize("name, how, digits", PREPARED)
def test_rounding_is_no_effect(name, how, digits):
    found = analyzed(name, **how)
    # The 3-RPS has bodies at the edge of what can exist.
    assert found.full.physical_used or name == "3-rps"
    check_values(found, digits)


@pytest.mark.parametrize("how", [{"kind": "float32"}, {"derivatives": False}])
def test_rounding_is_no_diagnosis(how, two_link):
    logs = make_logs(two_link, simulated_torque, **how)
    found = diagnose(two_link, logs[:2], logs[2:], quick=True)
    assert found.effects == ()
    assert not any("farther from the model" in hint for hint in found.hints)


@pytest.mark.parametrize("how", [{"noise": 1e-9}, {"kind": "float32"}])
def test_rounding_is_no_effect_in_torque_of_another_simulator(tmp_path, how):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    found = analyzed(path, rigid_torque, **how)
    check_values(found, 1e-6)


def test_intervals_hold_what_a_low_pass_leaves_of_a_fast_motion():
    """The low-pass errs at the ends of a log, alike in all samples: scores show too little."""
    found = analyzed("two-link", period=1.5, derivatives=False)
    check_values(found, 1e-3)
    for model in found.models:
        true = true_values(found.structure, model.submodel)
        for verdict, value in zip(model.verdicts, true, strict=True):
            low, high = verdict.data_interval95
            middle = 0.5 * (low + high)
            assert abs(value - middle) <= high - low, verdict.name
