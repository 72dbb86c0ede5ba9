"""Trials repeat, do not depend on processes, and disturb what they say they disturb."""

import numpy as np
from paper_study.monte_carlo import Case, run_trial
from paper_study.result import compare

CASE = Case("601", 100)


def test_a_trial_repeats_to_the_last_bit():
    first = run_trial(CASE, 7)
    assert np.array_equal(first.error_ra, run_trial(CASE, 7).error_ra)
    assert not np.array_equal(first.error_ra, run_trial(CASE, 8).error_ra)


def test_a_printed_number_beyond_the_tolerance_differs_and_says_why():
    trials = np.array([4.4, 4.5, 4.6])
    assert compare(trials, 4.55, 0.0, "x").badge == "pass"
    assert compare(trials, 4.8, 0.3, "x").badge == "pass"
    cell = compare(trials, 4.8, 0.1, "seeds are unknown")
    assert cell.badge == "differs"
    assert "differs, because seeds are unknown" in cell.note


def test_trials_that_scatter_over_decades_pass_no_printed_number():
    scattered = compare(np.array([3.45, 60.0, 445_000.0]), 52.18, 0.5, "x")
    assert scattered.badge == "not checked"
    assert scattered.text.startswith("cannot be compared")
    assert compare(np.array([-90.0, 2.0, 70.0]), 50.0, 0.0, "x").badge == "pass"
