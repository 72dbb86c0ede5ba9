"""Planted truth, collinear columns, cost: pruning on random linear problems."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability.estimation.noise import JointNoise, rich_noise
from identifiability.workflows.prune.elimination import find_path, good_steps
from identifiability.workflows.prune.moves import Kind, Move

from .conftest import chosen_set, gather, gather_whitened, plant


def test_planted_parameters_are_recovered_under_white_noise_with_few_of_thirteen_nulls():
    # What predicts best keeps a null at times: 54 % of the problems have none of them.
    rng = default_rng(1)
    kept = []
    more = []
    for _ in range(24):
        W, tau, true = plant(rng, 0.0, 10.0)
        chosen = chosen_set(find_path(gather(W, tau)))
        kept.append(chosen >= true)
        more.append(len(chosen - true))
    assert np.mean(kept) >= 23 / 24
    assert np.mean(more) <= 1.0


def test_under_autocorrelated_noise_as_much_is_recovered_as_by_an_oracle_that_knows_it():
    """Rows as measured alone recover .8 of these problems, whose effective z is 10 and more."""
    rng = default_rng(2)
    problems = 32
    known = (JointNoise(np.array([0.9]), 1.0),) * 2
    found = []
    oracle = []
    for _ in range(problems):
        W, tau, true = plant(rng, 0.9, 20.0)
        run = [(0, len(W))]
        noise = tuple(rich_noise([W[:, j]], tau[:, j], run) for j in range(2))
        search = find_path(gather(W, tau), whitened=gather_whitened(W, tau, noise))
        found.append(chosen_set(search) == true)
        oracle.append(chosen_set(find_path(gather_whitened(W, tau, known))) == true)
    slack = 2 * np.sqrt(0.95 * 0.05 / problems)
    assert np.mean(oracle) >= 0.95 - slack
    assert np.mean(found) >= 0.95 * np.mean(oracle) - slack


def test_noise_beside_functions_like_the_model_does_not_depend_on_rounding(rng):
    X = rng.normal(size=(60, 9))
    y = rng.normal(size=60).cumsum()
    functions = (X * (1 + 1e-13 * rng.normal(size=X.shape)) for _ in range(3))
    sizes = [rich_noise([X, Z], y, [(0, 60)]).sigma for Z in functions]
    assert_allclose(sizes, sizes[0])


def test_rows_as_measured_refute_a_noise_that_hides_what_the_torque_needs():
    """Differences of a slow column are drowned by noise that is white."""
    rng = default_rng(3)
    W = rng.normal(size=(1000, 1, 4))
    W[:, 0, 0] = np.sin(np.linspace(0, 20, 1000))
    tau = W @ np.array([1.0, 1.0, 0.0, 0.0]) + rng.normal(size=(1000, 1))
    wrong = gather_whitened(W, tau, (JointNoise(np.array([0.99]), 1.0),))
    assert "p0" not in chosen_set(find_path(wrong))
    assert chosen_set(find_path(gather(W, tau), whitened=wrong)) == {"p0", "p1"}


def test_of_two_equal_columns_one_stands_for_both(rng):
    W = rng.normal(size=(600, 1, 4))
    W[:, :, 3] = 2 * W[:, :, 2]
    tau = W @ np.array([3.0, 1.0, 2.0, 0.0]) + rng.normal(size=(600, 1))
    search = find_path(gather(W, tau))
    assert chosen_set(search) == {"p0", "p1", "p2"}
    assert search.steps[1].move.kind is Kind.UNEXCITED


def test_nothing_is_pruned_that_is_identifiable():
    rng = default_rng(5)
    W = rng.normal(size=(1000, 2, 8))
    phi = rng.choice([-1, 1], 8) * rng.uniform(0.3, 3, 8)
    assert len(chosen_set(find_path(gather(W, W @ phi + rng.normal(size=(1000, 2)))))) == 8


def test_a_tie_that_holds_is_made_and_one_that_does_not_is_refused():
    rng = default_rng(2)
    W = rng.normal(size=(800, 1, 4))
    tau = W @ np.array([2.0, 2.0, 1.0, -3.0]) + rng.normal(size=(800, 1))
    ties = [Move(Kind.TIE, tie=((a, b),)) for a, b in (("p0", "p1"), ("p2", "p3"))]
    search = find_path(gather(W, tau), suggested=ties)
    assert search.steps[good_steps(search.steps)[0]].partition.ties() == {"p*": ["p0", "p1"]}
    assert [r.move for r in search.refused] == [ties[1]]
