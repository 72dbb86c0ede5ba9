"""The study of drawn cases: what counts as right, and that nobody can choose the cases."""

import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.robot import Robot

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture(scope="module")
def cases():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("hidden_effect_cases")
    sys.path.remove(str(STUDIES))


@pytest.fixture(scope="module")
def drawn(cases):
    return importlib.import_module("hidden_effect_drawn")


def effect(name, *joints, rivals=(), unnamed=False):
    told = [SimpleNamespace(family=f, place=p, undecided=u) for f, p, u in rivals]
    return SimpleNamespace(
        name=name,
        joints=joints,
        unnamed=unnamed,
        alternatives=tuple(r.family for r in told if r.undecided),
        placements=[SimpleNamespace(rivals=told)],
    )


@pytest.mark.parametrize(
    ("effects", "outcome"),
    [
        ([], "none"),
        ([effect("drag", "j")], "exact"),
        ([effect("drag", "k")], "wrong"),
        ([effect("drag", "j", "k")], "truth and more"),
        ([effect("drag", "j"), effect("other", "j")], "truth and more"),
        ([effect("drag", "j", rivals=[("other", "j", True)])], "A or B"),
        ([effect("drag", "j", rivals=[("other", "j", False)])], "exact"),
        ([effect("other", "j", rivals=[("drag", "j", True)])], "A or B"),
        ([effect("other", "j", rivals=[("drag", "j", False)])], "wrong"),
        ([effect("other", "j", rivals=[("drag", "k", True)])], "wrong"),
        ([effect("function", "j", unnamed=True)], "function"),
    ],
)
def test_a_name_counts_with_its_joint(cases, effects, outcome):
    case = cases.Case(0, "two-link", "drag", "j", 1, 2)
    assert cases.judge(SimpleNamespace(effects=effects), case) == outcome


def test_effects_are_hidden_where_they_can_be(cases):
    five, wrist = Robot.load("five-bar"), Robot.load("differential-wrist")
    assert set(cases.list_places(five, "passive_joint_friction")).isdisjoint(five.joints)
    assert cases.list_places(five, "torque_offset") == list(five.joints)
    assert cases.list_places(five, "gravity_tilt") in ([""], [])
    assert cases.list_places(wrist, "passive_joint_friction") == []
    robots = [cases.robot_of(5, k) for k in range(300)]
    assert set(robots) == set(cases.ROBOTS)
    assert robots == [cases.robot_of(5, k) for k in range(300)]


def test_cases_are_drawn_by_a_commit_of_this_checkout(drawn):
    with pytest.raises(IdentifiabilityError, match="no commit 'nonsense'"):
        drawn.seed_of("nonsense")


def test_a_line_that_was_cut_off_is_run_again(drawn, tmp_path, monkeypatch):
    path, asked = tmp_path / "trials.jsonl", []
    path.write_text(json.dumps({"number": 3, "size": 1.0}) + '\n{"number": 3, "si')

    def told(case, size, outside):
        asked.append(size)
        row = {"number": case.number, "size": size, "robot": "r", "family": "f", "place": "j"}
        return {**row, "outcome": "none", "named": ""}

    monkeypatch.setattr(drawn, "run_case", told)
    drawn.run_rest(SimpleNamespace(number=3), (1.0, 0.5), path, outside=False)
    assert asked == [0.5]
    assert [r["size"] for r in drawn.read_trials(path)] == [1.0, 0.5]


def test_shares_are_judged_with_their_intervals(drawn):
    good = pd.Series([True] * 9 + [False])
    assert drawn.judge("right", good, 0.9)["holds"]
    assert not drawn.judge("right", good, 0.91)["holds"]
    assert not drawn.judge("wrong", good, 0.89, most=True)["holds"]
    found = drawn.judge("right", good, 0.9)
    assert (found["hits"], found["trials"], found["share"]) == (9, 10, 0.9)
    assert found["low"] == pytest.approx(0.555, abs=1e-3)  # Clopper-Pearson, 9 of 10
    assert drawn.judge("none", good[:0], 0.9)["holds"] is None


@pytest.fixture
def study():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("hidden_effect")
    sys.path.remove(str(STUDIES))


def test_the_study_goes_on_where_it_was_stopped(study, tmp_path, monkeypatch):
    jobs = list(study.list_jobs(1, 1, ["five-bar"], ["null", "single"]))[:7]
    path = tmp_path / "hidden_effect.jsonl"
    asked = []

    def told(job):
        asked.append(job.key)
        return {"key": job.key, "outcome": "no name", "named": "", "study": job.study}

    monkeypatch.setattr(study, "_row", told)
    study.run_rest(jobs[:3], path, 1)
    with path.open("a") as file:
        file.write('{"key": "cut o')
    frame = study.run_rest(jobs, path, 1)
    assert asked == [j.key for j in jobs]
    assert frame.key.tolist() == [j.key for j in jobs]
    assert len(path.read_text().splitlines()) == 7
