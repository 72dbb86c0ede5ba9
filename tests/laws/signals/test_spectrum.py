"""The band of a motion and the noise under it, on sinusoids, white noise and staircases."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Log, Preparation, prepare_log
from identifiability.logs import signals
from identifiability.logs.gaps import StaleRule, find_stale, interpolate
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Spectrum, choose_band


def swing(t, hertz=1.0, size=0.5):
    return size * np.sin(2 * np.pi * hertz * t + 0.3)


def times(rate, seconds=20.0):
    return np.arange(int(seconds * rate)) / rate


def band(q, rate, order=2, **options):
    q = q[:, None] if q.ndim == 1 else q
    return choose_band([Spectrum.of([q], 1 / rate, order)], **options)


@pytest.mark.parametrize("order", [1, 2])
def test_white_noise_has_its_density_and_what_it_becomes_in_an_acceleration(order):
    rate = 500.0
    sd = 0.02
    noise = sd * default_rng(0).standard_normal((40_000, 2))
    s = Spectrum.of([noise], 1 / rate, order)
    assert s.noise[100:].mean(0) == pytest.approx(2 * sd**2 / rate, rel=0.1)
    assert s.motion.max() == 0.0
    smooth = signals.lowpass(noise, 1 / rate, 20.0)
    for _ in range(order):
        smooth = signals.differentiate(smooth, 1 / rate)
    # The filter is no step: ∫ x^(2m) / (1 + x⁸)² dx instead of ∫₀¹ x^(2m) dx.
    x = np.linspace(0, 10, 100_001)
    shape = (x ** (2 * order) / (1 + x**8) ** 2).sum() * x[1] * (2 * order + 1)
    power = (smooth[1000:-1000] ** 2).mean(0)
    assert power == pytest.approx(shape * s.noise_in_acceleration(20.0), rel=0.2)
    assert 0.75 < shape < 1


@pytest.mark.parametrize("sd, order", [(2e-4, 2), (1e-3, 2), (2e-2, 1)])
def test_noise_lowers_the_cut_off_to_where_it_has_its_share(sd, order):
    rate = 200.0
    t = times(200.0)
    x = swing(t) if order == 2 else np.gradient(swing(t), 1 / rate)
    x = x + sd * default_rng(1).standard_normal(len(t))
    found = band(x, rate, order)
    signal = 0.5 * (0.5 * (2 * np.pi) ** 2) ** 2
    m = 2 * order
    power = LOG_RULES.small * signal * (m + 1) / (2 * sd**2 / rate * (2 * np.pi) ** m)
    limit = power ** (1 / (m + 1))
    assert found.bandwidth == pytest.approx(1.0, abs=0.06)
    assert found.limit == pytest.approx(limit, rel=0.1)
    assert found.outputs == pytest.approx(min(limit, 10.0), rel=0.1)
    assert found.noise <= LOG_RULES.small * 1.001
    assert ("noise has more than" in found.reason) == (limit < 10)


def test_the_cut_off_stays_two_bands_above_however_loud_the_noise():
    rate = 100.0
    t = times(100.0)
    loud = swing(t) + 0.5 * default_rng(2).standard_normal(len(t))
    found = band(loud, rate)
    assert found.outputs == pytest.approx(2 * found.bandwidth, rel=1e-9)
    assert found.noise > 0.05
    assert "although noise has" in found.reason
    given = band(loud, rate, cutoff=20.0)
    assert (given.cutoff, given.limit, given.reason) == (20.0, found.limit, "")
    assert given.noise > 10 * found.noise


@pytest.mark.parametrize("rate", [100, 1000, 10_000])
@pytest.mark.parametrize("step", [1e-5, 1e-3, 5e-3])
def test_an_encoder_does_not_pass_for_fast_motion(rate, step):
    t = times(rate, 7.5)
    found = band(np.round((swing(t) + swing(t, 0.4)) / step) * step, rate)
    # Lines of the spectrum are 0.13 Hz apart, and a taper spreads a swing over its neighbours.
    assert 0.99 < found.bandwidth < 1.28
    assert found.outputs <= 10 * found.bandwidth
    if step == 1e-5 or (step == 1e-3 and rate >= 1000):
        assert found.outputs == pytest.approx(10 * found.bandwidth)


def test_steps_that_last_many_samples_are_no_motion():
    t = times(10_000, 7.5)
    found = band(np.round(swing(t, size=0.02) / 1e-3) * 1e-3, 10_000)
    assert 0.99 < found.bandwidth < 1.28
    assert found.outputs < 10


def test_a_joint_that_hardly_moves_does_not_lower_the_cut_off_of_the_others():
    t = times(200.0)
    noise = 1e-3 * default_rng(3).standard_normal((len(t), 2))
    moves = swing(t)
    assert band(np.stack([moves, 0.02 * moves], 1) + noise, 200.0).outputs > 10
    assert band(np.stack([moves, 0.2 * moves], 1) + noise, 200.0).outputs < 8
    # A slide is not compared with a hinge: its accelerations are in other units.
    both = np.stack([moves, 0.02 * moves], 1) + noise
    assert band(both, 200.0, sliding=[False, True]).outputs < 6


def test_a_value_that_repeats_the_one_before_is_found_where_the_joint_moves():
    t = times(100.0, 5.0)
    exact = np.stack([swing(t), 0.3 + 0 * t], 1)
    rows = np.flatnonzero(default_rng(4).random(len(t)) < 0.1)
    for step in (0.0, 1e-4):
        clean = np.round(exact / step) * step if step else exact
        x = clean.copy()
        for k in rows:
            x[k] = x[k - 1]
        steps = np.full(2, step)
        found = find_stale(x, steps)
        assert set(np.flatnonzero(found)) <= set(rows)
        assert found.sum() > 0.9 * len(rows)
        assert np.abs(interpolate(x, found) - clean)[found].max() < 2 * step + 2e-5
        assert not find_stale(clean, steps).any()
    # An encoder whose steps last several samples repeats by itself.
    coarse = np.round(exact / 0.05) * 0.05
    assert (np.diff(coarse[:, 0]) == 0).mean() > 0.3
    assert not find_stale(coarse, np.full(2, 0.05)).any()


def log_of(rate, hertz, name, **channels):
    t = times(rate)
    q = np.stack([swing(t, hertz), swing(t, 0.7 * hertz)], 1)
    none = dict.fromkeys(("dq", "ddq"))
    return Log(name, ("shoulder", "elbow"), t, q, 3 * q, **{**none, **channels}, sha256=name)


def test_all_logs_have_the_cut_off_of_the_widest_band(two):
    slow = log_of(100.0, 0.7, "slow")
    fast = log_of(200.0, 1.4, "fast")
    how = choose_cutoff(two, [slow, fast], None)
    assert how.outputs == pytest.approx(14.0, abs=0.6)
    assert prepare_log(two, slow, how).cutoff == how.cutoff
    assert prepare_log(two, slow).band == pytest.approx(7.0, abs=0.6)
    assert choose_cutoff(two, [slow], Preparation(cutoff=3.0)).cutoff == 3.0
    assert choose_cutoff(two, [replace(slow, dq=slow.q, ddq=slow.q)], None).cutoff is None


def test_the_measured_velocity_decides_where_it_is_what_is_differentiated(two):
    log = log_of(200.0, 1.0, "log")
    noisy = log.q + 0.02 * default_rng(5).standard_normal(log.q.shape)
    dq = np.gradient(log.q, log.t, axis=0)
    assert choose_cutoff(two, [replace(log, q=noisy)], None).outputs < 6
    assert choose_cutoff(two, [replace(log, q=noisy, dq=dq)], None).outputs > 9


def test_repeated_values_are_mended_and_said(two):
    log = log_of(100.0, 1.0, "log")
    rows = np.flatnonzero(default_rng(6).random(len(log)) < 0.08)
    q = np.array(log.q)
    tau = np.array(log.tau)
    for k in rows:
        q[k] = q[k - 1]
    hurt = replace(log, q=q, tau=tau)
    rule = StaleRule.of([hurt])
    assert set(rule.share) == {"q"}
    assert np.abs(rule.mend(hurt).q - log.q).max() < 0.1 * np.abs(q - log.q).max()
    samples = prepare_log(two, hurt)
    clean = prepare_log(two, log)
    assert samples.cutoff == pytest.approx(clean.cutoff)
    assert f"position in {100 * rule.share['q']:.2g} %" in " ".join(samples.notes)
    error = np.abs(samples.motion.actuated_a - clean.motion.actuated_a)
    assert error.max() < 0.01 * np.abs(clean.motion.actuated_a).max()
    assert StaleRule.of([log]).note == ""
