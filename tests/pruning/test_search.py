"""Planted truth, collinear columns, cost: pruning on random linear problems."""

import time

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.workflows.prune.folds import gather_folds
from identifiability.workflows.prune.moves import Kind, Move, Partition
from identifiability.workflows.prune.search import find_path

from .conftest import chosen_set, gather, plant

FREE = np.zeros(20, bool)


def recovered(rho, precision, problems=24, seed=1):
    rng = np.random.default_rng(seed)
    hits = []
    for _ in range(problems):
        information, true = plant(rng, rho, precision)
        hits.append(chosen_set(find_path(information, FREE)) == true)
    return float(np.mean(hits))


def test_planted_parameters_are_recovered_exactly_under_white_noise():
    # 60 of 60 in a longer run: at 24 problems a true rate of .9 gives 20 or more in 91 %.
    assert recovered(0.0, 10.0) >= 20 / 24


def test_planted_parameters_are_mostly_recovered_under_autocorrelated_noise():
    # .87 ± .04 in a longer run; 16 of 24 is four standard errors below.
    assert recovered(0.9, 40.0) >= 16 / 24


def test_the_constrained_fit_by_updates_is_the_refit():
    information, _ = plant(np.random.default_rng(0))
    full = estimate(information)
    folds = gather_folds(information, full, FREE)
    moves = [Move(Kind.DROP, ("p3",)), Move(Kind.TIE, tie=(("p1", "p2", "p9"),))]
    fit, partition = folds.fit(), Partition.of(information.columns)
    for move in moves:
        fit, partition = fit.after(move), partition.apply(move)
    M = np.stack([partition.group == g for g in partition.leaders], 1).astype(float)
    # The same weights: refitted on the reduced columns, all blocks or all but one fold's.
    for f in range(-1, 3):
        kept = folds.fold[folds.stretch] != f
        rest = information.take(kept)
        R = rest.reduce(M, [f"c{j}" for j in range(M.shape[1])]).factor(full.weights)
        x = M @ np.linalg.solve(R[:-1, :-1], R[:-1, -1])
        np.testing.assert_allclose(fit.values[f + 1], x, rtol=1e-6, atol=1e-8)


def test_held_out_squares_are_those_of_predictions():
    rng = np.random.default_rng(3)
    W = rng.normal(size=(640, 2, 4))
    tau = W @ np.arange(4.0) + rng.normal(size=(640, 2))
    information = gather(W, tau, blocks=64)
    folds = gather_folds(information, estimate(information, "ols"), np.zeros(4, bool))
    fit = folds.fit()
    of_sample = np.repeat(folds.fold[folds.stretch], information.counts)
    expected = 0.0
    for f in range(len(fit.values) - 1):
        mine = of_sample == f
        x = np.linalg.lstsq(W[~mine].reshape(-1, 4), tau[~mine].ravel(), rcond=None)[0]
        np.testing.assert_allclose(fit.values[f + 1], x, rtol=1e-6)
        expected = expected + ((tau[mine] - W[mine] @ x) ** 2).sum(0)
    expected = expected / (tau**2).sum(0) / 2  # each joint on its own scale
    np.testing.assert_allclose(fit.errors().by_joint, expected, rtol=1e-6)


def test_of_two_nearly_equal_columns_the_ladder_says_either():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(1000, 1, 4))
    W[:, :, 3] = W[:, :, 2] + 1e-3 * rng.normal(size=(1000, 1))
    tau = W @ np.array([3.0, 0.0, 2.0, 0.0]) + rng.normal(size=(1000, 1))
    steps = find_path(gather(W, tau), np.zeros(4, bool)).path.steps
    told = {s.evidence.either for s in steps[1:] if set(s.move.zero) & {"p2", "p3"}}
    assert told & {"p2", "p3"}


def test_of_two_equal_columns_one_stands_for_both():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(600, 1, 4))
    W[:, :, 3] = 2 * W[:, :, 2]
    tau = W @ np.array([3.0, 1.0, 2.0, 0.0]) + rng.normal(size=(600, 1))
    search = find_path(gather(W, tau), np.zeros(4, bool))
    assert chosen_set(search) == {"p0", "p1", "p2"}
    first = search.path.steps[1].move
    assert first.kind is Kind.UNEXCITED
    assert "either p2 or p3 can stand for both" in first.why.lower()


