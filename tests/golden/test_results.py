"""Today's results are those that were told before, within what another processor may change."""

from __future__ import annotations

import copy
import importlib.util
import json
import sys
from pathlib import Path

import pytest

_spec = importlib.util.spec_from_file_location(
    "golden_results", Path(__file__).with_name("results.py")
)
golden = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = golden
_spec.loader.exec_module(golden)


@pytest.mark.parametrize(
    ("name", "verb", "seed"), list(golden.cases(golden.QUICK, golden.SEEDS[:1]))
)
def test_the_results_are_those_that_were_told_before(name, verb, seed):
    assert golden.check(name, verb, seed) == []


@pytest.fixture
def stored():
    return json.loads(golden.stored("two-link", "analyze", 0).read_text())


def test_a_value_that_moves_by_a_thousandth_of_its_error_is_found(stored):
    moved = copy.deepcopy(stored)
    row = moved["parameters"][0]
    row["value"] += 1e-3 * row["value"] * row["sigma_robust_percent"] / 100
    assert any(".value" in d for d in golden.differences(stored, moved, exact=False))


def test_a_last_digit_counts_only_on_the_machine_that_wrote_it(stored):
    moved = copy.deepcopy(stored)
    moved["parameters"][0]["value"] *= 1 + 2e-16
    assert golden.differences(stored, moved, exact=False) == []
    assert golden.differences(stored, moved, exact=True) != []


def test_another_verdict_is_found(stored):
    moved = copy.deepcopy(stored)
    moved["parameters"][0]["verdict"] = "sign only"
    assert golden.differences(stored, moved, exact=False) != []


def test_a_posterior_that_moves_by_half_its_spread_is_found(stored):
    moved = copy.deepcopy(stored)
    row = moved["posterior"]["signs"]["parameters"][0]
    row["mean"] += 0.5 * row["sd"]
    assert golden.differences(stored, moved, exact=False) != []


def test_what_is_lost_or_new_is_found(stored):
    moved = copy.deepcopy(stored)
    del moved["selected"]
    assert golden.differences(stored, moved, exact=False) != []
