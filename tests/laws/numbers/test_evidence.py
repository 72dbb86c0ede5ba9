"""The judge: densities by brute force, levels at their rates, and what nothing may depend on."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal, nct, t

from identifiability import estimate
from identifiability.estimation.evidence import Evidence, Folds, Gain, HeldOut, Score, near_best
from identifiability.estimation.noise import Noise
from identifiability.workflows.prune.elimination import weigh_models

from ...marks import everything
from .made import ar1, gather, score_of

WHITE = Noise(np.array([0.25, 4.0]), np.ones(2))


def rows(N=240):
    rng = default_rng(0)
    W = rng.normal(size=(N, 2, 4))
    return W, W @ np.arange(1.0, 5.0) + rng.normal(size=(N, 2)) * [0.5, 2.0]


def drop(held, columns=()):
    """Return the score of the model without some columns, joints weighted by their noise."""
    M = np.delete(np.eye(held.information.size), columns, axis=1)
    fit = estimate(held.information.reduce(M, [f"p{j}" for j in range(M.shape[1])]), "ols")
    return score_of(held, replace(fit, weights=1 / held.noise), M)


def test_densities_are_those_of_the_normal_distribution_of_a_fold():
    W, tau = rows()
    information = gather(W, tau, size=6)
    folds = Folds.of(information, 7.0)
    held = HeldOut.of(information, WHITE, folds)
    fit = estimate(information, "ols")
    found = score_of(held, fit)
    test = np.repeat(folds.test, 6)
    for f in range(folds.count):
        train = np.repeat(folds.train[f], 6)
        own = test == f
        X = W[train].reshape(-1, 4)
        y = tau[train].ravel()
        value = np.linalg.lstsq(X, y, rcond=None)[0]
        weight = np.tile(1 / WHITE.variance, train.sum())
        covariance = np.linalg.inv(X.T @ (weight[:, None] * X))
        A = W[own].reshape(-1, 4)
        e = tau[own].ravel()
        noise = np.diag(np.tile(WHITE.variance, own.sum()))
        law = multivariate_normal(A @ value, noise + A @ covariance @ A.T)
        constant = -0.5 * np.linalg.slogdet(2 * np.pi * noise)[1]
        assert_allclose(found.density[f], law.logpdf(e) - constant, rtol=1e-7)
        left = (tau[own] - W[own] @ value) ** 2
        assert_allclose(found.squares[f], left.sum(0), rtol=1e-8)


def test_folds_leave_out_the_memory_on_both_sides_and_do_not_cross_logs():
    W, tau = rows(N=300)
    information = gather(W, tau, size=5, logs=(200, 100))
    folds = Folds.of(information, 12.0)
    assert 5 <= folds.count <= 11
    log = np.repeat(information.log, 5)
    test = np.repeat(folds.test, 5)
    for f, train in enumerate(np.repeat(folds.train, 5, axis=1)):
        own = np.flatnonzero(test == f)
        assert len(set(log[own])) == 1
        assert (np.diff(own) == 1).all()
        apart = np.abs(np.flatnonzero(train)[:, None] - own).min(1)
        same = log[train] == log[own[0]]
        assert (apart[same] > 12).all()
        assert train[log != log[own[0]]].all()
    assert Folds.of(gather(W, tau, size=5, logs=(60,) * 5), 12.0).count == 5


def test_a_region_of_the_motion_is_left_out_in_all_its_repetitions():
    W, tau = (np.concatenate([x, x, x]) for x in rows(N=60))
    folds = Folds.of_regions(gather(W, tau, size=5))
    assert folds.count == 4
    each = folds.test.reshape(3, 12)
    assert (each == each[0]).all()
    assert not (folds.train & folds.tested).any()


@pytest.mark.parametrize("memory", [61.0, 1000.0])
def test_a_log_too_short_for_five_folds_is_refused_in_one_sentence(memory, rejected):
    W, tau = rows(N=300)
    with rejected("stretches that can be predicted from the others; a choice"):
        Folds.of(gather(W, tau), memory)


@pytest.mark.parametrize("rho", [everything(0.0), 0.9])
def test_of_models_that_are_equally_good_few_are_called_better_or_worse(rho):
    """Each has one column that acts and another that does not: they are exchangeable."""
    rng = default_rng(5)
    called = 0
    trials = 120
    for _ in range(trials):
        W = np.stack([ar1(rng, 0.95, 300, 3) for _ in range(2)], 1)
        tau = W[:, :, 0] + ar1(rng, rho, 300, 2)
        information = gather(W, tau, size=4)
        held = HeldOut.of(information, Noise(np.ones(2), np.full(2, (1 + rho) / (1 - rho))))
        low, high = Evidence.of(drop(held, [1]), drop(held, [2])).limits
        called += low > 0 or high < 0
    assert called / trials <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / trials)


@pytest.mark.parametrize("off", [0.05, 0.1])
def test_a_planted_gain_is_found_as_often_as_theory_says(off):
    """A value that is wrong by d costs d² Σx² ± 2 d σ √Σx²: the rest is Student's t."""
    rng = default_rng(2)
    trials = 150
    N = 1200
    W = rng.normal(size=(N, 1, 1))
    noise = Noise(np.ones(1), np.ones(1))
    found = 0
    for _ in range(trials):
        held = HeldOut.of(gather(W, rng.normal(size=(N, 1)), size=12), noise)
        a, b = (held.score(x) for x in (np.zeros(1), np.full(1, off)))
        found += Evidence.of(a, b).limits[0] > 0
    K = held.folds.count
    power = nct.sf(t.ppf(0.975, K - 1), K - 1, 0.5 * off * np.linalg.norm(W))
    assert abs(found / trials - power) < 3 * np.sqrt(power * (1 - power) / trials) + 0.03


