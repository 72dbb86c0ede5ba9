"""Trials repeat, do not depend on processes, and disturb what they say they disturb."""

import numpy as np
import pytest
from paper_study.monte_carlo import Case, parameter_error, run_trial, run_trials, stack
from paper_study.readings import READINGS
from paper_study.result import compare
from paper_study.subject import HINGE_FRICTION, exact_log, load_subject

from identifiability.foundation.engines.local import Processes
from identifiability.robot import complete_motion

CASE = Case("601", 100)


def test_a_trial_repeats_to_the_last_bit():
    first, again = run_trial(CASE, 7), run_trial(CASE, 7)
    assert np.array_equal(first.error_ra, again.error_ra)
    assert not np.array_equal(first.error_ra, run_trial(CASE, 8).error_ra)


@pytest.mark.everything
def test_two_processes_give_the_same_trials_as_one(monkeypatch):
    alone = [run_trial(CASE, seed).error_ra for seed in range(6)]
    monkeypatch.setattr("paper_study.monte_carlo._done", {})
    with Processes(2) as engine:
        shared = run_trials([CASE], 6, engine)[CASE]
    assert np.array_equal(stack(shared, "error_ra"), np.array(alone))


def test_noise_of_zero_leaves_every_reading_exact():
    log = exact_log("3-rps", "601", 100)
    for name, reading in READINGS.items():
        noisy = reading.disturb(log, 0.0, 0.0, np.random.default_rng(0))
        assert np.allclose(noisy.tau, log.tau, rtol=1e-14), name
        assert np.allclose(noisy.q, log.q, rtol=1e-12), name
        if name != "differences":
            assert np.allclose(noisy.ddq, log.ddq, atol=1e-9), name


def test_per_sample_noise_has_the_stated_share():
    log = exact_log("3-rps", "601", 750)
    noisy = READINGS["per sample"].disturb(log, 0.04, 0.05, np.random.default_rng(0))
    for exact, found, share in ((log.q, noisy.q, 0.04), (log.tau, noisy.tau, 0.05)):
        spread = (found / exact - 1).std()
        assert spread == pytest.approx(share, rel=5 / np.sqrt(2 * exact.size))


def test_hinge_friction_takes_the_power_that_the_hinges_lose():
    """τ·q̇ of the extra force equals the sum of friction times speed over the hinges."""
    robot = load_subject().robot
    plain, rough = (exact_log("3-rps", "601", 100, kind) for kind in ("", "hinges"))
    motion = complete_motion(robot, plain.t, plain.q, plain.dq, plain.ddq)
    at = [a.dof for a in robot.passive_axes if a.name.startswith("hinge")]
    speed = motion.v[:, at]
    lost = HINGE_FRICTION["Fv"] * speed**2 + HINGE_FRICTION["Fc+"] * np.abs(speed)
    spent = ((rough.tau - plain.tau) * plain.dq).sum(1)
    assert np.abs(spent - lost.sum(1)).max() < 1e-9 * lost.sum(1).max()


def test_stribeck_friction_adds_the_static_excess_at_rest_and_nothing_at_speed():
    plain, rough = (exact_log("3-rps", "601", 750, kind) for kind in ("", "stribeck"))
    excess = np.abs(rough.tau - plain.tau)
    assert np.allclose(excess, (600 - 228) * np.exp(-np.abs(plain.dq) / 0.08))


def test_a_printed_number_beyond_the_tolerance_differs_and_says_why():
    trials = np.array([4.4, 4.5, 4.6])
    assert compare(trials, 4.55, 0.0, "x").passed is True
    assert compare(trials, 4.8, 0.3, "x").passed is True
    cell = compare(trials, 4.8, 0.1, "seeds are unknown")
    assert cell.passed is False
    assert "differs, because seeds are unknown" in cell.reason


def test_the_parameter_error_is_the_mean_relative_one_of_those_chosen():
    value, exact = np.array([1.1, 2.0, 5.0, 3.0]), np.array([1.0, 4.0, 0.0, 1.0])
    assert parameter_error(value, exact, [True, True, True, False]) == pytest.approx(0.3)
    assert np.isnan(parameter_error(value, exact, [False, False, True, False]))
