"""Scenes: what no actuated joint reaches is left out, and MuJoCo's own arrays are read by it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import inspect
from identifiability.effects.nominal import rigid_torque
from identifiability.robot import complete_motion
from identifiability.simulation.mujoco_robot import MujocoRobot

from .made_robots import LINKS, MOTORS, arm

CUP = '<body name="cup" pos="1 0 1"><freejoint name="loose"/><geom size=".1" mass="2"/></body>'
DOOR = (
    '<body name="door"><joint name="hinge" axis="0 0 1" damping="1"/><geom size="1"/>'
    '<body name="knob"><joint name="turn"/><geom size=".1"/></body></body>'
)
GEARED = MOTORS.replace('joint="shoulder"', 'name="m1" joint="shoulder" gear="2"').replace(
    'joint="elbow"', 'name="m2" joint="elbow" gear="-0.5" ctrllimited="true" ctrlrange="-3 4"'
)


def scene(objects=CUP + DOOR, actuator=GEARED, after=""):
    """The two-link arm behind objects, so that their numbers come first."""
    text = arm(worldbody=LINKS, actuator=actuator, after=after)
    return text.replace("<worldbody>", f"<worldbody>{objects}")


def torque(robot, q):
    v = np.ones_like(q)
    return rigid_torque(robot, complete_motion(robot, 0.1 * np.arange(len(q)), q, v, -v))


@pytest.mark.parametrize(
    "after",
    [
        "",
        '<equality><joint joint1="hinge" polycoef=".1 0 0 0 0"/></equality>'
        '<contact><exclude body1="cup" body2="link1"/></contact>'
        '<sensor><jointpos joint="hinge"/></sensor>'
        '<keyframe><key name="home" qpos="1 0 1 1 0 0 0 .3 .2 .7 -.7" ctrl="0 1"/></keyframe>',
    ],
)
def test_what_no_motor_reaches_is_left_out_on_both_roads_and_said(after, load_text):
    q = np.random.default_rng(0).uniform(-1, 1, (5, 2))
    plain = load_text(scene(""))
    bare = torque(plain, q)
    robot = load_text(scene(after=after))
    assert robot.outside == ("cup", "door")
    assert robot.joints == plain.joints == ("shoulder", "elbow")
    assert robot.bodies == plain.bodies
    if "qpos" in after:
        assert_allclose(robot.home, [0.7, -0.7])
    assert_allclose(torque(robot, q), bare, atol=1e-14)
    other = MujocoRobot(robot).inverse_dynamics(q, np.ones_like(q), -np.ones_like(q))
    assert_allclose(torque(robot, q), other.tau, atol=1e-10)
    roles = {j.name: j.role for j in inspect(robot).joints}
    assert (roles["cup"], roles["elbow"]) == ("left out", "actuated")
    assert robot.identity["left_out"] == ["cup", "door"]


def test_what_an_actuator_an_equality_or_the_sidecar_reaches_stays(load_text, rejected):
    weld = '<equality><weld body1="cup" body2="link2"/></equality>'
    held = load_text(scene(CUP, MOTORS, weld))  # by the hand: a loop
    assert held.outside == ()
    assert len(held.passive) == 6
    driven = MOTORS.replace("</actuator>", '<motor joint="turn"/></actuator>')
    with rejected("1 joints have no actuator"):
        load_text(scene(DOOR, driven))
    assert load_text(scene(DOOR, MOTORS), sidecar='locked = ["hinge", "turn"]').outside == ()
    alone = load_text(scene(DOOR, driven), sidecar='actuated = ["shoulder", "elbow"]')
    assert alone.outside == ("door",)


def test_without_actuators_only_what_cannot_be_driven_is_left_out(load_text):
    robot = load_text(scene(CUP + DOOR, ""))
    assert robot.outside == ("cup",)
    assert robot.joints == ("hinge", "turn", "shoulder", "elbow")


def test_motors_have_the_gears_of_the_file_where_they_are_alone_at_a_joint(load_text):
    assert load_text(scene()).gears == {"shoulder": 2.0, "elbow": -0.5}
    two = GEARED.replace("</actuator>", '<general joint="elbow"/></actuator>')
    assert load_text(scene(actuator=two)).gears == {"shoulder": 2.0}
