import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from identifiability.posterior.exact import Cone, Flight, travel


def fly(flight):
    while not flight.advance():
        pass
    return flight


@pytest.mark.parametrize("mean", [-6.0, -3.0, 0.0, 2.0])
def test_a_half_normal_has_its_closed_form_wherever_its_mean_is(mean, rng):
    wall = Cone(np.eye(1), np.zeros(1), rows=1)
    x = np.ones((4000, 1))
    for _ in range(40):
        x, _ = travel(wall, np.eye(1), x, np.full_like(x, mean), np.ones_like(x), rng)
    assert stats.kstest(x[:, 0], stats.truncnorm(-mean, np.inf, loc=mean).cdf).pvalue > 1e-3


def test_a_transition_can_be_taken_back(rng):
    # Reversed velocity, same time: every chain must come home, or detailed balance is lost.
    region = Cone(rng.normal(size=(3, 4)), np.ones(3), rows=3)
    x = np.zeros((200, 4))
    root = rng.normal(size=(4, 4))
    mean = rng.normal(size=(200, 4))
    sd = rng.uniform(0.5, 2, (200, 4))
    turn = rng.uniform(1, 2, 200)
    there = fly(Flight(region, root, x, mean, sd, rng.normal(size=x.shape), turn))
    push = np.linalg.solve(root, -there.v.T).T
    back = fly(Flight(region, root, there.x, mean, sd, push, turn))
    assert (there.x != x).all()
    assert_allclose(back.x, x, atol=1e-9)
    assert_allclose(back.energy() - back.start, there.start - there.energy(), atol=1e-9)
