"""A case: every stage from logs to columns is computed once, and every verb uses it."""

import pickle
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import (
    Case,
    IdentifiabilityError,
    Noise,
    analyze,
    compare,
    diagnose,
    excite,
    inspect,
    payload,
    predict,
    prune,
)
from identifiability.regression import structure
from identifiability.regression.regression import LogPart
from identifiability.workflows import case as cases

from .conftest import shipped_log
from .marks import everything

refuses = partial(pytest.raises, IdentifiabilityError)
VERBS = {"analyze": analyze, "diagnose": diagnose, "prune": prune}


@pytest.fixture(scope="module")
def two_logs(two_link):
    """A robot with a spring that its model lacks, and two logs of it."""
    made = {"noise": Noise(torque=0.03), "rng": default_rng(0), "hide": ["joint_stiffness=0.1"]}
    logs = [shipped_log(two_link, name, 600, **made) for name in "ab"]
    return two_link, [replace(log, name=name) for log, name in zip(logs, "ab", strict=True)]


@pytest.fixture
def case(two_logs):
    """The second log of the robot is held out."""
    robot, logs = two_logs
    return Case(robot, logs[:1], logs[1])


@pytest.fixture(scope="module")
def loaded(two_logs):
    """A log of the same robot with a load of half a kilogram."""
    robot, _ = two_logs
    heavy = robot.with_payload(mass=0.5)
    made = {"noise": Noise(torque=0.03), "seed": 1, "hide": ["joint_stiffness=0.1"]}
    return replace(shipped_log(heavy, "b", 500, like=robot, **made), name="loaded")


@pytest.fixture
def counted(monkeypatch):
    """How often logs are prepared, information is gathered and base parameters are computed."""
    counts = {name: Counter() for name in ("prepared", "gathered", "base", "regressors")}
    prepare, gather, find = (
        cases.prepare_log, cases.gather_information, structure.find_base_parameters,
    )  # fmt: skip

    def prepare_log(robot, log, *args, **options):
        counts["prepared"][log.name] += 1
        return prepare(robot, log, *args, **options)

    def gather_information(regression, **options):
        names = tuple(p.name for p in regression.parameters)
        counts["gathered"][names, tuple(s.name for s in regression.samples)] += 1
        return gather(regression, **options)

    def find_base_parameters(robot, model):
        counts["base"][model.texts] += 1
        return find(robot, model)

    compute = LogPart._computed

    def computed(part, *windows):
        whole = part.regression
        key = (whole.model.stage_key, whole.robot.gravity.tobytes(), whole.dwelling)
        samples = part.samples
        decimation = 1 if samples.decimation is None else samples.decimation.factor
        rows = samples.motion.q.tobytes(), samples.weight.tobytes(), decimation
        counts["regressors"][key, rows] += 1
        return compute(part, *windows)

    monkeypatch.setattr(LogPart, "_computed", computed)
    monkeypatch.setattr(cases, "prepare_log", prepare_log)
    monkeypatch.setattr(cases, "gather_information", gather_information)
    monkeypatch.setattr(structure, "find_base_parameters", find_base_parameters)
    return counts


@pytest.mark.parametrize(
    "first",
    [everything("analyze"), "diagnose", "prune"],
)
def test_verbs_of_one_case_prepare_gather_and_group_once(case, counted, first):
    for verb in sorted(VERBS, key=lambda name: name != first):
        getattr(VERBS[verb](case), "fit", None)
    assert {name for name, counts in counted.items() if set(counts.values()) != {1}} == set()


#: Verbs that look at a case which was analyzed; `payload` has one more log, with a load.
LATER = {
    "inspect": lambda case, result, loaded: inspect(case),
    "excite": lambda case, result, loaded: excite(case, evaluations=1),
    "compare": lambda case, result, loaded: compare(case),
    "payload": payload,
    "predict": lambda case, result, loaded: predict(case, result),
}


@pytest.mark.parametrize("verb", LATER)
def test_other_verbs_of_an_analyzed_case_prepare_and_evaluate_nothing_again(
    case, loaded, counted, verb
):
    result = analyze(case)
    LATER[verb](case, result, loaded)
    prepared = counted["prepared"]
    assert set(prepared.values()) == {1}
    assert set(prepared) == {"a", "b"} | ({"loaded"} if verb == "payload" else set())
    assert set(counted["regressors"].values()) == {1}


def test_an_inspection_of_a_case_describes_every_log(two_logs, case):
    robot, logs = two_logs
    found = inspect(case)
    assert [r.name for r in found.records] == ["a", "b"]
    assert [r.name for r in inspect(Case(robot, logs[0])).records] == ["a, part 1", "a, part 2"]


