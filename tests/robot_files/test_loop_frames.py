"""Loops whose directions turn with a body: a pin in a slot, a plane that a turntable turns."""

import re

import numpy as np
import pytest
from made_loops import BAR, turntable

from identifiability.foundation.errors import RobotError
from identifiability.regression.regression import Model
from identifiability.robot import Robot, complete_motion
from identifiability.robot.closure import loop_bias, loop_equations
from identifiability.simulation.forward import ForwardRobot

#: A crank whose pin slides in the slot of a lever, on a turntable; with a light block in the slot
#: it is a chain of hinges, slides and a whole closure.
SLOT = """<mujoco><compiler angle="radian"/><worldbody><body name="table" euler="0.2 -0.3 0.1">
  <joint name="yaw" axis="0 0 1"/>{bar5}
  <body name="crank" pos="0.1 0 0"><joint name="drive" axis="0 -1 0"/>{bar1}
    <site name="pin" pos="0.2 0.03 0"/></body>
  <body name="lever" pos="0.7 0 0.1" euler="0.1 0 0">
    <joint name="pivot" axis="0 -1 0" damping="0.4"/>{bar2}{block}</body></body></worldbody>
  <equality>{closure}</equality>
  <actuator><motor joint="yaw"/><motor joint="drive"/></actuator>
  <keyframe><key name="home" qpos="{home}"/></keyframe></mujoco>"""
BLOCK = """<body name="block"><joint name="slide" type="slide" axis="1 0 0"/>
  <joint name="across" type="slide" axis="0 1 0"/><site name="hole"/>
  <inertial mass="1e-11" pos="0 0 0" diaginertia="1e-11 1e-11 1e-11"/></body>"""
SIDECAR = """[[loops]]
name = "slot"
body1 = "crank"
point1 = [0.2, 0.03, 0]
body2 = "lever"
axes = ["z"]
frame = "lever"
[home]
yaw = 0.3
drive = 0.9
pivot = {pivot}
"""


IN_THE_TABLE = """[[loops]]
name = "toe"
body1 = "rocker"
point1 = [-0.4, 0.2, 0]
body2 = "table"
point2 = [0.7, 0, 0]
axes = ["x", "z"]
frame = "table"
"""


def slot(*, block: bool, pivot=0.0, slide=(0.0, 0.0)):
    bars = {"bar5": BAR.format(5, 0.1), "bar1": BAR.format(1, 0.2), "bar2": BAR.format(2, -0.3)}
    places = f"0.3 0.9 {pivot}" + (" {} {}".format(*slide) if block else "")
    closure = '<connect site1="pin" site2="hole"/>' if block else ""
    return SLOT.format(block=BLOCK if block else "", closure=closure, home=places, **bars)


def test_a_pin_in_a_slot_is_what_a_block_in_it_is(load_text, agrees, tmp_path):
    with pytest.raises(RobotError, match="pivot = ") as told:
        load_text(slot(block=False), sidecar=SIDECAR.format(pivot=0.0))
    pivot = float(re.search(r"such as pivot = (\S+?)\.$", str(told.value))[1])
    sidecar = SIDECAR.format(pivot=pivot)
    robot = agrees(slot(block=False), sidecar=sidecar, spread=np.array([np.pi, 0.4]))
    assert robot.passive == ("pivot",)
    assert robot.equations == 1
    loop, tree = robot.loops[0], robot.tree
    frames = tree.frames(robot.home[None], [loop.first.joint, loop.second.joint])
    apart = tree.world_point(frames, loop.first) - tree.world_point(frames, loop.second)
    axes = tree.world_axes(frames, loop.frame.joint, loop.frame.rotation)[:, :, 0]
    slide, across, off = axes @ apart[:, 0]
    assert abs(off) < 1e-4 < abs(across)
    (tmp_path / "block.xml").write_text(slot(block=True, pivot=pivot, slide=(slide, across)))
    with_block = Robot.load(tmp_path / "block.xml")
    model = Model.of("rigid_body", "passive_joint_friction")
    q, v, a = np.random.default_rng(0).normal(size=(3, 20, 2))
    q = np.stack([3 * q[:, 0], 0.9 + 0.4 * np.tanh(q[:, 1])], 1)
    torque, moved = [], []
    for one in (robot, with_block):
        motion = complete_motion(one, np.arange(20.0), q, v, a)
        phi = np.array([one.nominal[p.name] for p in model.parameters(one)])
        torque.append(model.regressor(one, motion) @ phi)
        at = one.dof_index("pivot")
        moved.append(np.stack([x[:, at] for x in (motion.q, motion.v, motion.a)]))
    np.testing.assert_allclose(*torque, atol=1e-8)
    np.testing.assert_allclose(*moved, atol=1e-8)
    with pytest.raises(RobotError, match="leaves a direction free, as a slot does"):
        ForwardRobot(robot, {})


def test_equations_and_bias_are_derivatives_of_what_is_seen_from_the_body(load_text):
    robot = load_text(turntable(""), sidecar=IN_THE_TABLE)
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=(2, 8, robot.nv))
    h = 1e-4

    def moved(step):
        return q + step * v  # hinges alone

    errors = [loop_equations(robot, moved(k * h))[0] for k in (-2, -1, 1, 2)]
    slope = (errors[0] - 8 * errors[1] + 8 * errors[2] - errors[3]) / (12 * h)
    J = loop_equations(robot, q)[1]
    np.testing.assert_allclose(slope, np.einsum("mvn,nv->mn", J, v), atol=1e-9)
    rates = [
        np.einsum("mvn,nv->mn", loop_equations(robot, moved(k * h))[1], v) for k in (-2, -1, 1, 2)
    ]
    bent = (rates[0] - 8 * rates[1] + 8 * rates[2] - rates[3]) / (12 * h)
    np.testing.assert_allclose(bent.T, loop_bias(robot, q, v), atol=1e-8)


def test_a_plane_may_turn_with_the_table(agrees, tmp_path):
    """The points are 0.2 m apart across the plane, in which alone they must meet."""
    (tmp_path / "whole.xml").write_text(turntable(base='euler="0.4 -0.7 0.2"'))
    whole = Robot.load(tmp_path / "whole.xml")
    robot = agrees(
        turntable("", base='euler="0.4 -0.7 0.2"'), sidecar=IN_THE_TABLE,
        spread=np.array([np.pi, 0.4]),
    )  # fmt: skip
    assert robot.equations == len(robot.dependent) == 2
    q, v, a = np.random.default_rng(2).normal(size=(3, 20, 2))
    q = np.stack([3 * q[:, 0], 0.7 + 0.4 * np.tanh(q[:, 1])], 1)
    ours, theirs = (complete_motion(r, np.arange(20.0), q, v, a) for r in (robot, whole))
    for what in ("q", "v", "a"):
        np.testing.assert_allclose(getattr(ours, what), getattr(theirs, what), atol=1e-9)
    assert ours.condition < 20
    push = (q[:1], v[:1], np.full((1, 10, 2), 5.0), 0.01)
    moved, expected = (ForwardRobot(r, {}).run(*push) for r in (robot, whole))
    assert np.abs(moved - q[0]).max() > 0.05
    np.testing.assert_allclose(moved, expected, atol=1e-6)


def test_a_frame_that_is_not_there_is_refused(load_text):
    with pytest.raises(RobotError, match=r"names 'tabel', .* did you mean 'table'"):
        load_text(turntable(""), sidecar=IN_THE_TABLE.replace('frame = "table"', 'frame = "tabel"'))
