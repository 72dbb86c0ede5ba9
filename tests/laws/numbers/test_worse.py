"""A joint is called worse where it is, and by chance as seldom as promised."""

import numpy as np
import pytest
from scipy.stats import wilcoxon

from identifiability.estimation.worse import LEVEL, rank_level, surely_above


@pytest.mark.parametrize("stretches", [4, 7, 16])
def test_ranks_have_the_level_of_wilcoxons_exact_test(stretches):
    rise = np.random.default_rng(stretches).normal(0.4, 1.0, (stretches, 5))
    exact = [wilcoxon(x, alternative="greater", method="exact").pvalue for x in rise.T]
    np.testing.assert_allclose(rank_level(rise), exact, rtol=1e-12)


@pytest.mark.parametrize(("stretches", "joints"), [(8, 1), (16, 7), (20, 3)])
@pytest.mark.parametrize("tail", ["normal", "long"])
def test_equal_models_are_called_worse_at_a_joint_in_at_most_five_percent(stretches, joints, tail):
    rng, trials = np.random.default_rng(0), 1000
    rise = rng.normal(size=(trials, stretches, joints))
    rise = rise**3 if tail == "long" else rise
    called = np.mean([surely_above(x, np.ones(joints)).any() for x in rise])
    assert called < LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / trials)


def test_one_odd_stretch_does_not_hide_a_joint_that_loses_everywhere_else():
    rise = np.random.default_rng(1).uniform(1.0, 6.0, (16, 6)) * [0, 0, 0, 0, 0, 1]
    rise[10, 5] = -40.0
    assert rise[:, 5].sum() < rise[:, 5].std(ddof=1) * 4  # within one standard error of the sum
    assert surely_above(rise, np.full(6, 100.0)).tolist() == [False] * 5 + [True]


def test_a_rise_of_four_stretches_is_seen_by_its_mean():
    rise = np.array([[1.0], [1.1], [0.9], [1.05]])
    assert rank_level(rise)[0] == 1 / 16  # ranks of four cannot be sure
    assert surely_above(rise, np.ones(1)).all()


def test_rounding_is_no_rise_and_one_stretch_says_nothing():
    rise = np.full((16, 2), 1e-13)
    assert not surely_above(rise, np.ones(2)).any()
    assert not surely_above(np.ones((1, 2)), np.ones(2)).any()
    assert surely_above(np.ones((16, 2)), np.ones(2)).all()
