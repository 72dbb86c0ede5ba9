"""Tiny robots whose equations of motion are written out by hand, and a motion with a gap."""

import numpy as np
import pytest

from identifiability import Model
from identifiability.robot import complete_motion

from ...conftest import write_robot

G = 9.81

#: A hinge that lifts a rail, and a slide along it. Home is not zero.
POLAR = """
<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body name="base">
  <body name="rail">
    <joint name="lift" type="hinge" axis="0 -1 0" range="-1.5 2.1" damping="0.7"
           frictionloss="1.3" armature="0.11"/>
    <inertial pos="0.2 0 0.05" mass="3" fullinertia="0.02 0.06 0.07 0 0 0"/>
    <body name="sled" pos="0.4 0 0">
      <joint name="reach" type="slide" axis="1 0 0" damping="5" frictionloss="2" armature="0.8"/>
      <inertial pos="0.1 0 -0.03" mass="2" fullinertia="0.01 0.02 0.02 0 0 0"/>
    </body>
  </body>
</body></worldbody>
<actuator><motor joint="lift"/><motor joint="reach"/></actuator>
<keyframe><key name="home" qpos="0.3 -0.15"/></keyframe></mujoco>
"""

#: Two pendulums side by side; the motor of the second mixes both joints.
PAIR = """
<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body name="base">
  <body name="left"><joint name="a" axis="0 -1 0"/>
    <inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.05 0.05"/></body>
  <body name="right" pos="0 1 0"><joint name="b" axis="0 -1 0"/>
    <inertial pos="0.5 0 0" mass="1.5" diaginertia="0.01 0.04 0.04"/></body>
</body></worldbody>
<actuator><motor joint="a"/><motor joint="b"/></actuator>
<keyframe><key name="home" qpos="0.2 -0.4"/></keyframe></mujoco>
"""
COUPLED = """
inertia_parts = ["Jr", "Js"]
[transmission]
motors = ["m1", "m2"]
coupling = [[1, 0], [2, -1]]
ratio = [10, -20]
offset = [0.1, 0.3]
[limits]
a = {q = [-2, 2], v = 4}
b = {q = [-1, 1], v = 3}
"""

#: One motor; a hinge and a slide follow it by polynomials.
GEAR = """
<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81"/><worldbody><body name="base">
  <body name="crank"><joint name="turn" axis="0 -1 0"/>
    <inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.05 0.05"/></body>
  <body name="follower" pos="0 1 0"><joint name="swing" axis="0 -1 0"/>
    <inertial pos="0.5 0 0" mass="1.5" diaginertia="0.01 0.04 0.04"/></body>
  <body name="weight" pos="0 2 0"><joint name="rise" type="slide" axis="0 0 1"/>
    <inertial pos="0 0 0" mass="4" diaginertia="0.01 0.01 0.01"/></body>
</body></worldbody>
<equality><joint joint1="swing" joint2="turn" polycoef="0.1 -2 0.3 0 0"/>
  <joint joint1="rise" joint2="turn" polycoef="0 0.5 0.2 0 0"/></equality>
<actuator><motor joint="turn"/></actuator>
<keyframe><key name="home" qpos="0 0.1 0"/></keyframe></mujoco>
"""

session_fixture = pytest.fixture(scope="session")


@session_fixture
def make(tmp_path_factory):
    """A function (MJCF text, sidecar text) -> Robot."""
    return lambda text, sidecar="": write_robot(
        tmp_path_factory.mktemp("tiny"), text, sidecar=sidecar
    )


@session_fixture
def polar(make):
    return make(POLAR)


@session_fixture
def pair(make):
    return make(PAIR, COUPLED)


@session_fixture
def gear(make):
    return make(GEAR)


def swing(t, joints):
    """Position, velocity and acceleration (N, joints) with reversals, and standing still once."""
    w = 3.0 + np.arange(joints)
    phase = 0.4 * np.arange(joints)
    q = 0.25 * np.sin(np.outer(t, w) + phase) + 0.1
    v = 0.25 * w * np.cos(np.outer(t, w) + phase)
    a = -0.25 * w**2 * np.sin(np.outer(t, w) + phase)
    return q, v, a


def move(robot, t):
    """Return a motion; at the first sample all joints stand still."""
    q, v, a = swing(t, len(robot.joints))
    v[0] = 0.0
    return complete_motion(robot, t, q, v, a)


@pytest.fixture
def m(polar, request):
    """The motion of the hinge and the slide at the times T of a file of tests."""
    return move(polar, request.module.T)


def columns(robot, motion, text):
    """Return {parameter name: (unit, column (N, n))} of an effect."""
    model = Model.of(text)
    W = model.regressor(robot, motion)
    parameters = model.parameters(robot)
    assert {(p.group,) for p in parameters} == {model.names}
    return {p.name: (p.unit, W[:, :, k]) for k, p in enumerate(parameters)}


def polar_torque(q, v, a):
    """Torque of the hinge [N·m] and force of the slide [N] by Lagrange, for the masses of POLAR.

    A mass m at (x, z) of its link's frame and a moment of inertia I about its own centre.
    """
    (th, r), (w, rate), (wd, acc) = q.T, v.T, a.T
    torque = (3 * (0.2**2 + 0.05**2) + 0.06) * wd
    torque += 3 * G * (0.2 * np.cos(th) - 0.05 * np.sin(th))
    rho = 0.5 + r
    z = -0.03
    torque += (2 * (rho**2 + z**2) + 0.02) * wd + 4 * rho * rate * w - 2 * z * acc
    torque += 2 * G * (rho * np.cos(th) - z * np.sin(th))
    force = 2 * (acc - rho * w**2 - z * wd) + 2 * G * np.sin(th)
    return np.stack([torque, force], 1)


def pair_torque(q, a):
    """Torque of both pendulums [N·m]."""
    inertia = np.array([2 * 0.3**2 + 0.05, 1.5 * 0.5**2 + 0.04])
    return inertia * a + G * np.array([2 * 0.3, 1.5 * 0.5]) * np.cos(q)


def gear_torque(q, v, a):
    """Torque of the gear's motor [N·m] by virtual work."""
    q = q[:, 0]
    v = v[:, 0]
    a = a[:, 0]
    swing = 0.1 - 2 * q + 0.3 * q**2
    ratio = -2 + 0.6 * q
    lift = 0.5 + 0.4 * q
    swing_a = ratio * a + 0.6 * v**2
    rise_a = lift * a + 0.4 * v**2
    turn = (2 * 0.3**2 + 0.05) * a + 2 * 0.3 * G * np.cos(q)
    follow = (1.5 * 0.5**2 + 0.04) * swing_a + 1.5 * 0.5 * G * np.cos(swing)
    return (turn + ratio * follow + lift * 4 * (rise_a + G))[:, None]