def test_a_motion_after_a_case_is_about_its_fitted_logs_and_its_model(two_logs, case):
    robot, logs = two_logs
    found = excite(case, evaluations=1)
    assert found.logs == ("a",)
    assert found.names == analyze(case).structure.base.names
    model = "rigid_body", "viscous_friction", "coulomb_friction"
    alone = excite(robot, start_from=logs[0], model=model, evaluations=1)
    assert excite(case, model=model, evaluations=1).to_dict() == alone.to_dict()


def test_a_comparison_of_a_case_is_of_fitted_with_held_out_logs(two_logs, loaded):
    robot, logs = two_logs
    found = compare(Case(robot, logs, loaded))
    assert str(found.to_dict()) == str(compare(robot, logs, loaded).to_dict())
    assert (found.before, found.after) == (("a", "b"), ("loaded",))
    (change,) = found.changes  # a reading of both sides would call part of the load an offset
    assert change.kind == "load"
    assert abs(change.sizes[0] - 0.5) <= 3 * change.sd[0]
    with refuses(match="no log after a change"):
        compare(Case(robot, logs, "none"))


def test_a_load_is_weighed_against_the_fitted_logs_of_a_case(two_logs, case, loaded):
    robot, logs = two_logs
    result = analyze(case)
    found = payload(case, result, loaded)
    alone = payload(robot, result, loaded, logs[:1])
    assert (found.logs, found.without) == (alone.logs, alone.without) == (("loaded",), ("a",))
    assert found.mass.value == pytest.approx(alone.mass.value, rel=1e-6)
    with refuses(match="on both sides"):
        payload(case, result, replace(logs[1], name="again"))
    with refuses(match="stands for the logs without the load"):
        payload(case, logs[1], loaded, mass=1.0, centre=(0, 0, 0))


def test_a_prediction_of_a_case_is_of_all_its_logs(two_logs, case):
    robot, logs = two_logs
    result = analyze(case)
    found = predict(case, result)
    alone = predict(robot, result, logs)
    assert found.logs == alone.logs == ("a", "b")
    assert_allclose(found.predicted, alone.predicted)
    forward = predict(case, result, forward=True)
    assert [log.name for log in forward.logs] == ["a", "b"]


def test_verbs_of_a_case_answer_as_verbs_of_robot_and_logs(two_logs, case):
    robot, logs = two_logs
    for verb in VERBS.values():
        shared = verb(case)
        alone = verb(robot, logs[:1], logs[1])
        assert shared.statement == alone.statement
    assert str(shared.to_dict()["models"]) == str(alone.to_dict()["models"])


def test_without_a_held_out_log_all_verbs_set_the_same_part_aside(two_logs):
    robot, logs = two_logs
    one = Case(robot, logs[0])
    both = Case(robot, logs)
    for case, words in ((one, ["part 2"]), (both, [logs[1].name])):
        for verb in VERBS.values():
            held_out = verb(case).validation
            assert [s.name.rpartition(", ")[2] for s in held_out] == words


def test_all_logs_can_be_fitted(two_logs):
    robot, logs = two_logs
    for verb in (analyze, prune):
        found = verb(robot, logs, "none")
        assert [s.name for s in found.samples] == ["a", "b"]
        assert not found.validation
    with refuses(match="nothing is held out"):
        diagnose(robot, logs, "none")


def test_a_short_log_and_one_whose_last_part_stands_still_are_fitted_as_a_whole(two_logs):
    robot, (log, _) = two_logs
    rest = log.each(lambda x: np.concatenate([x[:300], np.repeat(x[300:301], 140, axis=0)]))
    for one in (log.rows(0, 300), rest.rows(0, 440)):
        found = analyze(robot, one)
        assert not found.validation
        assert found.samples[0].survey.kept >= 300


def test_another_model_shares_what_comes_before_the_columns(case, counted):
    missing = diagnose(case)
    found = analyze(case.with_(model=missing))
    assert found.models[0].name == "the diagnosed model"
    assert set(counted["prepared"].values()) == {1}
    case.release()
    analyze(case)
    assert set(counted["prepared"].values()) == {2}


def test_a_case_is_sent_without_its_results(case):
    fresh = len(pickle.dumps(case))
    analyze(case)
    assert len(pickle.dumps(case)) < 1.1 * fresh


def test_a_case_has_its_own_logs(two_logs):
    robot, logs = two_logs
    case = Case(robot, logs)
    result = analyze(case)
    calls = (
        lambda: analyze(case, logs),
        lambda: inspect(case, logs),
        lambda: excite(case, start_from=logs),
        lambda: compare(case, logs),
        lambda: payload(case, result, logs, logs),
        lambda: predict(case, result, logs),
    )
    for call in calls:
        with refuses(match="A case has its own"):
            call()


def test_a_case_and_bare_numbers_are_no_log(two_logs):
    robot, logs = two_logs
    for what, log in {"a Case": Case(robot, logs), "an array": np.eye(9)}.items():
        with refuses(match=f"not {what}"):
            compare(robot, logs[0], log)
        with refuses(match=f"not {what}"):
            predict(robot, analyze(robot, logs), log)
