"""Laws of forward simulation where axes, motors and couplings mix joints: torque gives motion."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_less

from identifiability import Model, Robot
from identifiability.robot import complete_motion
from identifiability.robot.description import Transmission
from identifiability.simulation.forces import both_directions
from identifiability.simulation.forward import ForwardRobot
from identifiability.simulation.mujoco_robot import MujocoRobot

from .made_robots import CABLE, CLOSURES, LOOP_CABLE, arm, parallelogram

AXIS = """[[axes]]
name = "cable"
joints = {shoulder = 1.3, elbow = -0.5}
[nominal]
"cable.Fv" = 1.1
"cable.Fc" = 0.9
"elbow.Fc+" = 0.6
"elbow.Fc-" = 0.2
"cable.Ia" = 0.3
"cable.K" = 9
"shoulder.off" = 0.4
"""
BODY = """<body name="hand" pos="0.3 0 0"><joint name="w" axis="0 0 1" ref="0.3"/>
  <inertial mass="0.5" pos="0.1 0.02 0" diaginertia="0.002 0.003 0.004"/></body>"""
FOLLOWS = """[[couplings]]
joint = "w"
of = "elbow"
polynomial = [0.1, 0.5, 0.2]
terms = {shoulder = [0, -0.3]}
"""
EFFECTS = ("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia",
           "joint_stiffness", "passive_joint_friction", "torque_offset")  # fmt: skip
STEP, STEPS = 2e-3, 60


def follows_its_torque(robot, spread=0.3):
    """Whether torque of a motion, by the regressor, makes the forward robot move so."""
    rng = np.random.default_rng(0)
    n = len(robot.joints)
    t = STEP * (np.arange(STEPS * 20 + 1) / 20)
    start = robot.actuated_positions(robot.home[None])[0]
    v, a = rng.uniform(0.7, 1.3, (2, n)) * spread * rng.choice([-1, 1], (2, n))
    q = start + 0.1 * a + v * t[:, None] + 2 * a * t[:, None] ** 2
    dq = v + 4 * a * t[:, None]
    ddq = np.tile(4 * a, (len(t), 1))
    motion = complete_motion(robot, t, q, dq, ddq)
    assert len(motion) == len(t)
    model = Model.of(*EFFECTS)
    given = both_directions(robot.nominal)
    phi = np.array([given.get(p.name, 0.0) for p in model.parameters(robot)])
    tau = model.regressor(robot, motion) @ phi
    # Torque is held for a step: what moves it there on the mean is its mean over the step.
    held = np.array([tau[20 * k : 20 * k + 21].mean(0) for k in range(STEPS)])
    moved = ForwardRobot(robot, given).run(q[:1], dq[:1], held[None], STEP)[0]
    distance = np.abs(q[-1] - q[0])
    error = np.abs(moved - q[20::20])[-1]
    assert_array_less(error, 2e-3 * distance.max())
    without = {k: 0.0 if k.startswith(("cable.", "m2.", "leg")) else x for k, x in given.items()}
    other = ForwardRobot(robot, without).run(q[:1], dq[:1], held[None], STEP)[0]
    return np.abs(other - q[20::20])[-1].max() / distance.max()


@pytest.mark.parametrize(
    "text, sidecar",
    [
        (arm(after=CABLE), None),
        (arm(), AXIS),
        (parallelogram(CLOSURES["site on the root"]).replace(
            "</mujoco>", LOOP_CABLE), None),
    ],
)  # fmt: skip
def test_an_axis_that_mixes_joints_moves_as_its_torque_says(text, sidecar, load_text):
    assert follows_its_torque(load_text(text, sidecar=sidecar)) > 0.02


def test_motors_that_mix_joints_move_as_their_torque_says(load_text):
    robot = load_text(arm())
    gear = Transmission(("m1", "m2"), np.array([[1, 0], [0.6, 1.0]]), np.ones(2), np.zeros(2))
    nominal = {**robot.nominal, "m2.Fv": 1.5, "m2.Fc": 0.8, "m2.Ia": 0.4}
    assert follows_its_torque(replace(robot, transmission=gear, nominal=nominal)) > 0.02


def test_jaws_of_which_only_the_rotors_of_mixing_motors_weigh_stick_as_they_should():
    follows_its_torque(Robot.load("dvrk-psm"))


def test_legs_that_are_tendons_drive_a_platform(load_text):
    """Whatever the file's motors are: torque is that of the legs."""
    text = Robot.load("six-actuators").path.read_text()
    motors = '<default class="leg">', '<motor gear="7" ctrlrange="-1 1"/><default class="leg">'
    assert follows_its_torque(load_text(text.replace(*motors)), spread=0.02) > 0.02


def test_a_wheel_that_its_file_balances_moves_as_an_unbalanced_one(load_text):
    text = """<mujoco><worldbody><body name="wheel"><joint name="axle" axis="0 1 0"/>
      <inertial mass="2" pos="0 0 0" diaginertia="0.1 0.1 0.1"/></body></worldbody>
      <actuator><motor joint="axle"/></actuator></mujoco>"""
    follows_its_torque(load_text(text, sidecar='nominal = {"wheel.mx" = 0.2, "axle.K" = 0.01}'))


def test_a_coupling_that_mujoco_does_not_have_is_refused(load_text, rejected):
    robot = load_text(arm(inside=BODY), sidecar=FOLLOWS)
    with rejected("'w' follows several others"):
        ForwardRobot(robot, {})


def test_a_joint_that_sticks_creeps_by_less_than_an_encoder_sees(two_link):
    """MuJoCo's own friction is soft: as hard as it can be, a joint at .9 of its level stands."""
    q = np.array([[0.3, 0.4]])
    levels = np.array([60.0, 20.0])
    names = dict(zip((f"{j}.Fc" for j in two_link.joints), levels.tolist(), strict=True))
    hold = MujocoRobot(two_link).inverse_dynamics(q, 0 * q, 0 * q).tau + 0.9 * levels
    way = ForwardRobot(two_link, names).run(q, 0 * q, np.repeat(hold[:, None], 100, axis=1), 5e-3)[
        0
    ]
    assert np.abs(way[-1] - way[0]).max() < 2 * np.pi / 2**17
