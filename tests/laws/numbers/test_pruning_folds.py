"""Held-out squares of constrained fits, and what their scatter does on states not in the logs."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate, find_estimator
from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.updated_refits import RIDGE
from identifiability.regression.information import Information
from identifiability.workflows.prune.errors import Errors
from identifiability.workflows.prune.folds import gather_folds
from identifiability.workflows.prune.moves import Kind, Move

from .made import gather

WEIGHTS = np.array([4.0, 0.25])


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(320, 2, 3))
    unseen = 3 * rng.normal(size=(50, 2, 3))
    W[:, 0, 0] = unseen[:, 0, 0] = 0.0  # in a tree a joint does not feel every column
    tau = W @ [1.0, -2.0, 0.1] + rng.normal(size=(320, 2)) * [0.5, 2.0]
    return W, tau, unseen


def folds_of(rows, logs=(), size=10, unseen=False):
    W, tau, states = rows
    information = gather(W, tau, size=size, logs=logs)
    forbidden = np.array([False, True, False])
    full = replace(estimate(information, "ols"), weights=WEIGHTS)
    return gather_folds(information, full, forbidden, states if unseen else None)


def solve(W, tau):
    root = np.sqrt(WEIGHTS)
    flat = (W * root[:, None]).reshape(-1, W.shape[2])
    return np.linalg.lstsq(flat, (tau * root).ravel(), rcond=None)[0]


def scaled(W, tau, x, of):
    """Return the squares of each joint over its own scale, those of the whole torque (2,)."""
    return ((tau - W @ x) ** 2).sum(0) / (of**2).sum(0) / 2


def sums(W, tau, x):
    return float((((tau - W @ x) ** 2) @ WEIGHTS).sum())


def test_one_log_is_divided_into_sixteen_stretches_that_are_the_folds(rows):
    folds = folds_of(rows)
    np.testing.assert_array_equal(folds.stretch, np.repeat(np.arange(16), 2))
    np.testing.assert_array_equal(folds.fold, np.arange(16))


def test_two_and_three_logs_are_divided_and_four_are_left_out_whole(rows):
    for logs in ((160, 160), (80, 120, 120)):
        folds = folds_of(rows, logs)
        np.testing.assert_array_equal(folds.fold, np.arange(len(folds.fold)))
        assert len(folds.fold) == 16
    folds = folds_of(rows, (80, 80, 80, 80))
    np.testing.assert_array_equal(folds.fold, np.repeat([0, 1, 2, 3], 4))


def test_a_short_log_among_several_still_has_four_stretches(rows):
    folds = folds_of(rows, (40, 280))
    assert (folds.stretch[:4] == [0, 1, 2, 3]).all()
    assert folds.stretch[4:].min() == 4
    assert folds.stretch.max() + 1 == 4 + 14


def test_every_fold_is_fitted_to_the_others_and_held_against_itself(rows):
    W, tau, _ = rows
    folds = folds_of(rows, (80, 80, 80, 80))
    fit = folds.fit()
    np.testing.assert_allclose(fit.values[0], solve(W, tau), rtol=1e-6)
    held = fit.errors().held
    for log in range(4):
        mine = np.arange(320) // 80 == log
        x = solve(W[~mine], tau[~mine])
        np.testing.assert_allclose(fit.values[1 + log], x, rtol=1e-6)
        for piece in range(4):
            at = slice(80 * log + 20 * piece, 80 * log + 20 * (piece + 1))
            own = scaled(W[at], tau[at], x, of=tau)
            np.testing.assert_allclose(held[4 * log + piece], own, rtol=1e-6)


@pytest.mark.parametrize("logs", [(), (80, 80, 80, 80)])
def test_the_scatter_of_the_fits_is_weighed_on_states_that_the_log_has_not(rows, logs):
    _, tau, unseen = rows
    fit = folds_of(rows, logs, unseen=True).fit()
    x = fit.values[1:]
    F = len(x)
    torque = np.einsum("map,fp->fma", unseen, x - x.mean(0))
    # As many states as samples, on the same scale; jackknife: (F - 1)/F of the sum.
    expected = (F - 1) / F * (torque**2).sum(1) / (2 * (tau**2).sum(0)) * 320 / len(unseen)
    found = fit.errors()
    np.testing.assert_allclose(found.scatter, expected, rtol=1e-6)
    assert (found.scatter > 0).all()
    assert found.total == pytest.approx(found.held.sum() + expected.sum(), rel=1e-6)


def test_without_unseen_states_the_scatter_counts_for_nothing(rows):
    found = folds_of(rows).fit().errors()
    np.testing.assert_array_equal(found.scatter, 0.0)
    assert found.total == found.held.sum()


def test_a_replicate_counts_blocks_as_often_as_they_are_drawn(rows):
    W, tau, _ = rows
    counts = np.random.default_rng(1).integers(1, 4, 32).astype(float)
    fit = folds_of(rows).fit(counts)
    at = np.repeat(np.arange(320), np.repeat(counts, 10).astype(int))
    np.testing.assert_allclose(fit.values[0], solve(W[at], tau[at]), rtol=1e-6)
    mine = at // 20 == 3
    np.testing.assert_allclose(fit.values[4], solve(W[at][~mine], tau[at][~mine]), rtol=1e-6)


def test_a_replicate_by_instruments_combines_them_anew():
    """With those of the log, directions of a replicate would have less than no information."""
    rng = np.random.default_rng(3)
    V = rng.normal(size=(200, 2, 20))
    W = V + 1.5 * rng.normal(size=V.shape)
    tau = V @ np.linspace(-2.0, 2.0, 20) + 0.3 * rng.normal(size=V.shape[:2])
    names, log = tuple(f"p{j}" for j in range(20)), np.zeros(200, int)
    estimator = InstrumentalVariables(find_estimator("ols"))
    information = Information.of_rows(names, W, tau, log, 4, V)
    full = estimator.fit(information)
    folds = gather_folds(information, full, np.zeros(20, bool))
    of_log = estimator.moments(information, full, folds.refitter.R)
    lowest = []
    for counts in rng.multinomial(50, np.full(50, 0.02), 5).astype(float):
        at = np.repeat(np.arange(200), np.repeat(counts.astype(int), 4))
        direct = estimator.fit(Information.of_rows(names, W[at], tau[at], log, 4, V[at]))
        fit = folds.fit(counts)
        np.testing.assert_allclose(fit.values[0], direct.value, rtol=1e-6)
        assert np.linalg.eigvalsh(fit.refits.C).min() > 0
        old = np.tensordot(counts, of_log, 1)[:-1, :-1]
        lowest.append(np.linalg.eigvalsh(old).min())
        dropped = fit.after(Move(Kind.DROP, ("p0",)))
        np.testing.assert_allclose(dropped.values[0][0], 0.0, atol=1e-9)
    assert np.min(lowest) < 0


@pytest.mark.parametrize(
    "move", [Move(Kind.DROP, ("p2",)), Move(Kind.TIE, tie=(("p0", "p2"),)),
             Move(Kind.DROP, ("p0", "p2"))],
)  # fmt: skip
def test_a_constraint_costs_what_refitting_with_it_costs(rows, move):
    W, tau, _ = rows
    fit = folds_of(rows).fit()
    after = fit.after(move)
    M = np.stack([after.partition.group == g for g in after.partition.leaders], 1).astype(float)
    np.testing.assert_array_equal(after.partition.matrix, M)
    x = M @ solve(W @ M, tau)
    np.testing.assert_allclose(after.values[0], x, atol=1e-7)
    rise = sums(W, tau, x) - sums(W, tau, solve(W, tau))
    assert fit.cost(move) == pytest.approx(rise, rel=1e-6)
    assert fit.costs([move])[0] == pytest.approx(rise / (3 - len(after.partition)), rel=1e-6)


def test_what_holds_already_costs_nothing_and_changes_nothing(rows):
    """Of three ties in a ring the last follows from the others; costs are a parameter's."""
    ring = Move(Kind.TIE, tie=(("p0", "p1"), ("p1", "p2"), ("p2", "p0")))
    chain = Move(Kind.TIE, tie=(("p0", "p1", "p2"),))
    fit = folds_of(rows).fit()
    np.testing.assert_allclose(fit.costs([ring]), fit.costs([chain]), rtol=1e-9)
    np.testing.assert_allclose(fit.after(ring).values, fit.after(chain).values, rtol=1e-9)


