"""The robot file as a prior: it pulls what the data leave open; an impossible one is refused."""

import re

import numpy as np
import pytest

from identifiability import Robot, analyze
from identifiability.foundation.errors import IdentifiabilityError, RobotError
from identifiability.physical.pseudo_inertia import to_matrix


@pytest.fixture
def log(simulated):
    return simulated("two-link", "a", 0)


def test_an_infeasible_cad_file_is_refused_with_the_body_named(simulated, tmp_path):
    """A link gets an inertia that breaks the triangle inequality; URDF readers take it."""
    shipped = Robot.load("six-dof-arm")
    text = shipped.path.read_text().replace('izz="0.286"', 'izz="9.9"')
    path = tmp_path / "broken.urdf"
    path.write_text(text)
    (tmp_path / "broken.toml").write_text(shipped.sidecar.read_text())
    robot = Robot.load(path)
    log = simulated("six-dof-arm", "a", 0)
    with pytest.raises(IdentifiabilityError, match=r"broken\.urdf: link_1"):
        analyze(robot, log, replicates=0, cad_weight=1.0)
    # Without the file as a prior the logs can still be analysed.
    assert analyze(robot, log, replicates=0).models


def test_mujoco_decides_that_an_impossible_body_is_none(rps, tmp_path):
    text = re.sub(
        r'(<inertial mass="10.248"[^>]*fullinertia=")[^"]*',
        r"\g<1>0.1 0.1 0.9 0 0 0",
        rps.path.read_text(),
    )
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(RobotError, match=r"inertia must satisfy A \+ B >= C.*'platform'"):
        Robot.load(path)


def test_a_flat_body_pulls_like_one_with_a_little_thickness(simulated):
    log = simulated("3-rps", "601", 0)  # its platform is a disc
    result = analyze("3-rps", log, replicates=0, cad_weight=1.0)
    found, wanted = result.full.physical.parameters(), result.robot.nominal
    assert result.full.physical.nearest.accurate
    for name in ("platform.m", "platform.Iyy", "leg1_lower.m"):
        assert found[name] == pytest.approx(wanted[name], rel=1.0), name
    turned = [found[f"platform.{kind}"] for kind in ("Ixx", "Izz", "Iyy")]
    assert turned[0] + turned[1] > turned[2]  # it has some thickness


def test_the_prior_pulls_what_the_data_leave_open_to_the_robot_file(log):
    free = analyze("two-link", log, replicates=0)
    pulled = analyze("two-link", log, replicates=0, cad_weight=10.0)
    nominal = pulled.structure.nominal

    def distance(result):
        """Log-det divergence of the bodies from the robot file's, what the prior weighs."""
        total = 0.0
        for columns in result.full.physical.region.bodies:
            J, J0 = (to_matrix(phi[columns]) for phi in (result.full.physical.nearest.phi, nominal))
            ratio = np.linalg.solve(J0, J)
            total += np.trace(ratio) - np.log(np.linalg.det(ratio)) - 4
        return total

    assert distance(pulled) < distance(free)
    # What the data determine stays: the cost is small in σ² of 1500 rows.
    assert pulled.full.physical.nearest.excess < free.full.physical.nearest.excess + 20
