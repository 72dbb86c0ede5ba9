"""One wrong value in a log is named by every verb, and does not decide what they answer."""

import re

import numpy as np
import pytest

from identifiability import Log, analyze, diagnose, prune

ROW = 301  # counted from 1


FAULTS = {
    "torque times 1000": ("elbow.tau", lambda value, spread: 1000 * value),
    "torque times 10": ("elbow.tau", lambda value, spread: 10 * value),
    "a position off": ("elbow.q", lambda value, spread: value + spread),
    "a velocity off": ("shoulder.dq", lambda value, spread: value + 10 * spread),
}


def spoil(frame, fault):
    """The table with the fault planted, and how a hint names it."""
    column, change = FAULTS[fault]
    spoilt = frame.copy()
    t = frame["t"].iloc[ROW - 1]
    value = change(frame[column].iloc[ROW - 1], frame[column].std())
    spoilt.loc[ROW - 1, column] = value
    return spoilt, f"data row {ROW} (t = {t:.6g} s): {column} = {value:.4g}, "


@pytest.fixture
def frame(simulated):
    frame = simulated("two-link", 1000, torque=0.02)
    return frame.drop(columns=[c for c in frame if c.endswith(".ddq")])


@pytest.fixture(scope="module")
def analysed():
    """A function (frame) -> analysis of the log without a fault, which is the same for all."""
    found = []

    def analysis(frame):
        if not found:
            found.append(analyze("two-link", Log.from_frame(frame, "a"), replicates=100))
        return found[0]

    return analysis


@pytest.mark.parametrize("fault", FAULTS)
def test_it_is_named_and_weighs_nothing(frame, fault, analysed):
    spoilt, named = spoil(frame, fault)
    good = analysed(frame)
    bad = analyze("two-link", Log.from_frame(spoilt, "a"), replicates=100)
    assert good.hints == ()
    (hint,) = bad.hints
    assert hint.startswith("a: one outlying value was replaced")
    assert named in hint
    assert hint in bad.details
    moved = np.abs(bad.full.estimate.value - good.full.estimate.value)
    assert (moved < 0.2 * good.full.fit.robust).all()
    assert [v.verdict for v in bad.full.verdicts] == [v.verdict for v in good.full.verdicts]


def test_a_burst_that_is_no_single_sample_is_told_by_every_verb(frame):
    frame.loc[300:311, "elbow.tau"] *= 10
    log = Log.from_frame(frame, "a")
    for found in (
        analyze("two-link", log, replicates=50),
        prune("two-link", log, replicates=20),
        diagnose("two-link", log, quick=True, forward=False),
    ):
        (hint,) = (h for h in found.hints if " outliers less weight: " in h)
        assert re.search(r"From t = 2\..* of a(, part 1)?, the torque of elbow is ", hint)
