"""Series through noisy motion: how little noise they keep, and what they are told apart by."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Log
from identifiability.logs.series import find_series, resample, smooth_log, with_series
from identifiability.simulation.simulator import ar1

from ...roads import waves

STEP = 0.01
RATES = np.array([1, 2, 3, 5])
SIZES = np.array([[0.5, 0.4], [0.3, -0.2], [0.1, 0.2], [0.05, 0.1]])
PHASES = [[0.1, 2.0], [1.0, 0.5], [2.5, 0.3], [0.7, 1.7]]
#: Share of each channel's standard deviation.
NOISE = 0.04


def move(periods, period=4.0, *, repeats=True, samples=None):
    """Return time and exact position, velocity and acceleration (N, 2) of two joints."""
    t = STEP * np.arange(samples or int(periods * period / STEP))
    rates = 2 * np.pi / period * RATES
    if not repeats:
        rates = rates * [0.31, 0.83, 1.13, 1.0]
    return t, waves(t, rates[:, None], SIZES, PHASES)


def measure(t, exact, seed=0, correlation=0.0):
    """Return a log with noise of its own on each channel."""
    rng = default_rng(seed)
    q, dq, ddq = (x + NOISE * x.std(0) * ar1(x.shape, correlation, rng) for x in exact)
    return Log("run", ("a", "b"), t, q, np.ones_like(q), dq, ddq, "")


def share_left(series, exact):
    """Return the error of each channel over the noise that was measured, (3,)."""
    pairs = zip(series.motion, exact, strict=True)
    return np.array([np.std(x - y) / (NOISE * y.std(0).mean()) for x, y in pairs])


def test_a_spline_keeps_little_of_the_noise_of_any_motion():
    t, exact = move(5, repeats=False)
    assert share_left(find_series(measure(t, exact))["spline"], exact).max() < 0.3


@pytest.mark.parametrize("periods", [1, 2.4, 3, 10])
def test_a_motion_that_repeats_is_averaged_over_its_periods(periods):
    t, exact = move(periods)
    found = find_series(measure(t, exact))
    fourier = found["fourier"]
    assert fourier.period == pytest.approx(4.0, abs=1e-3)
    assert fourier.score < found["spline"].score
    # Eleven coefficients of three channels, each with as many samples as there are.
    assert share_left(fourier, exact).max() < 2.5 * np.sqrt(11 / len(t))


def test_a_motion_that_never_repeats_has_no_fourier_series(rejected):
    t, exact = move(5, repeats=False)
    log = measure(t, exact)
    with rejected("does not repeat its motion"):
        smooth_log(log, "fourier")
    assert "spline" in smooth_log(log, "fourier", strict=False).notes[-1]
    short = log.rows(0, 40)
    assert smooth_log(short, "spline") is short


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["a gap", "a joint at rest", "no noise", "a short period"])
def test_odd_logs_have_series_all_the_same(kind):
    t, exact = move(200, 0.5) if kind == "a short period" else move(4)
    log = measure(t, exact)
    if kind == "a gap":
        rows = (t < 5.0) | (t > 11.0)
        log = log.each(lambda x: x[rows], t=t[rows])
    if kind == "a joint at rest":
        log = log.each(lambda x: x * [1.0, 0.0])
    if kind == "no noise":
        q, dq, ddq = exact
        log = replace(log, q=q, dq=dq, ddq=ddq)
    found = find_series(log)
    assert found
    assert all(np.isfinite(x).all() for series in found.values() for x in series.motion)


def test_a_series_knows_how_well_it_knows_speeds():
    for periods in (1, 10):
        t, exact = move(periods)
        errors = []
        told = []
        for seed in range(6):
            log = measure(t, exact, seed)
            smooth = with_series(log, find_series(log)["fourier"])
            errors.append(np.mean((smooth.dq - exact[1]) ** 2, axis=0))
            told.append(smooth.speed_error**2)
        ratio = np.sqrt(np.mean(told, axis=0) / np.mean(errors, axis=0))
        assert np.all((ratio > 0.6) & (ratio < 1.6))


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_resampled_noise_is_as_large_and_remembers_as_long(correlation):
    rng = default_rng(1)
    size = np.linspace(0.2, 2.0, 4000)[:, None]
    left = size * ar1((4000, 3), correlation, rng)
    again = resample(left, rng)
    assert_allclose(np.abs(again), np.abs(left))
    one_later = np.mean(again[1:] * again[:-1], axis=0) / np.mean(again**2, axis=0)
    assert np.abs(one_later - correlation).max() < 0.1
    assert np.abs(np.mean(again * left, axis=0) / np.mean(left**2, axis=0)).max() < 0.3
