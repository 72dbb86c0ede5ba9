"""What logs say of a base that floats: every road ends in what an ideal sensor there reads."""

import mujoco
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from identifiability import Log, Robot, analyze
from identifiability.logs.conventions import Conventions

BODY = """<mujoco model="body"><option timestep="0.001" integrator="RK4"/><worldbody>
<body name="body" pos="0 0 1"><freejoint name="free"/>
<inertial pos=".03 -.02 .05" mass="2.5" fullinertia=".03 .04 .02 .002 -.001 .003"/>
<site name="grip" pos=".1 .05 -.1" euler="20 30 40"/></body></worldbody></mujoco>"""
WRENCH = '[[wrench]]\nframe = "grip"\ncolumns = ["fx", "fy", "fz", "mx", "my", "mz"]\n'
PLACE, TILT = np.array([0.04, -0.1, 0.2]), (0.3, -0.2, 0.5)
IMU = f"[imu]\nplace = {PLACE.tolist()}\nrotation = {list(TILT)}\nacc_bias = [0.1, 0, -0.2]\n"


@pytest.fixture(scope="module")
def thrown():
    """A body that a hand moves to and fro at its grip, as MuJoCo simulates it."""
    m = mujoco.MjModel.from_xml_string(BODY)
    d = mujoco.MjData(m)
    rows = []
    f, phase = np.random.default_rng(4).uniform(0.3, 1.5, (2, 6, 3))
    for k in range(6000):
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        here = d.site_xmat[0].reshape(3, 3)
        wave = np.sin(2 * np.pi * (f * d.time + phase)).sum(1)
        wrench = wave * [5, 5, 5, 1, 1, 1]
        turn = d.xmat[1].reshape(3, 3)
        wrench[:3] += here.T @ (-8 * d.qvel[:3] - 40 * (d.qpos[:3] - [0, 0, 1]) + [0, 0, 24.5])
        upright = Rotation.from_matrix(turn).as_rotvec()
        wrench[3:] += here.T @ (turn @ (-0.5 * d.qvel[3:]) - 6 * upright)
        d.qfrc_applied[:] = 0
        force = here @ wrench[:3]
        moment = here @ wrench[3:]
        mujoco.mj_applyFT(m, d, force, moment, d.site_xpos[0], 1, d.qfrc_applied)
        mujoco.mj_forward(m, d)
        if k % 4 == 0:
            acc = turn.T @ (d.qacc[:3] - m.opt.gravity)
            rows.append(np.concatenate([[d.time], d.qpos, d.qvel, acc, d.qacc[3:], wrench]))
        d.qvel += m.opt.timestep * d.qacc  # what is held over a step is what is logged
        mujoco.mj_integratePos(m, d.qpos, d.qvel, m.opt.timestep)
        d.time += m.opt.timestep
    x = np.array(rows)
    parts = {"t": 1, "pos": 3, "quat": 4, "vel": 3, "gyro": 3, "acc": 3, "alpha": 3, "wrench": 6}
    ends = np.cumsum(list(parts.values()))
    return {k: x[:, e - w : e] for (k, w), e in zip(parts.items(), ends, strict=True)}


@pytest.fixture
def body(load_text):
    return load_text(BODY, sidecar=WRENCH)


def table(s, **more):
    """A table of the wrench and of what else is given, (N, k) each, by names of its columns."""
    columns = {"t": s["t"][:, 0]}
    columns |= dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), s["wrench"].T, strict=True))
    for names, x in more.values():
        columns |= dict(zip(names, x.T, strict=True))
    return pd.DataFrame(columns)


def axes(stem, letters="xyz"):
    return [f"{stem}{a}" for a in letters]


def sensor(s):
    return {"a": (axes("base.acc."), s["acc"]), "g": (axes("imu.angular_velocity."), s["gyro"])}


def read(robot, frame):
    return Log.from_frame(frame, "run", Conventions.of(robot))


def roads(s):
    """Ways in which a log may say how the base moved."""
    R = Rotation.from_quat(s["quat"][:, [1, 2, 3, 0]])
    yield "sensor", sensor(s)
    yield "pose", {"p": (axes("base."), s["pos"]), "q": (axes("base.q", "wxyz"), s["quat"])}
    odometry = {
        "p": (axes("odom.pose.position."), s["pos"]),
        "q": (axes("odom.pose.orientation.", "wxyz"), s["quat"]),
        "v": (axes("odom.twist.linear."), R.inv().apply(s["vel"])),
        "w": (axes("odom.twist.angular."), s["gyro"]),
    }
    yield "odometry", odometry
    world = {**odometry, "v": (axes("base.v"), s["vel"]), "w": (axes("base.w"), R.apply(s["gyro"]))}
    yield "motion capture", world


