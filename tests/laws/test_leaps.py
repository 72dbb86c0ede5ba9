"""A closed chain stays in its assembly: what ends far from its prediction is followed from home."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability.workflows.excite.limits import Workspace, find_limits, survey

from ..roads import still


def test_a_far_sample_in_a_crowd_has_the_assembly_that_it_has_alone(five_bar):
    """The crowd's prediction leads to the other assembly, 3.3 rad away."""
    far = np.array([[1.41619394, 2.35436576]])
    home = five_bar.actuated_positions(five_bar.home[None])
    crowd = np.repeat(home, 3000, axis=0)
    crowd += 1e-3 * np.random.default_rng(0).standard_normal(crowd.shape)
    crowd[17] = far
    alone = still(five_bar, far)
    among = still(five_bar, crowd)
    assert len(among) == 3000
    assert_allclose(among.q[17], alone.q[0], atol=1e-9)
    other = [1.41619394, 2.29455727, 2.35436576, 1.14744038]  # closes the loop as well
    assert np.abs(np.array(other) - alone.q[0]).max() > 2.9


@pytest.mark.parametrize("jump, leaps", [(0.0, 0), (0.69, 0), (0.71, 1), (-0.71, 1)])
def test_an_exciting_motion_leaps_where_its_velocities_do_not_lead(five_bar, jump, leaps):
    """By more than .7 rad between two samples; before it and after it all is led."""
    home = five_bar.actuated_positions(five_bar.home[None])
    motion = still(five_bar, np.repeat(home, 8, axis=0))
    q = motion.q.copy()
    v = np.full_like(motion.v, 0.5)
    step = 0.2
    q += 0.5 * step * np.arange(8)[:, None]
    q[5:, 1] += jump
    moved = replace(motion, q=q, v=v, condition=1.0)
    assert survey(five_bar, find_limits(five_bar), moved, 8, 1, step).leaps.tolist() == [leaps]
    # Of two candidates one after the other: nothing is asked of the seam between them.
    apart = survey(five_bar, find_limits(five_bar), moved, 4, 2, step)
    assert apart.leaps.tolist() == [0, leaps]
    q[4:, 1] += 5.0
    seam = survey(five_bar, find_limits(five_bar), replace(moved, q=q), 4, 2, step)
    assert seam.leaps.tolist() == [0, leaps]


def test_loops_that_do_not_close_are_counted_for_their_candidate(five_bar):
    home = five_bar.actuated_positions(five_bar.home[None])
    motion = still(five_bar, np.repeat(home, 12, axis=0))
    part = motion[np.array([0, 1, 2, 3, 4, 6, 8, 9])]
    found = survey(five_bar, find_limits(five_bar), part, 4, 3, 0.01)
    assert found.open.tolist() == [0, 2, 2]
    assert_allclose(found.condition, part.condition)


def test_open_loops_leaps_ill_conditioned_and_heavy_candidates_are_not_kept():
    space = Workspace(
        open=np.array([0, 1, 0, 0, 0, 0, 0]),
        condition=np.array([1.0, 1.0, 100.0, 100.1, 90.0, 95.0, 1.0]),
        leaps=np.array([0, 0, 0, 0, 1, 0, 0]),
        load=np.zeros(7),
    )
    assert space.kept(100.0).tolist() == [True, False, True, False, False, True, True]
    asked = replace(space, load=np.array([0.9, 0.5, 1.0, 1.0, 1.0, 1.1, 0.0]))
    assert asked.kept(100.0).tolist() == [True, False, True, False, False, False, True]
