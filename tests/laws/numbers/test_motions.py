"""Logs that agree change nothing; what scatters between logs is in the interval, and is named."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.stats import ttest_ind_from_stats

from identifiability import Information, Thresholds, estimate
from identifiability.estimation.fit import ScoreScatter, _differ, compare_motions

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


def ask(information, time=TIME):
    fit = estimate(information)
    return compare_motions(information, fit, time), fit


def compare(values, seed, noise=0.5, rho=0.8, change=None, names=("j.a", "j.b", "j.c", "j.d")):
    """Return what logs with these values (L, 4) say, and the fit to all of them."""
    rng = default_rng(seed)
    W = [motion(rng) for _ in values]
    tau = [w @ x + noise * ar1(rng, rho, len(w), 2) for w, x in zip(W, values, strict=True)]
    W = np.concatenate(W)
    log = np.repeat(np.arange(len(values)), SAMPLES)
    if change is not None:
        W = change(W, log)
    return ask(Information.of_rows(names, W, np.concatenate(tau), log, BLOCK))


def shifted(logs, odd, change):
    values = np.tile(VALUES, (logs, 1))
    values[odd] += change
    return values


def test_logs_of_one_robot_are_seldom_said_to_differ_and_then_add_nothing():
    trials = 100
    found = [compare(np.tile(VALUES, (2, 1)), [2, seed])[0] for seed in range(trials)]
    assert sum(bool(m.moved.any()) for m in found) <= Thresholds.sign_level * trials
    for m in found:
        assert (m.between.max() > 0) == bool(m.moved.any())


@pytest.mark.everything
def test_the_interval_holds_another_motions_values_where_motions_scatter():
    held = []
    plain = []
    for seed in range(40):
        scatter = 0.25 * default_rng([8, seed]).standard_normal((5, 4)) * [1.0, 3.0, 0.5, 1.0]
        m, fit = compare(VALUES + scatter[:4], [9, seed], names=("a.x", "b.x", "c.x", "d.x"))
        sigma = np.sqrt(1.0 / (m.sd**-2.0).sum(0))
        off = np.abs(VALUES + scatter[4] - fit.value)
        held.append(off <= 1.96 * np.hypot(sigma, m.between))
        plain.append(off <= 1.96 * sigma)
    assert np.mean(plain) < 0.6
    assert np.mean(held) >= 0.9  # ± .02


def test_a_kind_of_parameter_has_one_excess_and_others_have_none():
    m, _ = compare(shifted(3, 1, [0, 0, 0.5, 0]), 1, names=("j1.m", "j1.Fc", "j2.Fc", "j2.mx"))
    assert m.moved.tolist() == [False, False, True, False]
    assert (m.between > 0).tolist() == [False, True, True, False]


def test_two_logs_are_compared_by_a_t_test():
    values = np.array([[1.0, 2.0], [1.5, 1.0]])
    sd = np.full((2, 2), 0.3)
    counts = [16, 16]
    _, p, d = _differ(values, sd, np.array(counts) - 1.0)
    for k in range(2):
        spread = sd[:, k] * 4.0
        known = ttest_ind_from_stats(
            *(x for i in range(2) for x in (values[i, k], spread[i], counts[i]))
        )
        assert p[k] == pytest.approx(known.pvalue, rel=1e-9)
    assert list(d) == [1, 1]


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


def test_one_log_short_logs_and_rounding_say_nothing(rng):
    one, _ = compare(VALUES[None], 0)
    assert one is None
    exact, _ = compare(np.tile(VALUES, (2, 1)), 0, noise=0.0)
    assert exact is None
    W = motion(rng, 80)[::8]
    log = np.repeat([0, 1], 5)
    tau = W @ VALUES + 0.1 * rng.standard_normal((10, 2))
    assert ask(Information.of_rows(("a", "b", "c", "d"), W, tau, log, 1), 1.0)[0] is None


def test_what_scatters_between_logs_is_in_the_robust_deviation():
    m, _ = compare(shifted(2, 1, [0, 0, 2.0, 0]), 0)
    own = np.full(4, 0.1)
    found = fit_known(fit_of(VALUES, own), ScoreScatter(own, np.full(4, 1e9)), motions=m)
    assert_allclose(found.robust, np.hypot(own, m.between), rtol=1e-5)
    assert found.robust[2] > 0.9  # both values, two apart, are within 1.96 of it


def test_a_log_of_fewer_rows_than_parameters_says_nothing(rng):
    W = np.concatenate([motion(rng), motion(rng), motion(rng)[:2]])
    log = np.repeat([0, 1, 2], [SAMPLES, SAMPLES, 2])  # four rows for four parameters
    tau = W @ VALUES + 0.5 * rng.normal(size=(len(W), 2))
    m, _ = ask(Information.of_rows("abcd", W, tau, log, BLOCK), 1.0)
    assert m.which.tolist() == [0, 1]
    assert not m.moved.any()
