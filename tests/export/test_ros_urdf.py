"""What URDFs of ROS have beside joints, links and masses does not confuse an export."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot, simulate
from identifiability.simulation import PrescribedMotion
from identifiability.workflows.export import write_parameters

from ..conftest import write_robot

TRANSMISSION = """<transmission name="t{0}"><joint name="{0}">
  <hardwareInterface>a</hardwareInterface><hardwareInterface>b</hardwareInterface></joint>
  </transmission>"""


def ros_arm(folder):
    """The shipped arm with transmissions behind its joints, and an origin that is stated twice."""
    arm = Robot.load("six-dof-arm")
    text = arm.path.read_text()
    more = "".join(TRANSMISSION.format(joint) for joint in arm.joints)
    text = text.replace("</robot>", more + "</robot>")
    top = ET.fromstring(text)
    joint = next(j for j in top.findall("joint") if j.get("name") == "joint_3")
    ET.SubElement(joint, "origin", xyz="9 9 9", rpy="1 1 1")
    return write_robot(folder, ET.tostring(top, "unicode"), "urdf", arm.sidecar.read_text())


def test_friction_is_written_to_the_joint_and_not_to_its_transmission(tmp_path):
    robot = ros_arm(tmp_path)
    values = dict(robot.nominal) | {f"{j}.Fv": 3.0 + k for k, j in enumerate(robot.joints)}
    values |= {f"{j}.{kind}": 2.0 + k for k, j in enumerate(robot.joints)
               for kind in ("Fc", "Fc+", "Fc-")}  # fmt: skip
    written = write_parameters(robot, values, tmp_path / "fitted.urdf")
    copy = Robot.load(written.robot)
    for name, value in values.items():
        assert copy.nominal[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name
    top = ET.parse(written.robot).getroot()
    assert not list(top.iterfind("transmission/joint/dynamics"))
    assert len(list(top.iterfind("transmission/joint/hardwareInterface"))) == 12


def test_what_is_stated_twice_is_written_once_and_mujoco_reads_it(tmp_path):
    robot = ros_arm(tmp_path)
    written = write_parameters(robot, dict(robot.nominal), tmp_path / "fitted.urdf")
    assert mujoco.MjModel.from_xml_path(str(written.robot)).njnt == 6
    move = PrescribedMotion(np.arange(30.0), *np.random.default_rng(0).normal(size=(3, 30, 6)))
    found, expected = (simulate(r, move).tau for r in (robot, Robot.load("six-dof-arm")))
    assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
