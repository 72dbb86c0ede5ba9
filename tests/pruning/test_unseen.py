"""States that are not in the logs."""

import numpy as np

from identifiability.logs.prepare import prepare_samples
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.prune.unseen import STATES, draw_states, unseen_regressor


def samples_of(simulated, name, trajectory):
    robot = Robot.load(name)
    return robot, (prepare_samples(robot, simulated(name, trajectory, 0)),)


def test_states_stay_within_the_ranges_of_the_log(simulated):
    robot, samples = samples_of(simulated, "two-link", "a")
    drawn = draw_states(robot, samples, np.random.default_rng(0))
    seen = samples[0].motion
    for part in ("actuated_q", "actuated_v", "actuated_a"):
        x, y = getattr(drawn, part), getattr(seen, part)
        assert (x >= y.min(0)).all()
        assert (x <= y.max(0)).all()
    assert abs(np.corrcoef(drawn.actuated_v.T)[0, 1]) < 4 / np.sqrt(STATES)


def test_reach_widens_speeds_by_it_and_accelerations_by_its_square(simulated):
    robot, samples = samples_of(simulated, "two-link", "a")
    plain, wide = (draw_states(robot, samples, np.random.default_rng(0), r) for r in (1.0, 2.0))
    np.testing.assert_allclose(np.ptp(wide.actuated_q, 0), np.ptp(plain.actuated_q, 0))
    np.testing.assert_allclose(np.ptp(wide.actuated_v, 0), 2 * np.ptp(plain.actuated_v, 0))
    np.testing.assert_allclose(np.ptp(wide.actuated_a, 0), 4 * np.ptp(plain.actuated_a, 0))


def test_the_largest_torques_of_a_closed_chain_are_left_out(simulated, paper_model):
    robot, samples = samples_of(simulated, "3-rps", "601")
    structure = Structure.of(robot, paper_model)
    W = unseen_regressor(structure, samples, np.random.default_rng(0))
    assert 0.5 * STATES < len(W) <= 0.96 * STATES
    assert W.shape[1:] == (3, len(structure.base))
    assert np.isfinite(W).all()
