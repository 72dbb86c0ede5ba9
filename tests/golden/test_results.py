"""Today's results are those that were told before, within what another processor may change."""

import copy
import json

import pytest

from . import results as golden


@pytest.mark.parametrize("verb", golden.VERBS)
def test_the_results_are_those_that_were_told_before(verb):
    assert golden.check(verb) == []


def move(row):
    row["value"] += 1e-3 * row["value"] * row["sigma_robust_percent"] / 100


def sway(result):
    row = result["posterior"]["physical"]["parameters"][0]
    row["mean"] += 0.5 * row["sd"]


#: What a reader would call another result.
OTHERS = {
    "a value by a thousandth of its error": lambda result: move(result["parameters"][0]),
    "a verdict": lambda result: result["parameters"][0].update(verdict="sign only"),
    "a posterior by half its deviation": sway,
    "a key that is gone": lambda result: result.pop("selected"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_what_is_another_result_is_found(what):
    stored = json.loads(golden.stored("analyze").read_text())
    moved = copy.deepcopy(stored)
    OTHERS[what](moved)
    assert golden.differences(stored, moved, exact=False) != []


def test_a_last_digit_counts_only_on_the_machine_that_wrote_it():
    stored = json.loads(golden.stored("analyze").read_text())
    moved = copy.deepcopy(stored)
    moved["parameters"][0]["value"] *= 1 + 2e-16
    assert golden.differences(stored, moved, exact=False) == []
    assert golden.differences(stored, moved, exact=True) != []