def test_nothing_depends_on_units_or_on_how_rows_are_cut_into_blocks_and_ordered_in_them():
    W, tau = rows()
    unit = np.array([1e3, 1e-3])
    scale = np.array([1.0, 1e4, 1e-4, 10.0])
    order = (np.arange(240).reshape(-1, 4)[:, ::-1]).ravel()

    def judged(W, tau, noise, size):
        information = gather(W, tau, size=size)
        held = HeldOut.of(information, noise, Folds.of(information, 8.0))
        found = Evidence.of(drop(held), drop(held, [1]))
        return [x for gain in (found.density, found.error) for x in (gain.value, gain.se)]

    plain = judged(W, tau, WHITE, 8)
    other = Noise(WHITE.variance * unit**2, WHITE.times)
    moved = judged(W * unit[:, None] * scale, tau * unit, other, 8)
    assert_allclose(moved, plain, rtol=1e-6)
    assert_allclose(judged(W, tau, WHITE, 4), plain, rtol=1e-6)
    assert_allclose(judged(W[order], tau[order], WHITE, 8), plain, rtol=1e-6)


def test_standard_errors_know_that_folds_share_data():
    squares = default_rng(0).uniform(1, 2, (8, 1))
    plain, wide = (
        Evidence.of(
            *(Score(-x[:, 0], x, np.ones(1), r) for x in (squares, squares[::-1] + 1))
        ).error
        for r in (0.0, 1 / 7)
    )
    assert plain.value == wide.value
    assert_allclose(wide.se / plain.se, np.sqrt((1 / 8 + 1 / 7) / (1 / 8)))


def test_one_fold_tells_nothing_and_what_errs_little_more_may_stand():
    def of(value, se, folds=10):
        gain = Gain(value, se)
        return Evidence(gain, gain, folds)

    assert of(0.03, 0.01).limits[0] > 0 > of(-0.03, 0.01).limits[1]
    assert of(0.0, 0.005).replaceable
    assert not of(0.0, 0.05).replaceable
    assert of(1.0, 0.0, folds=1).limits == (-np.inf, np.inf)


def test_models_within_two_nats_or_as_good_may_stand_for_the_best_and_equal_ones_weigh_alike():
    squares = np.full((4, 10), 6.0) + np.array([0.0, -0.2, 0.1, 2.0])[:, None]

    def near(squares, noise=1.0):
        own = [Score(-0.5 * x / noise, x[:, None], np.ones(1), 1 / 9) for x in squares]
        return near_best(own).tolist()

    assert near(squares) == [True, True, True, False]
    # Of many samples ten nats are no error that anybody would see.
    light = np.array([squares[0], squares[0], squares[0] + 2.0])
    squares[1:] = 6.0 * default_rng(0).normal(1.004, 0.004, (3, 10))
    assert near(squares, 0.01) == [True, True, True, True]
    weights = weigh_models(-0.5 * light, default_rng(0))
    assert_allclose(weights, [0.5, 0.5, 0.0], atol=1e-3)
