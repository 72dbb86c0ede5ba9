"""The robot file as a prior: it pulls what the data leave open; a ball stands in for no body."""

from dataclasses import replace

import pytest

from identifiability import Robot, analyze
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.physical.cad_prior import total_mass

from .physical.bodies import divergence


def test_an_infeasible_cad_file_is_told_of_first_and_a_ball_stands_in(simulated, load_text):
    """A link gets an inertia that breaks the triangle inequality; URDF readers take it."""
    shipped = Robot.load("six-dof-arm")
    text = shipped.path.read_text().replace('izz="0.286"', 'izz="9.9"')
    robot = load_text(text, "urdf", shipped.sidecar.read_text())
    result = analyze(robot, simulated("six-dof-arm", "a", 0), replicates=0)
    assert result.hints[0].startswith("The robot file states a body that cannot exist: link_1")
    said = result.chosen.physical.sentence
    assert "no body with mass and possible moments for link_1: where the logs are silent" in said
    assert result.chosen.physical.cad_weight > 0
    found = result.chosen.physical.parameters()
    assert total_mass(robot, found) < 3 * total_mass(robot, robot.nominal)


@pytest.mark.parametrize("factor", [1.0, 1e-3])  # of all masses of the file, in a wrong unit
def test_the_prior_pulls_what_the_data_leave_open_to_the_robot_file(arm_log, factor, two_link):
    robot = two_link
    nominal = analyze("two-link", arm_log, quick=True).structure.nominal
    kinds = {n: n.split(".")[1] for n in robot.nominal}
    scaled = {n: v * factor ** (kinds[n] in INERTIAL_KINDS) for n, v in robot.nominal.items()}
    free, pulled = (
        analyze(replace(robot, nominal=scaled), arm_log, replicates=0, cad_prior=weight)
        for weight in (0.0, 10.0)
    )

    def distance(result):
        """Log-det divergence of the bodies from the right file's, what the prior weighs."""
        bodies = result.full.physical.region.bodies
        return divergence(result.full.physical.nearest.phi[bodies], nominal[bodies])

    assert distance(pulled) < distance(free)
    # What the data determine stays: the cost is small in σ² of 1500 rows.
    assert pulled.full.physical.nearest.excess < free.full.physical.nearest.excess + 20
