"""Laws of the inspection: it says what the robot file says, and what was put into the log."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from identifiability import Log, Robot, inspect, simulate
from identifiability.foundation.findings import of_key
from identifiability.simulation import PrescribedMotion, random_trajectory
from identifiability.workflows.inspect import template_frame

GRIPPER = """<mujoco><compiler angle="radian"/><worldbody><body name="arm">
  <joint name="lift" axis="0 1 0" range="-1 1"/>
  <inertial mass="2" pos="0.3 0 0" diaginertia="0.1 0.2 0.2"/>
  <body name="a" pos="0.6 0 0"><joint name="finger1" type="slide" axis="0 1 0"/>
    <inertial mass="0.2" pos="0 0 0" diaginertia="0.01 0.01 0.01"/></body>
  <body name="b" pos="0.6 0 0"><joint name="finger2" type="slide" axis="0 1 0"/>
    <inertial mass="0.2" pos="0 0 0" diaginertia="0.01 0.01 0.01"/></body>
  </body></worldbody>
  <equality><joint joint1="finger2" joint2="finger1" polycoef="0.01 -2 0 0 0"/></equality>
  <actuator><motor joint="lift"/><motor joint="finger1"/></actuator></mujoco>"""


@pytest.fixture
def gripper(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(GRIPPER)
    return path


@pytest.fixture(scope="module")
def run(two_link):
    path = random_trajectory(two_link, np.random.default_rng(3), samples=1200)
    return simulate(two_link, PrescribedMotion.of(path, 1200), derivatives=False)


def look(log, **spoilt):
    """The inspection of a log whose columns are replaced."""
    frame = log.to_frame()
    for column, values in spoilt.items():
        frame[column.replace("__", ".")] = values
    return inspect("two-link", frame)


def test_every_joint_has_its_part_and_the_columns_follow_from_it(gripper):
    found = inspect(gripper)
    assert {j.name: j.role for j in found.joints} == {
        "lift": "actuated", "finger1": "actuated", "finger2": "coupled"}  # fmt: skip
    assert found.joints[2].remark == "follows finger1"
    assert found.columns == ("t", "lift.q", "lift.tau", "finger1.q", "finger1.tau")
    assert (found.joints[0].low, found.joints[0].high) == (-1.0, 1.0)
    locked = inspect(Robot.load(gripper, lock=["finger1=0.02"]))
    assert {j.name: j.remark for j in locked.joints if j.role == "locked"} == {
        "finger1": "held at 0.02", "finger2": "held at -0.03"}  # fmt: skip
    assert locked.columns == ("t", "lift.q", "lift.tau")
    assert inspect("hobby-arm").columns[1:3] == (
        "base_yaw.q",
        "base_yaw.cmd",
    )  # servos make its torque


@pytest.mark.parametrize("counted", ["lift finger1 finger2", "lift finger1", "finger1 lift"])
def test_numbers_count_the_joints_that_follow_the_commands(gripper, counted):
    motors = '<position joint="finger1" kp="9"/><position joint="lift" kp="9"/>'
    gripper.write_text(re.sub("<motor.*/>", motors, GRIPPER))
    t = np.arange(100) / 50
    q = {"finger1": t % 0.3, "lift": t % 0.7, "finger2": -t}
    table = {f"action[{k}]": q[joint] + 0.01 for k, joint in enumerate(("finger1", "lift"))}
    table |= {f"q[{k}]": q[joint] for k, joint in enumerate(counted.split())}
    (log,) = inspect(gripper, pd.DataFrame(table | {"t": t})).records
    assert_allclose(log.q, np.stack([q["finger1"], q["lift"]], axis=1))


@pytest.mark.parametrize("name", ["3-rps", "five-bar", "two-link"])
def test_base_parameters_are_those_that_analyze_fits(name):
    found = inspect(name, model=["rigid_body", "viscous_friction"])
    assert len(found.parameters_frame()) == found.base.rank
    first = found.base.names[0]
    known = found.parameters_frame().set_index("name")
    assert known.loc[first, "grouping"] == found.base.labels[0]
    assert {j.name for j in found.joints if j.role == "passive"} == set(found.robot.passive)
    assert str(found.base.rank) in found.details
    assert ('class="robots"' in found._repr_html_()) is not found.robot.closed


def test_columns_of_a_template_are_those_that_a_log_is_read_by(tmp_path, gripper):
    found = inspect(gripper)
    path = tmp_path / "log.csv"
    template_frame(found.robot).to_csv(path, index=False)
    row = pd.read_csv(path)
    frame = pd.concat([row] * 30, ignore_index=True).assign(t=0.01 * np.arange(30.0))
    log = Log.from_frame(frame)
    assert log.joints == found.robot.joints
    assert log.q[0] == pytest.approx(found.robot.actuated_positions(found.robot.home[None])[0])


def test_a_good_log_is_told_as_it_is(run):
    found = look(run)
    (record,) = found.records
    assert not found.hints
    assert "masses of the robot file" in found.details
    assert record.clock["samples"] == 1200
    assert record.clock["rate"] == pytest.approx(1 / (run.t[1] - run.t[0]))
    assert record.clock["gaps"] == 0
    for k, joint in enumerate(record.joints.itertuples()):
        assert (joint.low, joint.high) == (run.q[:, k].min(), run.q[:, k].max())
        assert 0.1 < joint.bandwidth < 5.0
        fastest = np.abs(np.gradient(run.q[:, k], run.t)).max()
        assert joint.speed == pytest.approx(fastest, rel=0.05)


def test_gaps_are_those_that_were_put_in(run):
    found = inspect("two-link", run.to_frame().drop(index=range(600, 605)))
    (record,) = found.records
    assert (record.clock["gaps"], record.clock["lost"]) == (1, 5)
    assert record.clock["longest"] == pytest.approx(6 * (run.t[1] - run.t[0]))


def test_what_cannot_be_prepared_or_read_is_refused(run, rejected):
    shoulder, elbow = np.degrees(run.q).T
    with rejected("degrees"):
        look(run, shoulder__q=shoulder, elbow__q=elbow)
    shoulder, elbow = np.radians(run.q).T
    assert "Hardly: " in look(run, shoulder__q=shoulder, elbow__q=elbow).details
    torqueless = run.to_frame().drop(columns=["shoulder.tau", "elbow.tau"])
    with rejected("torque"):
        inspect("two-link", torqueless)


def test_the_result_is_a_table_json_and_a_page(run, tmp_path):
    found = look(run)
    text = found.to_json(tmp_path / "x.json").read_text()
    content = json.loads(text, parse_constant=pytest.fail)
    assert content["logs"][0]["joints"][1]["torque_unit"] == "N·m"
    assert content["parameters"][0].keys() == {"name", "unit", "grouping"}
    html = found.write_report(tmp_path / "x.html").read_text()
    assert html.count("data-trace=") == 4
    assert ">nan<" not in html


def test_effects_of_the_sidecar_that_another_model_has_not_are_said(run, tmp_path):
    beside = tmp_path / "pushed.toml"
    beside.write_text('effects = ["constant_force@elbow"]')
    robot = Robot.load("two-link", sidecar=beside)
    for model, count in ((None, 0), (["rigid_body"], 1)):
        assert len(of_key(inspect(robot, run, model=model).hints, "effects")) == count