@pytest.mark.parametrize("which", range(4))
def test_every_road_ends_in_what_an_ideal_sensor_reads(which, thrown, body):
    _, columns = list(roads(thrown))[which]
    log = read(body, table(thrown, **columns))
    inner = slice(20, -20)
    assert_allclose(log.base[inner, :3], thrown["acc"][inner], atol=0.1)
    assert_allclose(log.base[inner, 3:6], thrown["gyro"][inner], atol=0.05)
    up = Rotation.from_quat(thrown["quat"][:, [1, 2, 3, 0]]).inv().apply([0, 0, 1.0])
    assert_allclose(log.base[:, 6:9], up, atol=1e-9 if which else 0.1)


def test_a_body_that_is_moved_by_a_hand_tells_its_ten_parameters(thrown, body):
    found = analyze(body, [table(thrown, **sensor(thrown))], "none", replicates=50)
    assert "body weighs 2.5" in found.details
    told = found.to_frame()
    told = told[~told.index.str.startswith("base.imu")]
    assert len(told) == 10
    assert set(told["verdict"]) == {"identifiable"}
    for name, value in zip(told["name"], told["value"], strict=True):
        assert value == pytest.approx(body.nominal[name], rel=0.01, abs=2e-4)


def lever(thrown, place):
    """Return what a sensor at a place measures beside the acceleration of the base, (N, 3)."""
    turning = np.cross(thrown["gyro"], np.cross(thrown["gyro"], place))
    return np.cross(thrown["alpha"], place) + turning


def test_a_sensor_that_is_mounted_elsewhere_says_the_same(thrown, body):
    turn = Rotation.from_euler("xyz", TILT).inv().as_matrix()
    acc = (thrown["acc"] + lever(thrown, PLACE)) @ turn.T + [0.1, 0, -0.2]
    spin = (axes("base.gyro."), thrown["gyro"] @ turn.T)
    frame = table(thrown, a=(axes("base.acc."), acc), g=spin)
    body.path.with_suffix(".toml").write_text(WRENCH + IMU)
    log = read(Robot.load(body.path), frame)
    assert_allclose(log.base[20:-20, :3], thrown["acc"][20:-20], atol=0.05)


def test_a_mounting_that_is_known_roughly_is_corrected_in_the_fit(thrown, body):
    place = np.array([0.05, -0.03, 0.04])
    bias = np.array([0.2, -0.1, 0.15])
    acc = thrown["acc"] + lever(thrown, place) + bias
    frame = table(thrown, a=(axes("base.acc."), acc), g=(axes("base.gyro."), thrown["gyro"]))
    body.path.with_suffix(".toml").write_text(WRENCH + '[imu]\nfit = ["place", "acc_bias"]\n')
    found = analyze(Robot.load(body.path), [frame], "none", replicates=50)
    told = found.to_frame().set_index("name")
    mounting = [f"base.imu_{k}" for k in ("x", "y", "z", "ax", "ay", "az")]
    assert_allclose(told["value"][mounting], [*place, *bias], rtol=0.05)
    own = told.loc[[name for name in told.index if name.startswith("body.")]]
    assert_allclose(own["value"], own["nominal"], rtol=0.03, atol=3e-4)
    (said,) = (hint for hint in found.hints if "top of the sidecar" in hint)
    body.path.with_suffix(".toml").write_text(f"{said.partition('fit again: ')[2]}\n{WRENCH}")
    again = Robot.load(body.path)
    assert again.base.imu.fit == ("place", "acc_bias")
    assert_allclose(again.base.imu.place, place, atol=2e-3)


def test_what_is_missing_or_no_orientation_is_said_in_one_sentence(thrown, body, rejected):
    with rejected(r"does not say how the base moved.*'base.acc.x'.*fixed"):
        read(body, table(thrown))
    with rejected(r"it has .*gyro\.x, gyro\.y, gyro\.z"):
        read(body, table(thrown, g=(axes("base.gyro."), thrown["gyro"])))
    with rejected(r"it has acc\.x, acc\.y, fx"):
        read(body, table(thrown, **sensor(thrown)).drop(columns="base.acc.z"))
    with rejected("lacks the column fz of a measured wrench"):
        read(body, table(thrown, **sensor(thrown)).drop(columns="fz"))
    bad = {"p": (axes("base."), thrown["pos"]), "q": (axes("base.q", "wxyz"), 1.1 * thrown["quat"])}
    with rejected(r"quaternion of the base has norm 1\.1 in data row"):
        read(body, table(thrown, **bad))
    body.path.with_suffix(".toml").write_text('[[contacts]]\nframe = "grip"\nflag = "touch"')
    with rejected("lacks the column 'touch', which says when the contact"):
        read(Robot.load(body.path), table(thrown, **sensor(thrown)))
