"""Coverage and wrong verdicts are counted with the interval that the answer states."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.foundation.rounding import (
    clustered_share,
    design_effect,
    each_share,
    exact_share,
)
from identifiability.workflows.calibrate.world import Outcome, count_outcomes


def outcome(value, called=()):
    k = len(value)
    return Outcome(
        value=np.array(value, float),
        white=np.ones(k),
        robust=np.ones(k),
        identifiable=np.isin(np.arange(k), called),
        paper=np.zeros(k, bool),
    )


def count(trials, truth):
    names = [f"p{j}" for j in range(len(truth))]
    return count_outcomes(trials, np.array(truth, float), names)


def test_an_interval_holds_the_truth_up_to_the_deviations_that_verdicts_state():
    for off, fixed in ((1.959, 1.0), (-1.959, 1.0), (1.961, 0.0), (-1.961, 0.0)):
        assert count([outcome([10 + off])], [10.0]).coverage == fixed


def test_wrong_is_off_by_more_than_half_among_what_was_called():
    trials = [
        outcome([1.49, 1.51, 5.0], called=[0, 1]),
        outcome([-0.51, 0.5, 1.0], called=[0, 1]),
    ]
    cell = count(trials, [1.0, 1.0, 1.0])
    assert len(cell.held) == 2
    assert cell.called == 2.0
    assert cell.wrong.value == 2 / 4  # 1.51 and -.51
    assert cell.wrong.high > cell.wrong.value
    assert np.isnan(count([outcome([9.0])], [1.0]).wrong.value)  # none was called


def test_the_error_of_a_coverage_is_counted_by_trials():
    """Two trials of which one holds everything and one nothing are two draws, not four."""
    trials = [outcome([0.0, 0.0]), outcome([9.0, 9.0]), outcome([0.0, 0.0]), outcome([9.0, 9.0])]
    cell = count(trials, [0.0, 0.0])
    assert cell.coverage == 0.5
    assert cell.coverage_se == pytest.approx(np.std([1, 0, 1, 0], ddof=1) / 2)


def test_the_worst_parameter_is_named_and_those_surely_below_too():
    trials = [outcome([0.0, 3.0 * (k % 2), 0.0]) for k in range(100)]
    cell = count(trials, [0.0, 0.0, 0.0])
    assert cell.each[1].value == 0.5
    assert cell.below == ("p1",)
    assert cell.to_dict()["each"][1]["interval95"] == [cell.each[1].low, cell.each[1].high]


def test_an_exact_share_is_clopper_and_pearsons():
    """Tables: 0 of 10 up to .3085, 10 of 10 down to .6915, 5 of 10 from .1871 to .8129."""
    for events, low, high in ((0, 0.0, 0.3085), (10, 0.6915, 1.0), (5, 0.1871, 0.8129)):
        found = exact_share(events, 10)
        assert (found.low, found.high) == pytest.approx((low, high), abs=1e-4)
        assert found.value == events / 10
    assert np.isnan(exact_share(0, 0).value)


def test_events_that_come_together_count_for_fewer():
    together = np.repeat(np.arange(40) % 4 == 0, 5).reshape(40, 5)
    every = np.ones((40, 5), bool)
    # Five equal events a trial: the variance is five times that of independent ones.
    assert design_effect(together, every) == pytest.approx(5 * 40 / 39)
    share = clustered_share(together, every, together)
    assert share.value == pytest.approx(0.25)
    alone = exact_share(50, 200)
    assert share.high > alone.high + 0.03
    assert share.low < alone.low - 0.03
    # Too rare to say how much they come together: related events do.
    rare = np.zeros((40, 5), bool)
    assert clustered_share(rare, every, together).high == pytest.approx(
        exact_share(0, 200 / (5 * 40 / 39)).high
    )


def test_intervals_of_several_shares_are_right_together():
    events = np.zeros((50, 5), bool)
    events[:25] = True
    for share in each_share(events):
        assert (share.low, share.high) == pytest.approx(
            (exact_share(25, 50, 0.99).low, exact_share(25, 50, 0.99).high)
        )


def test_outcomes_too_short_to_be_judged_are_counted():
    long = outcome([1.0, 0.01], called=[0])
    short = replace(outcome([1.0, 0.01]), judged=False)
    assert count([short, long, long, long], [1.0, 0.01]).not_judged == 0.25
