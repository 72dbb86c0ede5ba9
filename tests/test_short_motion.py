"""A short motion is predicted well by values that no log determines: both are explained."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, simulate
from identifiability.simulation.motion import find_motion


@pytest.fixture(scope="module")
def analysis_of():
    """A function that returns an analysis of so many samples, and of as many that follow."""
    robot = Robot.load("six-dof-arm")
    rng = np.random.default_rng(3)
    log = simulate(robot, find_motion(robot, "random", 300, rng), noise=Noise(torque=0.02), rng=rng)

    def analyze_part(size):
        fitted, unseen = (
            replace(log.rows(k * size, (k + 1) * size, f"part {k}"), sha256=str(k))
            for k in range(2)
        )
        return analyze(robot, fitted, unseen, replicates=0)

    return analyze_part


def test_no_identifiable_parameter_beside_good_predictions_is_explained(analysis_of):
    found = analysis_of(30)
    assert not any(v.verdict.value == "identifiable" for v in found.chosen.verdicts)
    assert found.chosen.error_ra_validation < 0.08
    count = len(found.chosen.submodel)
    use = found.details
    assert "Only the torque of like motion, no parameter by itself" in use
    assert f" of {count} values: " in use
    assert "Log longer and more varied motion." in use
    longer = analysis_of(150).details
    assert "by itself" not in longer
    assert "Largest source of error" not in longer


def test_combinations_are_stated_where_no_parameter_is_identifiable(analysis_of):
    tables = [t for t in analysis_of(30).tables() if t.caption.startswith("Combinations")]
    first, second = ((cells[0].text, cells[1].text) for cells in tables[0].rows)
    # The other terms are below .01 N·m.
    assert first[0].startswith("joint_1.Fc ")  # 32 N·m in truth
    assert first[1] == "31.6 N·m ± 2.2"
    assert second[0].startswith("joint_6.Fc ")  # 1.6 N·m
    assert second[1] == "1.65 N·m ± 0.28"  # its friction may be nonlinear
    assert not any(t.caption.startswith("Combinations") for t in analysis_of(150).tables())


def test_the_error_over_own_means_is_stated_where_it_is_far_larger(analysis_of):
    found = analysis_of(30)
    seen = found.held_out
    size = np.abs(seen.tau - seen.tau.mean(axis=0))[seen.data].sum()
    error = np.abs(seen.residual).sum() / size
    assert error > 1.3 * found.chosen.error_ra_validation
    assert f"in place of one mean of all joints, the error is {100 * error:.3g} %" in found.details
    assert "own mean torque" not in analysis_of(150).details
