"""The judge: densities by brute force, levels at their rates, and what nothing may depend on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, nct, t

from identifiability.estimation.estimate import estimate
from identifiability.estimation.evidence import (
    Evidence,
    Folds,
    Gain,
    HeldOut,
    Level,
    Score,
    mix_labels,
    near_best,
    weigh_models,
)
from identifiability.estimation.noise import Noise
from identifiability.foundation.errors import LogError
from identifiability.workflows.answers import level_table

from .made import ar1, gather

WHITE = Noise.of(np.array([0.25, 4.0]), np.ones(2))


def rows(seed=0, N=240, k=4, n=2):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(N, n, k))
    return W, W @ np.arange(1.0, k + 1) + rng.normal(size=(N, n)) * [0.5, 2.0]


def drop(held, columns=()):
    """Return the score of the model without some columns, joints weighted by their noise."""
    M = np.delete(np.eye(held.information.size), columns, axis=1)
    fit = estimate(held.information.reduce(M, [f"p{j}" for j in range(M.shape[1])]), "ols")
    return held.score_fit(replace(fit, weights=1 / held.noise), M)


def test_densities_are_those_of_the_normal_distribution_of_a_fold():
    W, tau = rows()
    information = gather(W, tau, size=6)
    folds = Folds.of(information, 7.0)
    held = HeldOut.of(information, WHITE, folds)
    fit = estimate(information, "ols")
    found = held.score_fit(fit)
    S = WHITE.variance
    test = np.repeat(folds.test, 6)
    for f in range(folds.count):
        train, own = np.repeat(folds.train[f], 6), test == f
        X, y = W[train].reshape(-1, 4), tau[train].ravel()
        weight = np.tile(1 / S, train.sum())
        value = np.linalg.lstsq(X, y, rcond=None)[0]
        covariance = np.linalg.inv(X.T @ (weight[:, None] * X))
        A, e = W[own].reshape(-1, 4), tau[own].ravel()
        noise = np.diag(np.tile(S, own.sum()))
        law = multivariate_normal(A @ value, noise + A @ covariance @ A.T)
        constant = -0.5 * np.linalg.slogdet(2 * np.pi * noise)[1]
        np.testing.assert_allclose(found.density[f], law.logpdf(e) - constant, rtol=1e-8)
        left = (tau[own] - W[own] @ value) ** 2
        np.testing.assert_allclose(found.squares[f], left.sum(0), rtol=1e-8)


def test_folds_leave_out_the_memory_on_both_sides_and_do_not_cross_logs():
    W, tau = rows(N=300)
    information = gather(W, tau, size=5, logs=(200, 100))
    folds = Folds.of(information, 12.0)
    assert 5 <= folds.count <= 11
    log, test = np.repeat(information.log, 5), np.repeat(folds.test, 5)
    for f, train in enumerate(np.repeat(folds.train, 5, axis=1)):
        own = np.flatnonzero(test == f)
        assert len(set(log[own])) == 1
        assert (np.diff(own) == 1).all()
        apart = np.abs(np.flatnonzero(train)[:, None] - own).min(1)
        same = log[train] == log[own[0]]
        assert (apart[same] > 12).all()
        assert train[log != log[own[0]]].all()
    assert Folds.of(gather(W, tau, size=5, logs=(60,) * 5), 12.0).count == 5


@pytest.mark.parametrize("memory", [61.0, 1000.0])
def test_a_log_too_short_for_five_folds_is_refused_in_one_sentence(memory):
    W, tau = rows(N=300)
    with pytest.raises(LogError, match="stretches that can be predicted from the others; a choice"):
        Folds.of(gather(W, tau), memory)


def test_a_against_b_is_minus_b_against_a():
    held = HeldOut.of(gather(*rows()), WHITE)
    a, b = drop(held), drop(held, [0])
    one, other = Evidence.of(a, b), Evidence.of(b, a)
    for x, y in zip(
        (one.density, one.error, *one.joint_errors),
        (other.density, other.error, *other.joint_errors),
        strict=True,
    ):
        np.testing.assert_allclose([x.value, x.se], [-y.value, y.se], rtol=1e-10)
    assert (one.level, other.level) == (Level.BETTER, Level.WORSE)
    assert Evidence.of(a, a).level is Level.AS_GOOD


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_of_models_that_are_equally_good_few_are_called_better_or_worse(rho):
    """Each has one column that acts and another that does not: they are exchangeable."""
    rng, called, trials = np.random.default_rng(5), 0, 120
    for _ in range(trials):
        W = np.stack([ar1(rng, 0.95, 300, 3) for _ in range(2)], 1)
        tau = W[:, :, 0] + ar1(rng, rho, 300, 2)
        information = gather(W, tau, size=4)
        held = HeldOut.of(information, Noise.of(np.ones(2), np.full(2, (1 + rho) / (1 - rho))))
        level = Evidence.of(drop(held, [1]), drop(held, [2])).level
        called += level in {Level.BETTER, Level.WORSE}
    assert called / trials <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / trials)


@pytest.mark.parametrize("off", [0.05, 0.1])
def test_a_planted_gain_is_found_as_often_as_theory_says(off):
    """A value that is wrong by d costs d² Σx² ± 2 d σ √Σx²: the rest is Student's t."""
    rng, trials, N = np.random.default_rng(2), 150, 1200
    W = rng.normal(size=(N, 1, 1))
    noise = Noise.of(np.ones(1), np.ones(1))
    right = np.zeros((1, 1))
    found = 0
    for _ in range(trials):
        held = HeldOut.of(gather(W, rng.normal(size=(N, 1)), size=12), noise)
        a, b = (held.score(x, right) for x in (np.zeros(1), np.full(1, off)))
        found += Evidence.of(a, b).level is Level.BETTER
    K = held.folds.count
    power = nct.sf(t.ppf(0.975, K - 1), K - 1, 0.5 * off * np.linalg.norm(W))
    assert abs(found / trials - power) < 3 * np.sqrt(power * (1 - power) / trials) + 0.03


