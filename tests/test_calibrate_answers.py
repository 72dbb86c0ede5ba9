"""Is the yes of `calibrate` right? studies/calibrate_answers.py in short."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identifiability.foundation.numbers import Share
from identifiability.workflows.calibrate.outcome import Cell

STUDIES = Path(__file__).resolve().parents[1] / "studies"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(STUDIES)
    import calibrate_answers

    return calibrate_answers


def cell(coverage=0.95, wrong=0.0):
    return Cell(
        noise=1.0, rho=np.nan, trials=50, coverage_white=0.9, coverage_robust=coverage,
        coverage_se=0.005, called=5.0, wrong=wrong, paper_called=5.0, paper_wrong=wrong,
        wrong_low=wrong, wrong_high=wrong + 0.01, names=("x",), each=(Share(0.95, 0.9, 0.98),),
    )  # fmt: skip


def test_answers_are_counted_by_what_independent_logs_say(study):
    """One yes of four is contradicted; three of the five that may be yes are."""
    good = study.Finding("arm", "good", 1, cell(), ("yes", "yes", "no"), (0.95, 0.94, 0.90))
    also = replace(good, judged=cell(0.94), answers=("yes", "not enough trials"))
    bad = replace(good, judged=cell(0.8), answers=("yes", "no", "no"))
    wild = replace(good, judged=cell(wrong=0.2), answers=("no",))
    assert [f.truth for f in (good, also, bad, wild)] == ["yes", "yes", "no", "no"]
    table = study.confuse([good, also, bad, wild])
    assert table.to_numpy().tolist() == [[3, 1, 1], [1, 3, 0], [0, 0, 0]]
    wrong, kept = study.shares([good, also, bad, wild])
    assert (wrong.value, kept.value) == (pytest.approx(1 / 4), pytest.approx(3 / 5))
    assert wrong.low < 0.01
    assert wrong.high > 0.8
    assert "4 of 9 calibrations said yes" in study.state([good, also, bad, wild])
    marked = [c.passed for c in study.rows([good, bad, wild])["calibrate says"]]
    assert marked == [True, False, True]


@pytest.mark.everything
def test_a_yes_on_the_two_link_arm_is_true_of_other_logs(study):
    """Nine logs of other robots: of 117 intervals all but few hold, and calibrate says so."""
    found = study.examine("two-link", study.CONDITIONS[0], logs=9, asked=1, trials=15, seed=3)
    assert found.answers == ("yes",)
    assert found.judged.trials == 9
    assert found.parameters == 13
    assert abs(found.judged.coverage_robust - found.coverages[0]) < 0.06
    assert found.judged.wrong == 0


@pytest.mark.everything
@pytest.mark.parametrize(("condition", "answer"), [(2, "yes"), (4, "no")])
def test_left_out_parameters_are_allowed_for_and_slow_noise_is_seen(study, condition, answer):
    """Of 750 samples whose noise has ρ = .98 next to nothing can be judged."""
    found = study.examine("two-link", study.CONDITIONS[condition], 30, 2, 15, 0)
    assert found.truth == answer
    assert set(found.answers) == {answer}
