"""The stand-in is a machine: closed loops, a controller that follows, forces that balance."""

import numpy as np
import pytest
from paper_study.procedure import filter_periodic, fit_record, process
from paper_study.stand_in import record_all
from paper_study.subject import TRAJECTORIES, load_subject
from table_8_stand_in import stand_in_values

ROWS = ["platform.mx", "leg2_upper.m", "leg3_upper.m"]


@pytest.fixture
def records():
    return record_all("3-rps", TRAJECTORIES, 2)


def test_the_procedure_gives_750_points_without_phase_shift(records):
    assert len(process(load_subject(), records["601"]).tau) == 750
    t = np.arange(750) * 0.01
    wave = np.sin(2 * np.pi * 3 * t / 7.5)[:, None]
    assert np.abs(filter_periodic(wave, 10.0) - wave).max() < 1e-3


def test_model_4_finds_the_unlike_platform_better_than_model_1(records):
    subject = load_subject()
    truth = stand_in_values(subject, ROWS)
    at = [subject.base.names.index(n) for n in ROWS]
    for record in records.values():
        values = fit_record(subject, process(subject, record)).values[at]
        four, one = (np.abs(values[:, m] / truth - 1).max() for m in (3, 0))
        assert four < 0.4 < 1.0 < one