def test_nothing_depends_on_units_or_on_how_rows_are_cut_into_blocks_and_ordered_in_them():
    W, tau = rows()
    unit, scale = np.array([1e3, 1e-3]), np.array([1.0, 1e4, 1e-4, 10.0])
    order = (np.arange(240).reshape(-1, 4)[:, ::-1]).ravel()

    def judged(W, tau, noise, size):
        information = gather(W, tau, size=size)
        held = HeldOut.of(information, noise, Folds.of(information, 8.0))
        found = Evidence.of(drop(held), drop(held, [1]))
        gains = (found.density, found.error, *found.joint_errors)
        return [x for gain in gains for x in (gain.value, gain.se)]

    plain = judged(W, tau, WHITE, 8)
    other = Noise.of(WHITE.variance * unit**2, WHITE.times)
    moved = judged(W * unit[:, None] * scale, tau * unit, other, 8)
    np.testing.assert_allclose(moved, plain, rtol=1e-6)
    np.testing.assert_allclose(judged(W, tau, WHITE, 4), plain, rtol=1e-6)
    np.testing.assert_allclose(judged(W[order], tau[order], WHITE, 8), plain, rtol=1e-6)


def test_standard_errors_know_that_folds_share_data():
    squares = np.random.default_rng(0).uniform(1, 2, (8, 1))
    plain, wide = (
        Evidence.of(
            *(Score.of_errors(x, np.ones(1), r) for x in (squares, squares[::-1] + 1))
        ).error
        for r in (0.0, 1 / 7)
    )
    assert plain.value == wide.value
    np.testing.assert_allclose(wide.se / plain.se, np.sqrt((1 / 8 + 1 / 7) / (1 / 8)))


def test_levels_follow_from_the_limits_of_the_gain():
    def level(value, se, folds=10):
        gain = Gain(value, se)
        return Evidence(gain, gain, (gain,), folds).level

    assert level(0.03, 0.01) is Level.BETTER
    assert level(-0.03, 0.01) is Level.WORSE
    assert level(0.0, 0.005) is Level.AS_GOOD
    assert level(0.0, 0.05) is Level.OPEN
    assert level(1.0, 0.0, folds=1) is Level.OPEN
    assert {row[0].text for row in level_table().rows} >= {x.value for x in Level}


def scores_of(densities, squares):
    pairs = zip(densities, squares, strict=True)
    return [Score(d, q[:, None], np.ones(1), 1 / 9) for d, q in pairs]


def test_models_within_two_nats_or_as_good_may_stand_for_the_best_and_equal_ones_weigh_alike():
    densities = np.full((4, 10), -3.0) + np.array([0.0, 0.1, -0.05, -1.0])[:, None]
    squares = np.repeat([[1.0], [1.0], [1.0], [1.5]], 10, axis=1)
    assert near_best(scores_of(densities, squares)).tolist() == [True, True, True, False]
    # Of many samples ten nats are no error that anybody would see.
    squares[3] = np.random.default_rng(0).normal(1.004, 0.004, 10)
    assert near_best(scores_of(densities, squares)).all()
    weights = weigh_models(densities[[0, 0, 3]], np.random.default_rng(0))
    np.testing.assert_allclose(weights, [0.5, 0.5, 0.0], atol=1e-3)


def test_a_mixture_holds_what_models_disagree_on():
    values, sigmas = np.array([[1.0, 2.0], [3.0, 2.0]]), np.full((2, 2), 0.1)
    found = mix_labels(np.array([0.5, 0.5]), values, sigmas)
    np.testing.assert_allclose(found.value, [2.0, 2.0])
    np.testing.assert_allclose(found.sigma, [np.hypot(1.0, 0.1), 0.1])
    np.testing.assert_allclose([found.low, found.high], [[1.0, 2.0], [3.0, 2.0]])


def test_a_model_that_leaves_a_label_open_has_no_say_in_it_and_light_ones_are_not_named():
    values = np.array([[1.0, 2.0], [3.0, 2.0], [9.0, 9.0]])
    sigmas = np.array([[0.1, 0.1], [np.inf, 0.1], [0.1, 0.1]])
    found = mix_labels(np.array([0.5, 0.49, 0.01]), values, sigmas)
    np.testing.assert_allclose(found.value, [(0.5 + 0.09) / 0.51, 2.07])
    np.testing.assert_allclose(found.high, [1.0, 2.0])
    nobody = mix_labels(np.ones(1), np.ones((1, 1)), np.full((1, 1), np.inf))
    assert np.isinf(nobody.sigma).all()
