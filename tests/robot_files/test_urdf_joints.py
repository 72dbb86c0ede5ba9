"""Laws of reading URDF: joints of every kind and axis, on both roads and back into a file."""

import numpy as np
import pytest

from identifiability.foundation.errors import RobotError
from identifiability.regression.regression import Model
from identifiability.robot import Robot, complete_motion
from identifiability.robot.floating import BASE_JOINTS
from identifiability.simulation import PrescribedMotion, simulate
from identifiability.workflows.export import write_parameters

LINK = """<link name="{0}"><inertial><origin xyz="0.1 0.2 0.05" rpy="0.1 0.2 0.3"/><mass value="2"/>
  <inertia ixx="0.1" iyy="0.12" izz="0.15" ixy="0.01" ixz="-0.02" iyz="0.005"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
  <origin xyz="0.1 0 0.3" rpy="0.2 0.1 0"/><axis xyz="{4}"/>{5}
  <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>"""


DRAG = '<dynamics damping="0.4" friction="0.3"/>'


def chain(first="continuous", axis="0 0 -1", more="", links=""):
    links = LINK.format("arm") + (links or LINK.format("tip"))
    return (
        f'<robot name="chain"><link name="ground"/>{links}'
        + JOINT.format("j1", first, "ground", "arm", axis, DRAG)
        + JOINT.format("j2", "revolute", "arm", "tip", "0 1 0", "") + more + "</robot>"
    )  # fmt: skip


AXES = ("0 0 -1", "0 -1 0", "-1 0 0", "1 2 3", "4.9e-12 0 1", "0 0 2", "0 0 1")


@pytest.mark.parametrize("axis", AXES)
def test_a_continuous_joint_turns_about_any_axis_on_both_roads(axis, load_text, tmp_path):
    rng = np.random.default_rng(1)
    robot = load_text(chain(axis=axis), "urdf")
    q, dq, ddq = rng.uniform(-3, 3, (3, 30, 2))
    q[:, 0] *= 5.0  # many turns
    motion = complete_motion(robot, np.arange(30.0), q, dq, ddq)
    model = Model.of("rigid_body", "viscous_friction", "coulomb_friction")
    phi = np.array([robot.nominal[p.name] for p in model.parameters(robot)])
    torque = model.regressor(robot, motion) @ phi
    move = PrescribedMotion(motion.t, q, dq, ddq)
    np.testing.assert_allclose(simulate(robot, move).tau, torque, atol=1e-9 * np.abs(torque).max())
    bounded = load_text(chain("revolute", axis), "urdf")
    other = complete_motion(bounded, np.arange(30.0), q, dq, ddq)
    np.testing.assert_allclose(model.regressor(bounded, other) @ phi, torque, atol=1e-11)
    written = write_parameters(robot, {"arm.mx": 0.5}, tmp_path / "copy.urdf").robot
    assert Robot.load(written).nominal["arm.mx"] == pytest.approx(0.5, abs=1e-12)


def test_a_continuous_joint_takes_its_home_from_the_sidecar(load_text):
    robot = load_text(chain(), "urdf", "[home]\nj1 = 2.0")
    assert robot.actuated_positions(robot.home[None])[0] == pytest.approx([2.0, 0.0])


@pytest.mark.parametrize("factor", [-1.0, 0.5])
def test_what_mimics_a_continuous_joint_follows_it_over_many_turns(factor, load_text):
    hand = LINK.format("tip") + LINK.format("pad")
    mimic = f'<mimic joint="j1" multiplier="{factor}"/>'
    more = JOINT.format("j3", "continuous", "tip", "pad", "1 0 0", mimic)
    robot = load_text(chain(more=more, links=hand), "urdf")
    q = np.linspace(-20, 20, 40)[:, None] * [1.0, 0.1]
    motion = complete_motion(robot, np.arange(40.0), q, q, q)
    assert len(motion) == 40
    np.testing.assert_allclose(robot.dof_position(motion.q, "j3"), factor * q[:, 0], atol=1e-12)


def test_mimicking_a_fixed_joint_is_standing_still_and_a_fixed_joint_cannot_mimic(load_text):
    hand = LINK.format("tip") + LINK.format("pad") + LINK.format("plate")
    more = JOINT.format("j3", "revolute", "tip", "pad", "1 0 0", '<mimic joint="j4" offset="0.5"/>')
    more += JOINT.format("j4", "fixed", "tip", "plate", "1 0 0", '<mimic joint="j1"/>')
    robot = load_text(chain(more=more, links=hand), "urdf")
    assert robot.joints == ("j1", "j2")
    assert robot.locked == {"j3": 0.5}


def test_a_link_that_floats_is_a_base_that_does(load_text):
    robot = load_text(chain("floating"), "urdf")
    assert robot.joints == (*BASE_JOINTS, "j2")
    assert robot.base.title == "j1"
    assert load_text(chain("fixed"), "urdf").joints == ("j2",)


def test_a_planar_joint_is_told_and_the_advice_helps(load_text):
    with pytest.raises(RobotError, match=r"'j1' is of a type \(Planar\).* use revolute"):
        load_text(chain("planar"), "urdf")
    assert load_text(chain("prismatic"), "urdf").joints == ("j1", "j2")
