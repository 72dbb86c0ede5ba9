"""Generated Python closes loops; CasADi is large, so make check-all runs this."""

import importlib.util
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identifiability import Robot
from identifiability.foundation.errors import IdentifiabilityError, RobotError
from identifiability.regression.regression import Model
from identifiability.regression.structure import random_motion
from identifiability.workflows.export.code import write_code

PLATFORM = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="platform" pos="0 0 0.5"><freejoint name="float"/>{top}
  <inertial mass="3" pos="0.02 0.01 0.05" fullinertia="0.05 0.06 0.09 0.002 0.001 -0.003"/>
  </body>{ground}</worldbody><tendon>{legs}</tendon><actuator>{motors}</actuator>
  <keyframe><key name="home" qpos="0 0 0.5 1 0 0 0"/></keyframe></mujoco>"""


def on_tendons():
    """A free platform on six legs that are only forces."""
    parts = dict.fromkeys(("top", "ground", "legs", "motors"), "")
    for k in range(6):
        low, high = 2 * np.pi * (k // 2) / 3 + (-0.3, 0.3)[k % 2], 2 * np.pi * ((k + 1) // 2) / 3
        x, y = 0.6 * np.cos(low), 0.6 * np.sin(low)
        parts["ground"] += f'<site name="a{k}" pos="{x} {y} 0.02"/>'
        x, y = 0.3 * np.cos(high - 1.2), 0.3 * np.sin(high - 1.2)
        parts["top"] += f'<site name="b{k}" pos="{x} {y} {0.01 * k}"/>'
        sites = f'<site site="a{k}"/><site site="b{k}"/>'
        parts["legs"] += f'<spatial name="leg{k}" range="0.55 0.65">{sites}</spatial>'
        parts["motors"] += f'<motor tendon="leg{k}"/>'
    return PLATFORM.format(**parts)


def with_ball():
    """The shipped 3-RPS with a ball joint where its file has three hinges."""
    rps = Robot.load("3-rps")
    three = re.compile(r'<joint name="ball1_x".*?<joint name="ball1_z"[^>]*/>', re.DOTALL)
    text = three.sub('<joint name="ball1" type="ball"/>', rps.path.read_text())
    x, y, z, w = Rotation.from_euler("XYZ", rps.home[2:5]).as_quat()
    home = " ".join(map(str, [*rps.home[:2], w, x, y, z, *rps.home[5:]]))
    return re.sub('qpos="[^"]*"', f'qpos="{home}"', text)


def with_more_equations():
    """The shipped five-bar without its sidecar: one of its three equations follows from two."""
    return Robot.load("five-bar").path.read_text()


def in_a_turning_plane():
    """The shipped palletizer, whose tool-side parallelogram the sidecar closes in its plane."""
    text = Robot.load("palletizer").path.read_text()
    return re.sub(r'<connect name="upper_parallelogram"[^>]*/>', "", text)


#: All loops again, for a sidecar's are the only ones.
PLANE = """[[loops]]
body1 = "rod"
point1 = [1.2, 0, 0]
body2 = "forearm"
point2 = [-0.35, 0, 0]
[[loops]]
body1 = "lower_bar"
point1 = [1.2, 0, 0]
body2 = "plate"
point2 = [-0.3, 0, 0]
[[loops]]
body1 = "upper_bar"
point1 = [1.3, -0.14, 0]
body2 = "wrist"
point2 = [0, 0, 0.25]
axes = ["x", "z"]
frame = "table"
"""

COUPLED = """actuated = ["joint_1", "joint_2", "joint_3", "joint_4"]
[[couplings]]
joint = "joint_5"
of = "joint_4"
polynomial = [0.1, -0.5, 0.2]
terms = {joint_2 = [0, 0.3]}
[[couplings]]
joint = "joint_6"
of = "joint_5"
polynomial = [0, 2]
[[axes]]
name = "wrist"
joints = {joint_5 = 1, joint_3 = -2}
rest = 0.2
"""

MADE = {
    "on tendons": (on_tendons, ""),
    "with a ball": (with_ball, None),
    "with more equations": (with_more_equations, ""),
    "in a turning plane": (in_a_turning_plane, PLANE),
}


def load(name, folder):
    """A robot: shipped, made, or the arm with joints that follow others."""
    if name == "coupled":
        path = folder / "robot.urdf"
        path.write_text(Robot.load("six-dof-arm").path.read_text())
        path.with_suffix(".toml").write_text(COUPLED)
        return Robot.load(path)
    if name not in MADE:
        return Robot.load(name)
    text, sidecar = MADE[name]
    path = folder / "robot.xml"
    path.write_text(text())
    beside = Robot.load("3-rps").sidecar.read_text() if sidecar is None else sidecar
    if beside:
        path.with_suffix(".toml").write_text(beside)
    return Robot.load(path)


def run(path):
    spec = importlib.util.spec_from_file_location("generated", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.everything
@pytest.mark.parametrize("name", ["3-rps", "six-ups", "five-bar", "delta", "coupled", *MADE])
def test_generated_python_closes_the_loops_and_is_the_prediction(name, tmp_path, coded):
    """Every effect that code can hold, at once, against regressor times parameters."""
    robot, rng = load(name, tmp_path), np.random.default_rng(0)
    assert robot.closed
    model = Model.of(*coded)
    names = [p.name for p in model.parameters(robot)]
    values = {n: robot.nominal.get(n, 0.0) + rng.uniform(0.01, 0.1) for n in names}
    m = random_motion(robot, rng, 60)
    assert len(m) > 50
    tau = model.regressor(robot, m) @ np.array([values[n] for n in names])
    code = run(write_code(robot, values, model.shapes(robot), tmp_path / "code.py", "python"))
    assert (robot.joints, robot.passive) == (code.JOINTS, code.PASSIVE)
    size = np.abs(tau).max()
    found = code.inverse_dynamics(m.actuated_q, m.actuated_v, m.actuated_a)
    np.testing.assert_allclose(found, tau, rtol=0, atol=1e-10 * size)
    positions = code.close_loops(m.actuated_q)
    for k in (0, 7):  # one sample, computed with plain numbers, from where it was before
        one = (m.actuated_q[k], m.actuated_v[k], m.actuated_a[k])
        seeded = code.inverse_dynamics(*one, seed=positions[k] + 1e-3)
        np.testing.assert_allclose(seeded, tau[k], rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(code.close_loops(one[0]), positions[k], rtol=0, atol=1e-9)


@pytest.mark.everything
def test_where_the_loops_do_not_close_there_is_no_torque(tmp_path):
    robot = Robot.load("3-rps")
    code = run(write_code(robot, dict(robot.nominal), {}, tmp_path / "code.py", "python"))
    q = np.array([[0.7, 0.7, 0.7], [0.7, 0.7, 7.0]])
    tau = code.inverse_dynamics(q, 0 * q, 0 * q)
    assert np.isfinite(tau[0]).all()
    assert np.isnan(tau[1]).all()


@pytest.mark.everything
def test_c_is_for_trees_and_a_delay_has_no_code(tmp_path):
    robot = Robot.load("3-rps")
    with pytest.raises(RobotError, match=r"3-rps is a closed chain: export it as Python"):
        write_code(robot, {}, {}, tmp_path / "code.c", "c")
    with pytest.raises(IdentifiabilityError, match=r"time_delay \(slider1\.delay\)"):
        write_code(robot, {"slider1.delay": 0.01}, {}, tmp_path / "code.py", "python")
    assert not list(tmp_path.iterdir())