def test_costs_of_single_moves_are_those_one_by_one(rows):
    moves = [Move(Kind.DROP, (name,)) for name in ("p0", "p1", "p2")]
    fit = folds_of(rows).fit()
    np.testing.assert_allclose(fit.costs(moves), [fit.cost(m) for m in moves], rtol=1e-9)


def test_the_jackknife_is_that_of_definition(rows):
    folds = folds_of(rows)
    fit = folds.fit()
    value, covariance = fit.jackknife(Move(Kind.DROP, ("p0",)))
    scale = np.linalg.norm(np.eye(3)[:1] @ folds.inverse)
    x = fit.values[:, 0] / scale
    np.testing.assert_allclose(value, x[:1], rtol=1e-9)
    expected = 15 / 16 * ((x[1:] - x[1:].mean()) ** 2).sum()
    np.testing.assert_allclose(covariance, [[expected]], rtol=1e-9)


def test_a_forbidden_sign_is_counted_while_the_parameter_is_free(rows):
    folds = folds_of(rows)  # p1 is near -2 and must not be negative
    fit = folds.fit()
    assert fit.violations() == 1
    assert fit.after(Move(Kind.DROP, ("p1",))).violations() == 0


def test_the_spread_of_a_total_is_that_of_its_parts():
    held, scatter = np.array([[1.0, 2, 4, 9]]).T, np.array([[5.0, 1, 2, 0]]).T
    alone = Errors(held, scatter)
    both = held + scatter  # one log: stretches and folds are the same pieces
    assert alone.standard_error == pytest.approx(np.std(both, ddof=1) * 2)
    assert alone.total == 24.0
    several = Errors(np.tile(held, (2, 1)), scatter)
    variance = np.var(np.tile(held, (2, 1)), ddof=1) * 8 + np.var(scatter, ddof=1) * 4
    assert several.standard_error == pytest.approx(np.sqrt(variance))


