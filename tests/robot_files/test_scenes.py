"""Scenes: what no actuated joint reaches is left out, and MuJoCo's own arrays are read by it."""

import mujoco
import numpy as np
import pandas as pd
import pytest
from made_robots import LINKS, MOTORS, arm

from identifiability.effects.nominal import rigid_torque
from identifiability.foundation.errors import RobotError
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.robot import complete_motion
from identifiability.simulation.mujoco_robot import MujocoRobot
from identifiability.workflows.inspect import inspect

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
    plain = load_text(scene("", after=""))
    bare = torque(plain, q)
    robot = load_text(scene(after=after))
    assert robot.outside == ("cup", "door")
    assert robot.joints == plain.joints == ("shoulder", "elbow")
    assert robot.bodies == plain.bodies
    if "qpos" in after:
        np.testing.assert_allclose(robot.home, [0.7, -0.7])
    np.testing.assert_allclose(torque(robot, q), bare, atol=1e-14)
    other = MujocoRobot(robot).inverse_dynamics(q, np.ones_like(q), -np.ones_like(q))
    np.testing.assert_allclose(torque(robot, q), other.tau, atol=1e-10)
    roles = {j.name: j.role for j in inspect(robot).joints}
    assert (roles["cup"], roles["elbow"]) == ("left out", "actuated")
    assert robot.identity["left_out"] == ["cup", "door"]


def test_what_an_actuator_an_equality_or_the_sidecar_reaches_stays(load_text):
    weld = '<equality><weld body1="cup" body2="link2"/></equality>'
    held = load_text(scene(CUP, MOTORS, weld))  # by the hand: a loop
    assert held.outside == ()
    assert len(held.passive) == 6
    driven = MOTORS.replace("</actuator>", '<motor joint="turn"/></actuator>')
    with pytest.raises(RobotError, match="1 joints have no actuator"):
        load_text(scene(DOOR, driven))
    locks = 'locked = ["hinge", "turn"]'
    assert load_text(scene(DOOR, MOTORS), sidecar=locks).outside == ()
    alone = load_text(scene(DOOR, driven), sidecar='actuated = ["shoulder", "elbow"]')
    assert alone.outside == ("door",)


def test_without_actuators_only_what_cannot_be_driven_is_left_out(load_text):
    robot = load_text(scene(CUP + DOOR, ""))
    assert robot.outside == ("cup",)
    assert robot.joints == ("hinge", "turn", "shoulder", "elbow")


@pytest.fixture(scope="module")
def arrays():
    """What MuJoCo keeps while the motors push the arm about, columns by array and index."""
    text = scene().replace("<worldbody>", '<option timestep="0.002"/><worldbody>', 1)
    m = mujoco.MjModel.from_xml_string(text)
    d, rows = mujoco.MjData(m), []
    words = ("qpos", "qvel", "qacc", "qfrc_actuator", "actuator_force", "ctrl")
    for k in range(200):
        d.ctrl[:] = 3 * np.sin(0.05 * k), 6 * np.cos(0.03 * k)  # the second beyond its range
        mujoco.mj_step(m, d)
        mujoco.mj_forward(m, d)
        rows.append([d.time, *(x for w in words for x in getattr(d, w))])
    names = ["time", *(f"{w}[{k}]" for w in words for k in range(len(getattr(d, w))))]
    return pd.DataFrame(rows, columns=names)


def without(frame, *words):
    return frame.drop(columns=[c for c in frame if c.partition("[")[0] in words])


@pytest.mark.parametrize(
    "made",
    [
        lambda f: f,
        lambda f: without(f, "qfrc_actuator", "actuator_force"),
        lambda f: f.rename(columns=lambda c: f"data.{c}" if "[" in c else c),
        lambda f: without(f, "qfrc_actuator").rename(
            columns={"qpos[9]": "shoulder.qpos", "actuator_force[0]": "actuator_force/m1"}
        ),
    ],
)
def test_arrays_of_mujoco_are_read_by_the_file_s_addresses_and_gears(made, arrays, load_text):
    log = Log.from_frame(made(arrays), "log", Conventions.of(load_text(scene())))
    for channel, word, first in (("q", "qpos", 9), ("dq", "qvel", 8), ("tau", "qfrc_actuator", 8)):
        ours = arrays[[f"{word}[{first}]", f"{word}[{first + 1}]"]]
        np.testing.assert_allclose(getattr(log, channel), ours, rtol=1e-12, atol=1e-12)


def test_the_sum_of_two_motors_is_no_motor_s_force(arrays, load_text):
    two = GEARED.replace("</actuator>", '<general joint="elbow"/></actuator>')
    known = Conventions.of(load_text(scene(actuator=two)))
    assert Log.from_frame(arrays, "log", known).joints == ("shoulder", "elbow")
    log = Log.from_frame(without(arrays, "qfrc_actuator"), "log", known)
    assert log.unmeasured.all(0).tolist() == [False, True]
