"""Torque columns as they were measured: gains, ratios, signs, currents, sensors behind gears."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log, Model
from identifiability.logs.conventions import Conventions

#: Two hinges and nothing else.
ARM = """
<mujoco><worldbody><body name="base"><body name="upper"><joint name="a" axis="0 1 0"/>
  <inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.05 0.05"/>
  <body name="fore" pos="0.5 0 0"><joint name="b" axis="0 1 0" armature="0.2"/>
    <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.02 0.02"/></body></body></body></worldbody>
<actuator><motor joint="a"/><motor joint="b"/></actuator></mujoco>
"""


@pytest.fixture
def load(load_text):
    return lambda sidecar="": load_text(ARM, sidecar=sidecar)


def table(kind="tau"):
    t = 0.01 * np.arange(200)
    return pd.DataFrame(
        {"t": t, "a.q": np.sin(t), "b.q": np.cos(t), f"a.{kind}": 3 + t, f"b.{kind}": 5 - t}
    )


GIVEN = table().filter(like="tau")


def torques(frame, robot, **others):
    known = Conventions(**{**vars(Conventions.of(robot)), **others})
    log = Log.from_frame(frame, "log", known)
    return log.tau, log.notes


def test_torque_is_the_value_times_gain_ratio_and_sign(load):
    robot = load("[torque]\ngain = {a = 0.5}\nratio = {a = 100, b = 50}\nsign = {b = -1}\n")
    tau, notes = torques(table(), robot)
    assert_allclose(tau, GIVEN * [0.5 * 100, -50])
    assert notes == ("torques were multiplied by their gain, ratio and sign (a: 50, b: -50)",)
    assert_allclose(torques(table(), load("[torque]\ngain = 0.001\n"))[0], 1e-3 * GIVEN)
    more = table().assign(**{"a2.torque [%]": 1.0, "a.current": 1.0})
    same, (spare, unread) = torques(more, load())
    assert unread.numbers == {"columns": ["'a2.torque [%]'"]}
    assert spare == "a.current is not used, as the log has torque of its joint"
    assert_array_equal(same, GIVEN)
    assert torques(table(), load())[1] == ()


def test_currents_stand_for_torques_where_their_gain_is_known(load, rejected):
    robot = load("[torque]\ngain = {a = 11, b = 7}\n")
    tau, notes = torques(table("current"), robot)
    assert_allclose(tau, GIVEN * [11, 7])
    assert notes == ("torques are currents times their gain, ratio and sign (a: 11, b: 7)",)
    mixed, notes = torques(
        table().rename(columns={"a.tau": "a.tau [%]", "b.tau": "b.current"}), robot
    )
    assert_allclose(mixed, tau)
    assert notes[-1] == "torques were multiplied by their gain, ratio and sign (a: 11, b: 7)"
    both = table().assign(**{"a.current": 1.0, "b.current": 1.0})
    assert_allclose(torques(both, load())[0], GIVEN)
    with rejected(r"currents and no torques of b\. .*gain = {b = …}"):
        torques(table("current"), load("[torque]\ngain = {a = 11}\n"))


def test_coupled_motors_may_mix_torque_and_current_on_positions_of_joints(load, rejected):
    motors = '[transmission]\nmotors = ["m", "n"]\ncoupling = [[1, 0], [0, 1]]\n'
    robot = load(f"{motors}[torque]\ngain = {{n = 7}}\n")
    frame = table().rename(columns={"a.tau": "m.tau", "b.tau": "n.current"})
    assert_allclose(torques(frame, robot)[0], GIVEN * [1, 7])
    with rejected(r"has no column n\.tau\. (?!.*lock)"):
        torques(frame.drop(columns="n.current"), robot)


def test_torque_of_the_motor_needs_the_ratio_of_its_gear(load, rejected):
    with rejected(r"torque of b was measured at the motor.*ratio = {b = …}"):
        torques(table(), load('[torque]\nside = "motor"\nratio = {a = 100}\n'))
    tau, _ = torques(table(), load('[torque]\nside = "motor"\nratio = 100\n'))
    assert_allclose(tau, 100 * GIVEN)


def test_neither_rotor_nor_friction_is_seen_by_a_sensor_behind_the_gear(load):
    model = Model.of("rigid_body", "viscous_friction", "actuator_inertia")
    robot = load('[torque]\nside = {a = "link"}\n')
    plain = {p.name for p in model.parameters(load())}
    assert plain - {p.name for p in model.parameters(robot)} == {"a.Fv", "a.Ia"}
    _, notes = torques(table(), robot)
    assert "torque of a was measured behind the gear" in notes[0]


def test_columns_of_motor_and_link_are_told_apart(load, rejected):
    robot = load('[torque]\nside = {b = "both"}\nratio = 100\n')
    frame = table().rename(columns={"b.tau": "link_torque_b", "b.q": "link_position_b"})
    frame = frame.assign(motor_torque_b=0.25, motor_position_b=100.0)
    log = Log.from_frame(frame, "log", Conventions.of(robot))
    links, drives = log.split_sensors(["b"])
    assert_allclose(links.tau[:, 1], table()["b.tau"])
    assert_allclose(drives.tau[:, 1], 25 - table()["b.tau"])
    assert_allclose(drives.q[:, 1], 1.0)
    assert drives.unmeasured[:, 0].all()
    assert not drives.unmeasured[:, 1].any()
    with rejected(r"has no b\.tau_m.*columns="):
        torques(table(), robot)