def test_a_rise_has_the_spread_of_the_differences():
    """Two models that are off at the same places differ surely by little."""
    one = Errors(np.array([[1.0, 20, 4, 9]]).T, np.zeros((4, 1)))
    other = Errors(one.held - np.array([[0.1, 0.2, 0.1, 0.2]]).T, np.zeros((4, 1)))
    rise, spread = one.above(other)
    assert rise == pytest.approx(0.6)
    assert spread == pytest.approx(np.std([0.1, 0.2, 0.1, 0.2], ddof=1) * 2)
    assert other.above(one) == pytest.approx((-0.6, spread))


@pytest.mark.parametrize(("seed", "drawn"), [(0, 40), (1, 40), (2, 18)])
def test_fits_along_a_whole_path_are_those_from_the_rows(seed, drawn):
    """40 columns, nearly alike in tens, of 80 samples that a replicate draws unevenly."""
    rng = np.random.default_rng(seed)
    k, names = 40, tuple(f"p{j}" for j in range(40))
    W = rng.normal(size=(80, 1, k)) + 1e3 * np.repeat(rng.normal(size=(80, 1, 4)), 10, 2)
    tau = rng.normal(size=(80, 1))
    information = gather(W, tau, size=2, columns=names)
    folds = gather_folds(information, estimate(information, "ols"), np.zeros(k, bool))
    counts = rng.multinomial(drawn, np.full(40, 1 / 40)).astype(float)
    at = np.repeat(np.arange(80), np.repeat(counts, 2).astype(int))
    fold = np.repeat(folds.fold[folds.stretch], 2)[at]
    fit, compared = folds.fit(counts), 0
    ties = [Move(Kind.TIE, tie=((f"p{j}", f"p{j + 1}"),)) for j in range(9)]
    drops = [Move(Kind.DROP, (names[j],)) for j in rng.permutation(k)[:-1]]
    for move in [*ties, *drops]:
        fit = fit.after(move)
        M = fit.partition.matrix
        whole = np.linalg.pinv(W[at, 0] @ M)
        C = fit.refits.C
        found, ridge = (folds.inverse @ x @ folds.inverse.T for x in (C, RIDGE * C @ C))
        for f in range(-1, folds.count):
            mine = fold != f
            A = W[at, 0][mine] @ M
            if not M.size or np.linalg.cond(A) > 1e5:  # the replicate does not determine it
                continue
            x = M @ np.linalg.lstsq(A, tau[at, 0][mine], rcond=None)[0]
            np.testing.assert_allclose(fit.values[f + 1], x, atol=1e-8 * np.abs(x).max())
            if f < 0:
                expected = M @ whole @ whole.T @ M.T
                atol = 1e-8 * np.abs(expected).max() + np.abs(ridge).max()
                np.testing.assert_allclose(found, expected, rtol=0, atol=atol)
            compared += 1
    assert compared > 200


