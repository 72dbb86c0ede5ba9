"""A robot in the other format is the same robot: closed chains, couplings and axes too."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot, simulate
from identifiability.regression.structure import random_motion
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion
from identifiability.workflows.export import write_parameters

from ..conftest import write_robot
from ..marks import everything
from ..roads import nominal_torque

ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="base" quat="0 1 0 0" pos="1 2 3">
  <body name="link1"><inertial mass="4" pos="0.3 0.02 0.01" diaginertia="0.03 0.1 0.11"/>
    <joint name="shoulder" axis="0 -1 0" pos="0.05 0.02 0.1" stiffness="30" springref="0.3"/>
    <body name="link2" pos="0.5 0 0" euler="0.1 0.2 0.3"><joint name="elbow" axis="0 -1 0"/>
      <inertial mass="2" pos="0.2 0 0.03" fullinertia="0.02 0.05 0.06 0.002 0.001 -0.003"/>
      <body name="wrist" pos="0.2 0 0"><joint name="w" axis="0 1 0"/>
        <inertial mass="1" pos="0.1 0 0" diaginertia="0.01 0.02 0.03"/>
        <body name="tip" pos="0.1 0 0"><joint name="p" type="slide" axis="0 0 1"/>
          <inertial mass="0.5" pos="0.1 0 0" diaginertia="0.01 0.02 0.03"/></body></body>
  </body></body></body></worldbody>{after}
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator></mujoco>"""
COUPLED = """
[[couplings]]
joint = "w"
of = "elbow"
polynomial = [0.1, 0.5, 0.2]
terms = {shoulder = [0, -0.3, 0, 0.1]}
[[couplings]]
joint = "p"
terms = {w = [0, 0.2], shoulder = [0.05, 0, 0.1]}
"""
TENDON = """<tendon><fixed name="rope" stiffness="20" springlength="0.3" damping="2">
  <joint joint="elbow" coef="2"/><joint joint="shoulder" coef="-0.6"/></fixed></tendon>"""
LOCKED = """
locked = {w = 0.2, p = 0.01}
[limits]
w = {v = 1}

"""


def load(name, folder):
    """A shipped robot, or the arm above with something in it."""
    made = {
        "coupled": (ARM.format(after=""), COUPLED),
        "locked": (ARM.format(after=""), LOCKED),
        "tendon": (ARM.format(after=TENDON), "locked = ['w', 'p']\n"),
        "more equations": (Robot.load("five-bar").path.read_text(), ""),
    }
    if name not in made:
        return Robot.load(name)
    text, sidecar = made[name]
    return write_robot(folder, text, sidecar=sidecar)


CASES = ("3-rps", "five-bar", "coupled", "locked", "tendon")
LONG = ("3-rrr", "palletizer", "six-ups", "delta", "six-dof-arm", "two-link", "more equations")


@pytest.mark.parametrize("name", [*CASES, *(everything(n) for n in LONG)])
def test_there_and_back_it_is_the_same_robot(name, tmp_path):
    robot = load(name, tmp_path)
    wide = random_motion(robot, np.random.default_rng(0), 20)
    home = robot.actuated_positions(robot.home[None])
    q = home + 0.2 * (wide.actuated_q - home)  # MuJoCo walks from each to the next
    motion = complete_motion(robot, wide.t, q, wide.actuated_v, wide.actuated_a)
    tau = nominal_torque(robot, motion)
    suffixes = (".urdf", ".xml") if robot.mjcf else (".xml", ".urdf")
    copy = robot
    for suffix in suffixes:
        path = tmp_path / f"copy{suffix[1:]}{suffix}"
        write_parameters(copy, dict(copy.nominal), path)
        copy = Robot.load(path)
        assert copy.joints == robot.joints
        assert {*copy.bodies, *copy.passive} == {*robot.bodies, *robot.passive}
        assert np.array_equal(copy.limits, robot.limits)
        where = {n: robot.home[j.iq] for n, j in robot.tree.single.items()}
        assert {n: copy.home[j.iq] for n, j in copy.tree.single.items()} == where
        for parameter, value in robot.nominal.items():
            assert copy.nominal.get(parameter, 0.0) == pytest.approx(value, rel=1e-9, abs=1e-9)
        actuated = (motion.actuated_q, motion.actuated_v, motion.actuated_a)
        again = complete_motion(copy, motion.t, *actuated)
        size = np.abs(tau).max()
        assert_allclose(nominal_torque(copy, again), tau, rtol=0, atol=1e-9 * size)
        if name not in ("locked", "tendon"):  # MuJoCo reads the written files by itself
            seen = simulate(copy, PrescribedMotion(motion.t, *actuated)).tau
            assert_allclose(seen, tau, rtol=0, atol=1e-9 * size)
