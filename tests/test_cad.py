"""The robot file as a prior: it pulls what the data leave open; a ball stands in for no body."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze
from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import GROUPED_KINDS
from identifiability.physical.cad_prior import draw_bodies, total_mass
from identifiability.physical.pseudo_inertia import check_body, to_matrix
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters


@pytest.fixture
def log(simulated):
    return simulated("two-link", "a", 0)


def test_an_infeasible_cad_file_is_told_of_first_and_a_ball_stands_in(simulated, tmp_path):
    """A link gets an inertia that breaks the triangle inequality; URDF readers take it."""
    shipped = Robot.load("six-dof-arm")
    text = shipped.path.read_text().replace('izz="0.286"', 'izz="9.9"')
    path = tmp_path / "broken.urdf"
    path.write_text(text)
    (tmp_path / "broken.toml").write_text(shipped.sidecar.read_text())
    robot = Robot.load(path)
    result = analyze(robot, simulated("six-dof-arm", "a", 0), replicates=0)
    assert result.hints[0].startswith("The robot file states a body that cannot exist. link_1")
    said = result.chosen.physical.sentence
    assert "no body with mass and possible moments for link_1: where the logs are silent" in said
    assert result.chosen.physical.cad_weight > 0
    found = result.chosen.physical.parameters()
    assert total_mass(robot, found) < 3 * total_mass(robot, robot.nominal)


def test_a_body_that_the_file_does_not_state_is_drawn_as_a_light_ball():
    robot = Robot.load("two-link")
    nominal = dict(robot.nominal)
    first, second = robot.bodies
    nominal |= {f"{second}.{kind}": 0.0 for kind in GROUPED_KINDS}
    base = find_base_parameters(robot, Model.of("rigid_body"))
    lost = Structure(replace(robot, nominal=nominal), Model.of("rigid_body"), base)
    drawn = draw_bodies(lost)
    assert drawn.replaced == (second,)
    ball = drawn.phi[lost.inertial[1]]
    assert ball[9] == nominal[f"{first}.m"]
    np.testing.assert_array_equal(ball[6:9], 0.0)
    assert ball[0] == ball[3] == ball[5] > 0
    assert "it is drawn to a ball as light as the lightest other body" in drawn.sentence
    heavy = nominal | {f"{second}.m": 2.5, f"{second}.mx": 0.5}
    stated = draw_bodies(Structure(replace(robot, nominal=heavy), Model.of("rigid_body"), base))
    ball = stated.phi[lost.inertial[1]]
    assert (ball[9], ball[6]) == (2.5, 0.5)  # the mass and centre that it states stay
    assert check_body(ball, second).feasible
    none = dict.fromkeys(nominal, 0.0)
    empty = draw_bodies(Structure(replace(robot, nominal=none), Model.of("rigid_body"), base))
    assert (empty.phi[lost.inertial[:, 9]] == 1.0).all()
    assert "each is drawn to a ball of 1 kg" in empty.sentence
    whole = draw_bodies(Structure(robot, Model.of("rigid_body"), base))
    np.testing.assert_array_equal(whole.phi, [robot.nominal[n] for n in lost.columns])
    assert not whole.sentence


def test_a_load_is_drawn_as_the_body_that_carries_it():
    robot = Robot.load("two-link")
    model = Model.of("rigid_body", "payload")
    structure = Structure.of(robot, model)
    drawn = draw_bodies(structure)
    carrier, load = structure.inertial[-2], structure.inertial[-1]
    assert list(structure.bodies)[-1].endswith(".payload_")
    np.testing.assert_array_equal(drawn.phi[load], drawn.phi[carrier])


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
    result = analyze("3-rps", log, replicates=0, cad_prior=1.0)
    found, wanted = result.full.physical.parameters(), result.robot.nominal
    assert result.full.physical.nearest.accurate
    for name in ("platform.m", "platform.Iyy", "leg1_lower.m"):
        assert found[name] == pytest.approx(wanted[name], rel=1.0), name
    turned = [found[f"platform.{kind}"] for kind in ("Ixx", "Izz", "Iyy")]
    assert turned[0] + turned[1] > turned[2]  # it has some thickness


def test_the_prior_pulls_what_the_data_leave_open_to_the_robot_file(log):
    free = analyze("two-link", log, replicates=0, cad_prior=0.0)
    pulled = analyze("two-link", log, replicates=0, cad_prior=10.0)
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
