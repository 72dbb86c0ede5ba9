"""What constrained fits predict of folds: values, squares and densities from the rows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Information, estimate
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.evidence import HeldOut
from identifiability.workflows.prune.elimination import Remaining, whiten_regression
from identifiability.workflows.prune.moves import Kind, Move

from .made import gather, score_of

WEIGHTS = np.array([4.0, 0.25])


@pytest.fixture(scope="module")
def rows():
    rng = default_rng(0)
    W = rng.normal(size=(320, 2, 3))
    W[:, 0, 0] = 0.0  # in a tree a joint does not feel every column
    return W, W @ [1.0, -2.0, 0.1] + rng.normal(size=(320, 2)) * [0.5, 2.0]


def matrix_of(partition):
    return np.stack([partition.group == g for g in partition.leaders], 1).astype(float)


def folds_of(rows):
    information = gather(*rows, size=8, logs=())
    full = estimate(information, "ols")
    full = replace(full, weights=WEIGHTS, variance=1.0 / WEIGHTS, times=np.ones(2))
    return whiten_regression(information, full)


def after(folds, *moves):
    """Return the model after some moves, with its fits."""
    path = [(None, folds.start)]
    for move in moves:
        path.append((move, path[-1][1].apply(move)))
    return folds.along(path)[-1]


def solve(W, tau):
    root = np.sqrt(WEIGHTS)
    flat = (W * root[:, None]).reshape(-1, W.shape[2])
    return np.linalg.lstsq(flat, (tau * root).ravel(), rcond=None)[0]


def sums(W, tau, x):
    return float((((tau - W @ x) ** 2) @ WEIGHTS).sum())


DROP, TIE = Move(Kind.DROP, ("p2",)), Move(Kind.TIE, tie=(("p0", "p1"),))


@pytest.mark.parametrize("moves", [(), (DROP,), (TIE,), (TIE, DROP)])
def test_densities_are_the_judges(rows, moves):
    folds = folds_of(rows)
    information = gather(*rows, size=8)
    full = estimate(information, "ols")
    noise = replace(full, variance=1.0 / WEIGHTS, times=np.ones(2))
    fixed = HeldOut.of(information, noise, folds.folds)
    # The variance of noise of weight 1 is the fit's own: 1 where weights are those of the noise.
    fit = after(replace(folds, unit=1.0), *moves)
    M = matrix_of(fit.partition)
    own = estimate(information.reduce(M, [f"c{j}" for j in range(M.shape[1])]), "ols")
    expected = score_of(fixed, replace(own, weights=WEIGHTS), M)
    assert_allclose(fit.score.density, expected.density, rtol=1e-6)
    assert_allclose(fit.score.squares, expected.squares, rtol=1e-6)


def test_fits_by_instruments_are_the_estimators_own():
    rng = default_rng(3)
    V = rng.normal(size=(200, 2, 20))
    W = V + 1.5 * rng.normal(size=V.shape)
    tau = V @ np.linspace(-2.0, 2.0, 20) + 0.3 * rng.normal(size=V.shape[:2])
    names = tuple(f"p{j}" for j in range(20))
    log = np.zeros(200, int)
    estimator = Estimator(weighted=False, instruments=True)
    information = Information.of_rows(names, W, tau, log, 4, V)
    full = estimator.fit(information)
    folds = whiten_regression(information, full)
    assert_allclose(after(folds).values[0], full.value, rtol=1e-6)
    assert np.linalg.eigvalsh(folds.refits.grams[0]).min() > 0
    dropped = after(folds, Move(Kind.DROP, ("p0",)))
    assert_allclose(dropped.values[0][0], 0.0, atol=1e-9)


@pytest.mark.parametrize("move", [DROP, TIE, Move(Kind.DROP, ("p0", "p2"))])
def test_a_constraint_costs_what_refitting_with_it_costs(rows, move):
    W, tau = rows
    folds = folds_of(rows)
    fit = after(folds, move)
    M = matrix_of(fit.partition)
    x = M @ solve(W @ M, tau)
    assert_allclose(fit.values[0], x, atol=1e-7)
    start = Remaining.of(folds)
    left, found = start.after(move)
    rise = sums(W, tau, x) - sums(W, tau, solve(W, tau))
    assert_allclose(left.values, x, atol=1e-7)
    assert found == pytest.approx(rise, rel=1e-6)
    assert start.cost(move) == pytest.approx(rise / (3 - len(fit.partition)), rel=1e-6)


def test_what_holds_already_costs_nothing_and_changes_nothing(rows):
    """Of three ties in a ring the last follows from the others; costs are a parameter's."""
    ring = Move(Kind.TIE, tie=(("p0", "p1"), ("p1", "p2"), ("p2", "p0")))
    chain = Move(Kind.TIE, tie=(("p0", "p1", "p2"),))
    folds = folds_of(rows)
    start = Remaining.of(folds)
    assert_allclose(start.cost(ring), start.cost(chain), rtol=1e-9)
    assert_allclose(after(folds, ring).values, after(folds, chain).values, rtol=1e-9)


@pytest.mark.parametrize("seed, drawn", [(0, 40), (1, 40), (2, 24)])
def test_fits_along_a_whole_path_are_those_from_the_rows(seed, drawn):
    """40 columns, nearly alike in tens, of up to 80 samples, few of which hardly determine them."""
    rng = default_rng(seed)
    k = 40
    names = tuple(f"p{j}" for j in range(40))
    n = 2 * drawn
    W = rng.normal(size=(n, 1, k)) + 1e3 * np.repeat(rng.normal(size=(n, 1, 4)), 10, 2)
    tau = rng.normal(size=(n, 1))
    information = gather(W, tau, size=2, columns=names)
    folds = whiten_regression(information, estimate(information, "ols"))
    train = np.repeat(folds.folds.train, 2, axis=1)
    ties = [Move(Kind.TIE, tie=((f"p{j}", f"p{j + 1}"),)) for j in range(9)]
    drops = [Move(Kind.DROP, (names[j],)) for j in rng.permutation(k)[:-1]]
    path = [(None, folds.start)]
    compared = 0
    for move in [*ties, *drops]:
        path.append((move, path[-1][1].apply(move)))
    for fit in folds.along(path):
        M = matrix_of(fit.partition)
        for f in range(-1, folds.folds.count):
            mine = train[f] if f >= 0 else np.ones(n, bool)
            A = W[mine, 0] @ M
            if (
                not M.size or len(A) < M.shape[1] or np.linalg.cond(A) > 1e5
            ):  # its rows do not determine it
                continue
            x = M @ np.linalg.lstsq(A, tau[mine, 0], rcond=None)[0]
            assert_allclose(fit.values[f + 1], x, atol=1e-8 * np.abs(x).max())
            compared += 1
    assert compared > 200
