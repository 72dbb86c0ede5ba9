"""Foreign and spoilt logs are read right, or what is wrong is named: studies/foreign_logs.py."""

from collections import Counter

import foreign_logs as study
import pytest

#: One of each family, in the default run.
SAMPLE = (
    "a web page",
    "a misspelt column",
    "rows in disorder",
    "degrees",
    "mN·m, a two-link arm",
    "compensated, two-link",
    "German, Windows-1252, velocities",
    "actuator_force",
)


def test_a_sample_is_read_or_its_fault_is_named():
    cases = [case for case in study.CASES if case.name in SAMPLE]
    assert len(cases) == len(SAMPLE)
    assert {o.case.name: (o.outcome, o.said) for o in study.run(cases) if not o.good} == {}


def test_there_are_a_hundred_of_other_names():
    names = Counter(case.name for case in study.CASES)
    assert len(names) >= 100
    assert max(names.values()) == 1


@pytest.mark.everything
def test_all_are_read_or_their_fault_is_named():
    assert {o.case.name: o.outcome for o in study.run(study.CASES) if not o.good} == {}


@pytest.mark.everything
def test_good_logs_are_not_spoken_of():
    counts = study.false_frame(1, None).iloc[-1]
    assert counts["logs"] >= 100
    for what in study.FINDERS:
        assert counts[what] <= 0.02 * counts["logs"], what