def test_nothing_is_pruned_that_is_identifiable():
    rng = np.random.default_rng(5)
    W = rng.normal(size=(1000, 2, 8))
    phi = rng.choice([-1, 1], 8) * rng.uniform(0.3, 3, 8)
    search = find_path(gather(W, W @ phi + rng.normal(size=(1000, 2))), np.zeros(8, bool))
    assert len(chosen_set(search)) == 8


def test_a_tie_that_holds_is_made_and_one_that_does_not_is_refused():
    rng = np.random.default_rng(2)
    W = rng.normal(size=(800, 1, 4))
    tau = W @ np.array([2.0, 2.0, 1.0, -3.0]) + rng.normal(size=(800, 1))
    ties = [Move(Kind.TIE, tie=((a, b),)) for a, b in (("p0", "p1"), ("p2", "p3"))]
    search = find_path(gather(W, tau), np.zeros(4, bool), suggested=ties)
    chosen = search.path.steps[search.choose("identifiable")].partition
    assert chosen.ties() == {"p*": ["p0", "p1"]}
    assert [r.move for r in search.path.refused] == [ties[1]]
    assert "contradict" in search.path.refused[0].reason


def test_forbidden_columns_stay_and_forced_ones_go():
    information, true = plant(np.random.default_rng(4))
    null = min(set(information.columns) - true)
    some = min(true)
    search = find_path(information, FREE, forbid=[null], force=[some])
    assert all(null in {p.columns[g] for g in p.leaders} for p in _partitions(search))
    assert some not in chosen_set(search)


def test_columns_in_another_unit_or_order_are_pruned_alike():
    rng = np.random.default_rng(6)
    W = rng.normal(size=(800, 2, 8))
    phi = np.array([1.0, 0, 2, 0, 0, -1, 0, 0.5])
    tau = W @ phi + rng.normal(size=(800, 2))
    units, order = 10.0 ** rng.uniform(-4, 4, 8), rng.permutation(8)
    plain = chosen_set(find_path(gather(W, tau), np.zeros(8, bool)))
    other = chosen_set(find_path(gather((W * units)[:, :, order], tau), np.zeros(8, bool)))
    assert {f"p{order[int(c[1:])]}" for c in other} == plain


@pytest.mark.parametrize(("logs", "whole"), [(4, True), (2, False)])
def test_several_logs_are_left_out_one_by_one_and_few_are_divided(logs, whole):
    """Two folds cannot contradict a move; stretches of the two logs can."""
    rng = np.random.default_rng(7)
    W = rng.normal(size=(1200, 1, 5))
    tau = W @ np.array([1.0, 2, 0, 0, 3]) + rng.normal(size=(1200, 1))
    information = gather(W, tau, blocks=120, log=np.arange(1200) * logs // 1200)
    folds = gather_folds(information, estimate(information, "ols"), np.zeros(5, bool))
    assert (folds.fold.max() + 1 == logs) == whole
    assert len(folds.fold) >= 12
    assert chosen_set(find_path(information, np.zeros(5, bool))) >= {"p0", "p1", "p4"}


def test_the_search_does_not_know_the_number_of_samples():
    times = []
    for samples in (1000, 100_000):
        information, _ = plant(np.random.default_rng(0), samples=samples)
        find_path(information, FREE)
        start = time.process_time()
        find_path(information, FREE)
        times.append(time.process_time() - start)
    assert times[1] < 3 * times[0] + 0.05


@pytest.mark.parametrize("criterion", ["one-se-of-difference", "one-se", "best"])
def test_every_criterion_keeps_the_true_parameters(criterion):
    information, true = plant(np.random.default_rng(8), precision=40.0)
    assert chosen_set(find_path(information, FREE), criterion) >= true


def _partitions(search):
    return [s.partition for s in search.path.steps]
