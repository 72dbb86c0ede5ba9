"""What estimates that noise does not bias change of least squares, and along which motions."""

import numpy as np
import pytest

from identifiability.estimation.estimator import Correction, Estimate, correct
from identifiability.logs.prepare import instruments as closing
from identifiability.logs.prepare.instruments import complete_along
from identifiability.robot import Robot, complete_motion


@pytest.fixture
def plain():
    """Of ten samples of two actuators; b depends on the others, and c leans on it."""
    return Estimate(
        columns=("a", "b", "c"),
        value=np.array([5.0, 0.0, 6.0]),
        covariance=np.diag([1.0, np.inf, np.inf]),
        determined=np.array([True, False, False]),
        kept=(0, 2),
        variance=np.array([0.1, 0.2]),
        rss=np.array([1.0, 2.0]),
        dof=18,
        condition=1.0,
        singular_values=np.ones(2),
        weights=np.ones(2),
        times=np.ones(2),
        estimator=None,
    )


def test_only_kept_columns_get_values_and_only_determined_ones_a_variance(plain):
    mended = Correction(plain.value, 0, (), np.zeros((0, 3)))
    rss = np.array([6.0, 1.9])
    found = correct(plain, None, np.array([7.0, 8.0]), np.diag([4.0, 9.0]), rss, mended)
    assert found.value.tolist() == [7.0, 0.0, 8.0]
    assert np.diag(found.covariance).tolist() == [4.0, np.inf, np.inf]
    assert found.rss.tolist() == [6.0, 1.9]
    # What is left more is noise; less is rounding.
    assert found.variance == pytest.approx([0.1 + 5.0 / 10, 0.2])
    assert found.correction.least_squares.tolist() == [5.0, 0.0, 6.0]


def test_what_has_a_tenth_of_its_variance_from_weak_directions_leans_on_them(plain):
    directions = np.array([[1.0, 0.3], [1.0, 0.4]])
    weak = np.array([False, True])
    mended = Correction.of(plain, directions, 0 * directions, weak)
    assert mended.weak == 1
    assert mended.touched == ("c",)
    biased = Correction.of(plain, directions, directions * [0, 2], weak)
    assert biased.touched == ("a", "c")
    np.testing.assert_allclose(biased.bias, [[0.6, 0.0, 0.8]])


def test_where_a_loop_stays_open_another_motion_stands(monkeypatch):
    robot, t = Robot.load("two-link"), np.linspace(0, 1, 100)
    zero, one, two = (complete_motion(robot, t, *np.full((3, 100, 2), x)) for x in (0.0, 1.0, 2.0))
    monkeypatch.setattr(closing, "complete_motion", lambda *_: two[np.delete(np.arange(100), 7)])
    for instead, value in ((None, 0.0), (one, 1.0)):
        found = complete_along(robot, zero, np.full((3, 100, 2), 2.0), instead)
        assert (found.actuated_q[7] == value).all()
        assert (np.delete(found.actuated_q, 7, 0) == 2.0).all()
    monkeypatch.setattr(closing, "complete_motion", lambda *_: two[3:])
    assert complete_along(robot, zero, np.full((3, 100, 2), 2.0)) is None
