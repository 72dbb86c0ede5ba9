"""`result["joint.kind"]` is the row of that parameter; an unknown name gives the near match."""

import numpy as np
import pytest

import identifiability
from identifiability import Analysis, analyze, calibrate, compare, diagnose, payload, prune
from identifiability.simulation import PAPER_NOISE

from .conftest import shipped_log


@pytest.fixture(scope="module")
def result(arm_log):
    return analyze("two-link", arm_log, replicates=20)


@pytest.fixture(scope="module")
def results(result, arm_log, simulated_session, tmp_path_factory, two_link):
    """Every kind of result that has rows, with a name of each."""
    folder = tmp_path_factory.mktemp("rows")
    other = simulated_session("two-link", "a", 1)
    path = result.to_json(folder / "result.json")
    found = diagnose("two-link", arm_log, quick=True)
    kept = found.to_json(folder / "missing.json")
    return {
        "analyze": (result, "elbow.Fc"),
        "prune": (prune("two-link", arm_log, replicates=4), "elbow.Fc"),
        "diagnose": (found, "elbow.Fc"),
        "payload": (payload("two-link", result, other), "mass"),
        "calibrate": (calibrate(result, replicates=4, refits=20), None),
        "kept": (Analysis.from_json(path), "elbow.Fc"),
        "kept diagnosis": (Analysis.from_json(kept), "elbow.Fc"),
        "fit": (Analysis.from_json(path, two_link), "elbow.Fc"),
    }


KINDS = ["analyze", "prune", "diagnose", "payload", "calibrate", "kept", "kept diagnosis", "fit"]


@pytest.mark.parametrize("kind", KINDS)
def test_each_name_gives_its_row(results, kind):
    found, name = results[kind]
    assert found.row_names()
    assert name is None or name in found
    for key in found.row_names():
        row = found[key]
        assert (row.name, type(row).__name__) == (key, "Row")
        assert np.isfinite(row.estimate)
        low, high = row.interval
        assert low <= row.estimate <= high
        assert key in str(row)


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_name_gives_the_near_match_and_how_to_list_names(results, kind):
    found, _ = results[kind]
    name, *_ = found.row_names()
    with pytest.raises(KeyError) as refused:
        found[f"{name}x"]
    assert isinstance(refused.value, identifiability.IdentifiabilityError)
    said = str(refused.value)
    assert f"did you mean '{name}'?" in said
    assert "row_names()" in said
    assert f"{name}x" not in found


def test_a_row_is_that_of_the_table(result):
    row = result["elbow.Fc"]
    table = result.to_frame().loc["elbow.Fc"]
    assert row.estimate == table["value"]
    assert row.interval == (table["lower"], table["upper"])
    assert row.standard_error == pytest.approx(
        (table["upper"] - table["lower"]) / (2 * 1.96), rel=1e-3
    )
    assert (row.unit, row.verdict, row.reason) == (table["unit"], table["verdict"], table["reason"])
    assert row.details["used"] == table["used"]


def test_what_the_model_to_use_leaves_out_is_told_of_the_unpruned_one(results):
    found, _ = results["prune"]
    left = [v for v in found.full.verdicts if v.name not in found.chosen.submodel.columns]
    assert left
    row = found[left[0].name]
    assert row.estimate == left[0].value
    assert row.reason.startswith("The model to use leaves it out.")


@pytest.mark.parametrize("kind", ["analyze", "kept"])
def test_a_standard_parameter_is_refused_with_the_combination_that_holds_it(results, kind):
    base = results["analyze"][0].base
    row, members = next((r, base.terms(r)) for r in range(len(base)) if len(base.terms(r)) > 1)
    with pytest.raises(KeyError, match=f"This result has no .* part of .*{base.names[row]}"):
        results[kind][0][members[1][1].name]


def test_a_change_is_found_by_its_parameter(arm_log, two_link):
    friction = {n: 2 * x for n, x in two_link.nominal.items() if n.startswith("elbow.F")}
    made = {"like": two_link, "noise": PAPER_NOISE, "seed": 1}
    after = shipped_log(two_link.with_values(friction), "a", **made)
    found = compare(two_link, arm_log, after)
    name = next(n for n in found.row_names() if n.startswith("elbow.F"))
    row = found[name]
    assert (row.verdict, row.details["what"]) == ("changed", "friction of elbow")
    assert row.interval[0] > 0
    with pytest.raises(KeyError, match="no change of it was found"):
        found["shoulder.Fv"]


def test_a_result_without_changes_has_no_rows(arm_log, simulated_session):
    same = compare("two-link", arm_log, simulated_session("two-link", "a", 1))
    assert not same.row_names()
    with pytest.raises(KeyError, match=r"no rows by name; to_frame\(\)"):
        same["elbow.Fc"]


def test_a_result_is_no_sequence(result):
    with pytest.raises(TypeError, match="not iterable"):
        iter(result)
