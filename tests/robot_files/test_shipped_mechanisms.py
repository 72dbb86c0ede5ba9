"""Laws of the shipped mechanisms: MuJoCo's torque, counts by energy, values that come back.

They stand beside `ROBOTS` of the other tests, which run every law on every robot.
"""

import importlib.util
import re
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identifiability import (
    Regression,
    Robot,
    estimate,
    find_base_parameters,
    gather_information,
    prepare_log,
)
from identifiability.regression.regression import Model
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate

REFERENCE = Path(__file__).parent.parent / "models_reference" / "base_parameter_counts.toml"
LONG = pytest.mark.everything
MECHANISMS = ("delta", "3-rrr", "palletizer", "six-actuators")
EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def within_limits(robot, count=20, seed=0):
    """Random states within the limits of the sidecar."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(*robot.limits.T, (count, len(robot.joints)))
    return q[np.argsort(q[:, 0])], *rng.normal(size=(2, *q.shape))


@pytest.mark.parametrize("name", MECHANISMS[:3])
def test_a_mechanism_is_what_mujoco_makes_of_it(name, agrees):
    robot = Robot.load(name)
    middle, half = robot.limits.mean(1), 0.5 * np.ptp(robot.limits, axis=1)
    from_home = half - np.abs(middle - robot.actuated_positions(robot.home[None])[0])
    assert (from_home > 0.6 * half).all()
    agrees(robot.path.read_text(), spread=from_home)


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_count_of_base_parameters_is_that_of_the_energy_and_of_thought(name):
    spec = importlib.util.spec_from_file_location(
        "energy_rank", REFERENCE.with_name("energy_rank.py")
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    robot = Robot.load(name)
    count = tomllib.loads(REFERENCE.read_text())[name]["count"]
    assert find_base_parameters(robot, Model.of("rigid_body")).rank == count
    rank, gap = module.energy_rank(robot.path, samples=400)
    assert (rank, gap > 1e6) == (count, True)


@pytest.mark.parametrize("name", MECHANISMS)
def test_no_pose_within_the_limits_is_near_singular_or_out_of_reach(name):
    robot = Robot.load(name)
    q, v, a = within_limits(robot, 500, seed=1)
    motion = complete_motion(robot, np.arange(500) * 1.0, q, v, a)
    assert len(motion) == 500
    assert motion.condition < 50
    for trajectory in "abc":
        move = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 150)
        assert (move.q > robot.limits[:, 0]).all()
        assert (move.q < robot.limits[:, 1]).all()


@pytest.mark.parametrize(
    "name", [*MECHANISMS[::2], *(pytest.param(m, marks=LONG) for m in MECHANISMS[1::2])]
)
def test_the_files_values_come_back_from_torque_without_noise(name):
    robot, model = Robot.load(name), Model.of(*EFFECTS)
    kept = find_base_parameters(robot, model).kept
    move = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    samples = prepare_log(robot, simulate(robot, move))
    regression = Regression(robot, model, (samples,), kept)
    fit = estimate(gather_information(regression), "ols")
    assert fit.determined.all()
    truth = np.array([robot.nominal.get(p.name, 0.0) for p in model.parameters(robot)])
    torque = model.regressor(robot, samples.motion)
    expected = torque @ truth
    np.testing.assert_allclose(
        torque[:, :, list(kept)] @ fit.value, expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )
    found = dict(zip([model.parameters(robot)[k].name for k in kept], fit.value, strict=True))
    friction = {n: x for n, x in found.items() if n.endswith((".Fv", ".Fc"))}
    assert len(friction) == 2 * len(robot.joints)
    for key, value in friction.items():
        assert value == pytest.approx(robot.nominal[key], rel=1e-7), key


def test_a_palletizer_is_as_far_from_singular_at_every_angle_of_its_turntable():
    robot = Robot.load("palletizer")
    (pose, *_), yaw = within_limits(robot, 1, seed=3), np.linspace(-np.pi, np.pi, 73)
    q = np.repeat(pose, 73, 0)
    q[:, 0] = yaw
    v, a = np.random.default_rng(4).normal(size=(2, 1, 4)).repeat(73, 1)
    turned = complete_motion(robot, yaw, q, v, a)
    one = complete_motion(robot, yaw[:1], q[:1], v[:1], a[:1])
    assert turned.singular == 0
    assert turned.condition == pytest.approx(one.condition, rel=1e-6)
    model = Model.of("rigid_body")
    phi = np.array([robot.nominal[p.name] for p in model.parameters(robot)])
    torque = model.regressor(robot, turned) @ phi
    np.testing.assert_allclose(torque, torque[:1].repeat(73, 0), atol=1e-9 * np.abs(torque).max())


def six_rods(robot):
    """The Delta as it is built: six rods on balls, and a platform that is free to turn."""
    text = robot.path.read_text()
    _, mass, inertia = re.search(r'(0.4 0 0)" mass="(\S+)" fullinertia="([^"]+)"', text).groups()
    half = " ".join(str(0.5 * float(x)) for x in inertia.split())
    sides = {"left": 0.1, "right": -0.1}

    def rods(match):
        leg = match[1]
        return "".join(
            f"""<body name="{side}{leg}" pos="0.3 {y} 0">
            <inertial pos="0.4 0 0" mass="{0.5 * float(mass)}" fullinertia="{half}"/>
            <joint name="{side}{leg}_y" axis="0 1 0"/><joint name="{side}{leg}_z" axis="0 0 1"/>
            <site name="tip_{side}{leg}" pos="0.8 0 0"/></body>"""
            for side, y in sides.items()
        )

    text = re.sub(r'(?s)<body name="forearm(\d)".*?</body>', rods, text)
    sites, connects = "", ""
    for leg in (1, 2, 3):
        angle = 2 * np.pi * (leg - 1) / 3
        for side, y in sides.items():
            x, z = (
                0.05 * np.cos(angle) - y * np.sin(angle),
                0.05 * np.sin(angle) + y * np.cos(angle),
            )
            sites += f'<site name="ball_{side}{leg}" pos="{x} {z} 0"/>'
            connects += f'<connect site1="tip_{side}{leg}" site2="ball_{side}{leg}"/>'
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    turning = "".join(f'<joint name="turn_{k}" axis="{axis}"/>' for k, axis in axes.items())
    text = text.replace('<site name="platform1"', f'{turning}{sites}<site name="platform1"')
    text = re.sub(r"(?s)<equality>.*</equality>", f"<equality>{connects}</equality>", text)
    arm, elbow, *_, height = robot.home[[0, 1, -1]]
    pose = " ".join(3 * [f"{arm} {elbow} 0 {elbow} 0"])
    return re.sub(r'qpos="[^"]*"', f'qpos="{pose} 0 0 {height} 0 0 0"', text)


def test_one_forearm_of_a_delta_is_its_two_rods(agrees):
    robot = Robot.load("delta")
    q, v, a = within_limits(robot, 30, seed=5)
    model = Model.of(*EFFECTS)
    torque = []
    built = agrees(six_rods(robot), spread=0.3)
    for one in (robot, built):
        motion = complete_motion(one, np.arange(30.0), q, v, a)
        assert len(motion) == 30
        phi = np.array([one.nominal.get(p.name, 0.0) for p in model.parameters(one)])
        torque.append(model.regressor(one, motion) @ phi)
    assert len(built.dependent) == 18
    np.testing.assert_allclose(*torque, rtol=0, atol=1e-9 * np.abs(torque[0]).max())


def test_six_actuators_move_as_mujoco_makes_them():
    """Lengths, their derivatives and the forces along them from MuJoCo's platform alone."""
    robot = Robot.load("six-actuators")
    m = mujoco.MjModel.from_xml_path(str(robot.path))
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    m.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    d, rng, rows = mujoco.MjData(m), np.random.default_rng(6), []
    for _ in range(20):
        start, v, a = rng.uniform(-0.08, 0.08, 6), *rng.normal(size=(2, 6))

        def slope(q, m=m, d=d):
            d.qpos[:] = q
            mujoco.mj_fwdPosition(m, d)
            return np.array(d.ten_J).reshape(6, 6)

        h, weights = 4e-3, (4 / 5, -1 / 5, 4 / 105, -1 / 280)
        bent = sum(w * (slope(start + k * h * v) - slope(start - k * h * v)) / h
                   for k, w in enumerate(weights, 1)) @ v  # fmt: skip
        J = slope(start)
        length = np.array(d.ten_length)
        d.qvel[:], d.qacc[:] = v, a
        mujoco.mj_inverse(m, d)
        force = d.qfrc_inverse + J.T @ (m.tendon_frictionloss * np.sign(J @ v))
        rows.append([length, J @ v, J @ a + bent, np.linalg.solve(J.T, force)])
    q, dq, ddq, expected = np.array(rows).transpose(1, 0, 2)
    motion = complete_motion(robot, np.arange(20.0), q, dq, ddq)
    model = Model.of(*EFFECTS)
    phi = np.array([robot.nominal.get(p.name, 0.0) for p in model.parameters(robot)])
    torque, size = model.regressor(robot, motion) @ phi, np.abs(expected).max()
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-9 * size)
