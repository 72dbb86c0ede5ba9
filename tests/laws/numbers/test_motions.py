"""Logs that agree change nothing; what scatters between logs is in the interval, and is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, norm, ttest_ind_from_stats

from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import ScoreScatter, _excess, _pool, _welch, compare_motions
from identifiability.estimation.rules import Thresholds
from identifiability.regression.information import Information

from .made import ar1, fit_known, fit_of

SAMPLES, BLOCK, TIME = 720, 8, 9.0
VALUES = np.array([2.0, -1.0, 0.5, 3.0])


def motion(rng, samples=SAMPLES):
    """Columns of one motion of two actuators: of different size and not at right angles."""
    t = np.arange(samples)[:, None] / samples * 2 * np.pi
    waves = np.sin(t * rng.integers(3, 20, 4) + rng.uniform(0, 6, 4))
    W = np.stack([waves, np.sign(np.roll(waves, 5, 1))], 1) * [1.0, 0.3, 2.0, 1.0]
    W[:, 1, 0] += W[:, 1, 3]
    return W


def compare(values, seed, noise=0.5, rho=0.8, change=None):
    """Return what logs with these values (L, 4) say, and the fit to all of them."""
    rng = np.random.default_rng(seed)
    W = [motion(rng) for _ in values]
    tau = [w @ x + noise * ar1(rng, rho, len(w), 2) for w, x in zip(W, values, strict=True)]
    W, log = np.concatenate(W), np.repeat(np.arange(len(values)), SAMPLES)
    if change is not None:
        W = change(W, log)
    information = Information.of_rows("abcd", W, np.concatenate(tau), log, BLOCK)
    fit = estimate(information)
    return compare_motions(information, fit, TIME), fit


def shifted(logs, odd, change):
    values = np.tile(VALUES, (logs, 1))
    values[odd] += change
    return values


@pytest.mark.parametrize("logs", [2, pytest.param(3, marks=pytest.mark.everything)])
def test_logs_of_one_robot_are_seldom_said_to_differ_and_then_add_nothing(logs):
    trials = 40
    found = [compare(np.tile(VALUES, (logs, 1)), [logs, seed])[0] for seed in range(trials)]
    fired = sum(not m.agree for m in found)
    assert fired <= binom.ppf(0.999, trials, 2 * Thresholds.sign_level)  # two tests
    for m in found:
        assert (m.between.max() > 0) == (not m.agree)
    assert fired < trials / 2


def test_the_parameter_that_differs_in_a_log_is_named():
    named = []
    for seed in range(30):
        odd = seed % 3
        m, _ = compare(shifted(3, odd, [0, 0, 0.4, 0]), [5, seed])
        named.append(m.moved[2] and m.p.argmin() == 2 and m.values[:, 2].argmax() == odd)
    assert np.mean(named) >= 0.9


@pytest.mark.everything
def test_the_interval_holds_another_motions_values_where_motions_scatter():
    held, plain, alone = [], [], []
    for seed in range(40):
        rng = np.random.default_rng([8, seed])
        scatter = 0.25 * rng.standard_normal((5, 4)) * [1.0, 3.0, 0.5, 1.0]
        m, fit = compare(VALUES + scatter[:4], [9, seed])
        sigma = np.sqrt(1.0 / (m.sd**-2.0).sum(0))
        off = np.abs(VALUES + scatter[4] - fit.value)
        held.append(off <= 1.96 * np.hypot(sigma, m.between))
        plain.append(off <= 1.96 * sigma)
        alone.append(np.abs(m.values - fit.value) <= 1.96 * np.hypot(sigma, m.between))
    assert np.mean(plain) < 0.6
    assert np.mean(held) >= 0.9  # ± .02
    assert np.mean(alone) >= 0.95


def test_the_variance_ratio_is_that_of_the_values():
    ratios, truth = [], []
    for seed in range(24):
        rng = np.random.default_rng([3, seed])
        m, _ = compare(np.tile(VALUES, (3, 1)), [4, seed])
        off = np.sqrt(8.0) * m.sd * rng.standard_normal(m.sd.shape)
        again, _ = compare(VALUES + off, [4, seed])
        ratios.append(again.ratio)
        truth.append(9.0)
    assert 4.5 < np.median(ratios) < 12.0  # few logs: χ² of 8 degrees, spread of 50 %
    assert again.ratio_dof == pytest.approx(8, abs=2)


def test_what_all_motions_scatter_more_than_noise_is_their_variance_times_the_excess():
    """Of three equally well known motions: as much more than one's own variance, not the mean's."""
    m, _ = compare(np.tile(VALUES, (3, 1)), 7)
    sd = np.full((3, 4), 0.2)
    alike = replace(
        m, values=np.tile(VALUES, (3, 1)), sd=sd, p=np.ones(4), ratio=3.5, ratio_dof=1e9
    )
    np.testing.assert_allclose(_excess(alike, np.ones(4), VALUES), 0.2**2 * 2.5, rtol=1e-4)


def test_two_logs_are_compared_by_welchs_t_test():
    values, sd, dof = (
        np.array([[1.0, 2.0], [1.5, 1.0]]),
        np.array([[0.2, 0.3], [0.1, 0.9]]),
        [11, 23],
    )
    _, p, d = _welch(values, sd, np.array(dof, float))
    counts = [n + 1 for n in dof]
    for k in range(2):
        spread = sd[:, k] * np.sqrt(counts)
        known = ttest_ind_from_stats(
            *(x for i in range(2) for x in (values[i, k], spread[i], counts[i])), equal_var=False
        )
        assert p[k] == pytest.approx(known.pvalue, rel=1e-9)
    assert list(d) == [1, 1]


def test_values_of_many_parameters_are_adjusted_for_their_number():
    m, _ = compare(np.tile(VALUES, (3, 1)), 2)
    _, p, _ = _welch(m.values, m.sd, np.full(3, 23.0))
    assert m.p.min() == pytest.approx(min(1.0, 4 * p.min()), rel=0.1)


def test_parameters_that_move_together_count_as_fewer():
    p, d = np.full(4, 0.01), np.full(4, 1)
    apart, together = (_pool(p, d, c) for c in (np.eye(4), np.ones((4, 4))))
    assert together[0] == pytest.approx(0.01)
    assert together[2] == pytest.approx(1.0)
    assert apart[0] < 1e-4
    assert apart[2] == pytest.approx(4.0)
    assert apart[1] == together[1] == pytest.approx(norm.isf(0.005) ** 2)


def test_what_only_one_motion_determines_is_not_compared():
    def still(W, log):
        W = W.copy()
        W[log == 1, :, 1] = 0.0
        return W

    m, _ = compare(shifted(2, 1, [1.0, 0, 0, 0]), 0, change=still)
    assert np.isinf(m.sd[1, 1])
    assert m.p[1] == 1.0
    assert m.between[1] == 0.0
    assert m.moved[0]
    assert m.between[0] > 0.3
    assert np.isfinite(m.between).all()


def test_one_log_short_logs_and_rounding_say_nothing():
    one, _ = compare(VALUES[None], 0)
    assert one is None
    exact, _ = compare(np.tile(VALUES, (2, 1)), 0, noise=0.0)
    assert exact is None
    rng = np.random.default_rng(0)
    W = motion(rng, 160)
    log = np.repeat([0, 1], 80)
    tau = W @ VALUES + 0.1 * rng.standard_normal((160, 2))
    short = Information.of_rows("abcd", W, tau, log, BLOCK)  # ten blocks each
    assert compare_motions(short, estimate(short), 1.0) is None


def test_what_scatters_between_logs_is_in_the_robust_deviation():
    m, _ = compare(shifted(2, 1, [0, 0, 2.0, 0]), 0)
    own = np.full(4, 0.1)
    scores = ScoreScatter(own, 1, np.full(4, 1e6))
    found = fit_known(fit_of(VALUES, own), scores, motions=m)
    np.testing.assert_allclose(found.robust, np.hypot(own, m.between), rtol=1e-5)
    assert found.robust[2] > 0.9  # both values, two apart, are within 1.96 of it


def test_a_log_of_fewer_rows_than_parameters_is_not_asked(monkeypatch):
    rng = np.random.default_rng(0)
    W = np.concatenate([motion(rng), motion(rng), motion(rng)[:2]])
    log = np.repeat([0, 1, 2], [SAMPLES, SAMPLES, 2])  # four rows for four parameters
    tau = W @ VALUES + 0.5 * rng.normal(size=(len(W), 2))
    information = Information.of_rows("abcd", W, tau, log, BLOCK)
    fit = estimate(information)
    asked = []
    plain = type(fit.estimator).fit

    def count(self, part):
        asked.append(part.rows)
        return plain(self, part)

    monkeypatch.setattr(type(fit.estimator), "fit", count)
    found = compare_motions(information, fit, 1.0)
    assert asked == [2 * SAMPLES, 2 * SAMPLES]
    assert found.which.tolist() == [0, 1]
