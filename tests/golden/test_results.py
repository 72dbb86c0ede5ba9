"""Today's results are those that were told before, within what another processor may change."""

import copy
import json
import os
import sys

import pytest

from identifiability import Thresholds

from . import results as golden


@pytest.mark.parametrize("verb", golden.VERBS)
def test_the_results_are_those_that_were_told_before(verb):
    assert golden.check(verb) == []


@pytest.mark.everything  # each case is made again beside moved rules
@pytest.mark.parametrize("verb", golden.VERBS)
def test_no_case_lies_within_a_tenth_or_a_nat_of_a_threshold(verb):
    assert golden.find_near(verb) == []


def test_a_case_that_lies_near_a_threshold_is_found(monkeypatch):
    made = {"statement": "Known to ±19 % (limit 20 %).", "verdict": "identifiable"}

    def judged(_verb):
        return made | {"verdict": "identifiable" if Thresholds().sigma_percent >= 19 else "no"}

    monkeypatch.setattr(golden, "make", judged)
    near = golden.find_near("analyze")
    assert len(near) == 1
    assert "sigma_percent −" in near[0]


def change(row, errors):
    row["value"] += errors * row["value"] * row["sigma_robust_percent"] / 100


def sway(result):
    row = result["posterior"]["physical"]["parameters"][0]
    row["mean"] += 0.5 * row["sd"]


def say(result, old, new):
    assert old in result["statement"]
    result["statement"] = result["statement"].replace(old, new, 1)


#: What a reader would call another result.
OTHERS = {
    "a value by a twentieth of its error": lambda result: change(result["parameters"][0], 0.05),
    "a verdict": lambda result: result["parameters"][0].update(verdict="sign only"),
    "a posterior by half its deviation": sway,
    "a key that is gone": lambda result: result.pop("selected"),
    "a row that is gone": lambda result: result["parameters"].pop(),
    "a count in a sentence": lambda result: say(result, "9 of 11", "10 of 11"),
    "a word of a sentence": lambda result: say(result, "are identifiable", "are negligible"),
    "an error by a hundredth": lambda result: result["models"][0].update(
        error_ra=1.01 * result["models"][0]["error_ra"]
    ),
}

#: What another processor may do.
SAME = {
    "a value by a hundredth of its error": lambda result: change(result["parameters"][0], 0.01),
    "a last digit": lambda result: change(result["parameters"][0], 1e-13),
    "rows that change places": lambda result: result["file"].reverse(),
    "an error by a ten-thousandth": lambda result: result["models"][0].update(
        error_ra=1.0001 * result["models"][0]["error_ra"]
    ),
}


def altered(kinds, what):
    stored = json.loads(golden.stored("analyze").read_text())
    moved = copy.deepcopy(stored)
    kinds[what](moved)
    return stored, moved


@pytest.mark.parametrize("what", OTHERS)
def test_what_is_another_result_is_found(what):
    assert golden.Comparison().differences(*altered(OTHERS, what)) != []


@pytest.mark.parametrize("what", SAME)
def test_what_another_processor_may_do_is_the_same_result(what):
    stored, moved = altered(SAME, what)
    assert golden.Comparison().differences(stored, moved) == []
    assert golden.Comparison(exact=True).differences(stored, moved) != []


def test_printed_numbers_may_differ_by_one_unit_of_their_last_digit_and_counts_may_not():
    same = golden.Comparison().differences
    assert same("Known to ±1.97 % in joint_2.", "Known to ±1.98 % in joint_2.") == []
    assert same("Known to ±1.97 % in joint_2.", "Known to ±1.99 % in joint_2.") != []
    assert same("Known to ±1.97 % in joint_2.", "Known to ±1.97 % in joint_3.") != []
    assert same("It is 127 % of 3.1·10⁻⁴.", "It is 128 % of 3.2·10⁻⁴.") == []
    assert same("It is 127 % of 3.1·10⁻⁴.", "It is 127 % of 3.1·10⁻⁵.") != []
    assert same("3 joints", "4 joints") != []


def test_log_odds_may_differ_by_a_fiftieth_of_a_nat_wherever_they_stand():
    rows = [{"effect": e, "log_odds": x} for e, x in (("clock_error", -4.35), ("ripple", -4.36))]
    moved = [dict(row, log_odds=row["log_odds"] + 0.015) for row in reversed(rows)]
    assert golden.Comparison().differences(rows, moved) == []
    moved[0]["log_odds"] += 0.01
    assert golden.Comparison().differences(rows, moved) != []


def test_the_plain_processor_is_one_that_numpy_can_be(process):
    """NumPy refuses names that it was not built with, and warns of those that are not here."""
    look = (
        "import numpy._core._multiarray_umath as m;"
        "print([x for x in m.__cpu_dispatch__ if m.__cpu_features__[x]])"
    )
    done = process(
        [sys.executable, "-W", "error", "-c", look],
        env=os.environ | golden.plain_environment(),
    )
    assert done.stderr == ""
    assert done.stdout.strip() == "[]"
