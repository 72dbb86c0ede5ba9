"""Rank, fit and σ do not depend on units, column order or row order."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Information, estimate, find_base_parameters
from identifiability.regression.structure import group_columns, random_motion


@pytest.fixture
def problem(rps, paper_model):
    motion = random_motion(rps, default_rng(0), 200)
    W = paper_model.regressor(rps, motion)
    return W, paper_model.parameters(rps)


def information_of(W, tau):
    """The information of rows by itself, in the basis of their own triangular factor."""
    names = [f"c{i}" for i in range(W.shape[2])]
    return Information.of_rows(names, W, tau, np.zeros(len(W), int), len(W))


def test_the_groupings_do_not_depend_on_units(problem):
    W, parameters = problem
    flat = W.reshape(-1, W.shape[2])
    plain = group_columns(flat, parameters)
    factor = 10.0 ** default_rng(1).integers(-4, 5, flat.shape[1])
    scaled = group_columns(flat * factor, parameters)
    assert scaled.kept.tolist() == plain.kept.tolist()
    # A parameter in another unit has another coefficient, by the ratio of the units.
    expected = plain.G * factor[None, :] / factor[plain.kept][:, None]
    assert_allclose(scaled.G, expected, atol=1e-9 * np.abs(expected).max())


def test_the_rank_does_not_depend_on_the_order_of_columns_and_rows(problem):
    W, parameters = problem
    flat = W.reshape(-1, W.shape[2])
    rng = default_rng(2)
    for _ in range(5):
        columns = rng.permutation(flat.shape[1])
        rows = rng.permutation(len(flat))
        found = group_columns(flat[rows][:, columns], [parameters[c] for c in columns])
        assert found.rank == 37
        # Whatever represents the groups, together they explain every column.
        base = flat[rows][:, columns][:, found.kept]
        other = flat[rows][:, columns]
        assert_allclose(base @ found.G, other, atol=1e-8 * np.abs(other).max())


def test_fit_and_sigma_follow_units_and_orders(problem, rps, paper_model):
    W, _ = problem
    base = find_base_parameters(rps, paper_model)
    W = W[:, :, base.kept]
    rng = default_rng(3)
    tau = W @ rng.normal(size=W.shape[2]) + rng.normal(size=W.shape[:2])
    fit = estimate(information_of(W, tau))
    columns = rng.permutation(W.shape[2])
    rows = rng.permutation(len(W))
    factor = 10.0 ** rng.integers(-3, 4, W.shape[2])
    other = estimate(information_of((W * factor)[rows][:, :, columns], tau[rows]))
    assert_allclose(other.value * factor[columns], fit.value[columns], rtol=1e-7)
    assert_allclose(other.sigma * factor[columns], fit.sigma[columns], rtol=1e-7)
    assert other.paper_rule.tolist() == fit.paper_rule[columns].tolist()
