"""Folds that are held by factors say what their rows say, and nothing of what they do not have."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.regression.information import Information
from identifiability.workflows.diagnose.folds import TALL, Folds

COLUMNS = 6


def rows_of(count, seed=0):
    """Rows (N, 2, k + 1) with columns of sizes far apart, the last but torque in fold 2 alone."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, 2, COLUMNS + 1)) * 10.0 ** np.arange(-3, 4)
    rows[:, :, 1] += 1e3 * rows[:, :, 0]
    folds = np.arange(count) * 5 // count
    rows[folds != 2, :, COLUMNS - 1] = 0.0
    rows[:, :, COLUMNS] += rows[:, :, :COLUMNS] @ np.ones(COLUMNS)
    return rows, folds


def information_of(rows):
    names = tuple(map(str, range(COLUMNS)))
    log = np.zeros(len(rows), int)
    return Information.of_rows(names, rows[:, :, :-1], rows[:, :, -1], log, len(rows))


@pytest.mark.parametrize("count", [60, 2000])
@pytest.mark.parametrize("fold", [None, 0, 2])
def test_a_fit_without_a_fold_is_that_of_the_other_rows(count, fold):
    rows, folds = rows_of(count)
    every = Folds.of(rows, folds)
    every.fit(1)  # what is kept of one fold is none of another
    held, one = every.fit(fold)
    direct = information_of(rows[folds != fold])
    assert held.samples == direct.samples
    other = estimate(direct)
    assert one.kept == other.kept
    for name in ("value", "variance", "weights", "rss"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-8)
    np.testing.assert_allclose(np.diag(one.covariance), np.diag(other.covariance), rtol=1e-8)


def test_what_acts_in_one_fold_alone_is_nothing_without_it():
    rows, folds = rows_of(2000)
    held = Folds.of(rows, folds)
    assert COLUMNS - 1 in held.fit()[1].kept
    left = held.fit(2)[1]
    assert left.kept == tuple(range(COLUMNS - 1))
    assert left.value[-1] == 0.0


def test_a_fit_is_made_once():
    rows, folds = rows_of(60)
    held = Folds.of(rows, folds)
    assert held.fit(2)[1] is held.fit(2)[1]


def test_only_folds_of_far_more_rows_than_columns_are_held_by_factors():
    few = TALL * (COLUMNS + 1)
    rows, folds = rows_of(5 * few)
    for part, fold in zip(Folds.of(rows, folds).parts, range(5), strict=True):
        np.testing.assert_array_equal(part, rows[folds == fold])
    rows, folds = rows_of(5 * few + 5)
    assert all(part.shape == (COLUMNS + 1, 2, COLUMNS + 1) for part in Folds.of(rows, folds).parts)