def test_nested_models_are_fitted_together_as_they_are_one_by_one():
    """Down from a tie, two columns at once among them; 12 columns alike in fours."""
    rng = np.random.default_rng(5)
    W = rng.normal(size=(160, 2, 12)) + 30 * np.repeat(rng.normal(size=(160, 2, 3)), 4, 2)
    unseen = rng.normal(size=(40, 2, 12))
    W[:, 0, :4] = unseen[:, 0, :4] = 0.0  # what the first joint does not move
    tau = W @ np.linspace(0.0, 2.0, 12) + rng.normal(size=(160, 2))
    information = gather(W, tau, size=2)
    folds = gather_folds(information, estimate(information, "ols"), np.zeros(12, bool), unseen)
    start = folds.fit().after(Move(Kind.TIE, tie=(("p0", "p1"),)))
    drops = (("p3",), ("p0", "p1"), ("p7", "p8"), *((f"p{j}",) for j in (2, 4, 5, 6, 9, 10, 11)))
    fits = [start]
    for names in drops:
        fits.append(fits[-1].after(Move(Kind.DROP, names)))
    models = [(fit.partition, len(fit.refits.held)) for fit in fits]
    together = start.along(fits[-1].refits.held, models)
    alone = start.refits._one_by_one(fits[-1].refits.held, [count for _, count in models])
    np.testing.assert_array_equal(alone, [fit.refits.delta for fit in fits])
    for found, one in zip(together, fits, strict=True):
        size = np.abs(one.values).max() + np.abs(start.values).max()
        np.testing.assert_allclose(found.values, one.values, rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(found.errors().held, one.errors().held, rtol=1e-7)
        scatter = found.errors().scatter, one.errors().scatter
        np.testing.assert_allclose(*scatter, rtol=1e-6, atol=1e-12)


def test_a_joint_that_surely_rises_is_seen_beside_one_that_scatters():
    """Sixteen stretches; one joint's errors are a hundred times as large and scatter as much."""
    rng = np.random.default_rng(0)
    large, small = 100 * rng.exponential(size=16), rng.exponential(size=16)
    change = rng.normal(size=(2, 16))
    one = Errors(np.stack([large, small], 1), np.zeros((16, 2)))
    more = np.stack([10 * (change[0] - change[0].mean()), 0.5 + 0.1 * change[1]], 1)
    other = Errors(one.held + more, np.zeros((16, 2)))
    rise, spread = other.above(one)
    assert 0 < rise < spread  # the sum does not see it
    np.testing.assert_array_equal(other.joints_above(one), [False, True])
    assert not other.as_good(one)
    assert one.as_good(other)
    assert not other.near(one)
    assert Errors(one.held + more * [0.1, 0.0], np.zeros((16, 2))).near(one)
