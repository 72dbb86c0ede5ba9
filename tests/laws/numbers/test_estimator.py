"""An estimator is known by its name, and its loss is least at its values."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import estimate
from identifiability.estimation.estimate import find_estimator

from .made import gather


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(800, 2, 3))
    return gather(W, W @ [1.0, -2.0, 0.5] + 0.3 * rng.normal(size=(800, 2)))


def test_a_wrong_name_lists_all(rejected):
    with rejected(r"'ols' or 'wls', not 'wsl', did you mean"):
        find_estimator("wsl")


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_the_loss_of_an_estimator_is_least_at_its_values(rows, method):
    fit = estimate(rows, method)
    F = fit.estimator.loss(rows, fit)
    assert_allclose(np.linalg.solve(F[:-1, :-1], F[:-1, -1]), fit.value, rtol=1e-8)


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_what_a_fit_finds_of_columns_is_what_it_finds_of_their_torque(rows, method):
    M = np.eye(3)[:, :2]
    fit = estimate(rows.reduce(M, "ab"), method)
    R = rows.factor(fit.weights)[:, :-1]
    expected = np.linalg.lstsq(R @ M, R, rcond=None)[0]
    assert_allclose(fit.estimator.project(rows, fit, M), expected, atol=1e-12)
