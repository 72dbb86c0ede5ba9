"""Laws of the band: noise, a joint that shakes, and longer logs move it, or values, by little."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.signal import butter, sosfilt

from identifiability import Noise, Preparation, Robot, analyze, simulate
from identifiability.estimation.cutoff import STEP
from identifiability.simulation import PrescribedMotion, random_trajectory

ROBOT = "six-dof-arm"
#: How a clean log is prepared on which values are judged that were found in different bands.
JUDGED = Preparation(cutoff=20.0, outputs=10.0)


@pytest.fixture(scope="module")
def make_logs():
    """A function (seed, noise, samples) -> log of positions with noise, and one without any."""
    robot = Robot.load(ROBOT)

    def make(seed, noise=1.0, samples=2000):
        rng = default_rng(seed)
        trajectory = random_trajectory(robot, rng, samples=samples, period=samples / 100)
        motion = PrescribedMotion.of(trajectory)
        noisy = simulate(robot, motion, noise=Noise(additive=0.03 * noise), seed=seed)
        clean = replace(simulate(robot, motion, noise="none"), dq=None, ddq=None)
        q = clean.q + 1e-4 * noise * rng.standard_normal(clean.q.shape)
        return replace(noisy, q=q, dq=None, ddq=None), clean

    return make


def shake(log):
    """Return a log in which the last joint shakes at 4 to 20 Hz by a tenth of how much it moves."""
    band = butter(2, (4.0, 20.0), "bandpass", fs=100.0, output="sos")
    wave = sosfilt(band, default_rng(3).standard_normal(len(log.t)))
    q = np.array(log.q)
    q[:, 5] += 0.1 * q[:, 5].std() * wave / wave.std()
    return replace(log, q=q)


def joint_errors(found, clean):
    """Return each joint's error of raw torque along a clean motion, over its variation, (n,)."""
    predicted = replace(found.fit, preparation=JUDGED).predict(clean)
    known = predicted.known
    residual = np.where(known, predicted.raw - predicted.predicted, 0.0)
    spread = np.where(known, predicted.raw - predicted.raw.mean(0), 0.0)
    return np.sqrt((residual**2).sum(0) / (spread**2).sum(0))


def test_twice_the_noise_moves_the_band_at_most_one_step_up(make_logs):
    cutoffs = [
        analyze(ROBOT, make_logs(0, noise)[0], "none", replicates=0).samples[0].cutoff
        for noise in (1.0, 2.0)
    ]
    assert cutoffs[1] <= 1.001 * STEP * cutoffs[0]


def test_a_shaking_wrist_changes_no_other_joint_by_more_than_two_percent(make_logs):
    log, _ = make_logs(0)
    _, clean = make_logs(50)
    calm = analyze(ROBOT, log, "none", replicates=0)
    shaken = analyze(ROBOT, shake(log), "none", replicates=0)
    assert shaken.samples[0].cutoff <= calm.samples[0].cutoff
    ratio = joint_errors(shaken, clean) / joint_errors(calm, clean)
    assert ratio[:5].max() <= 1.02


def test_twice_as_long_logs_have_smaller_errors_that_hold(make_logs):
    ratios = []
    held = []
    for seed in range(2):
        log = make_logs(seed, samples=3000)[0]
        short, long = (
            analyze(ROBOT, x, "none", replicates=0).to_frame()
            for x in (log.rows(0, 1500, "half"), log)
        )
        ratios += list((long.standard_error / short.standard_error).dropna())
        for rows in (short, long):
            held += list(rows.nominal.between(rows.lower, rows.upper))
    assert np.median(ratios) <= 0.8
    # Values of one fit are not independent: a third of them, two standard errors.
    slack = 2 * np.sqrt(0.93 * 0.07 / (len(held) / 3))
    assert np.mean(held) >= 0.93 - slack
