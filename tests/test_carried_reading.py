"""A result keeps the reading of its logs, and every verb reads new logs the same way."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng

from identifiability import (
    Case,
    Noise,
    Robot,
    analyze,
    compare,
    diagnose,
    export,
    payload,
    predict,
    prune,
    simulate,
)
from identifiability.foundation.findings import of_key
from identifiability.simulation import random_trajectory
from identifiability.workflows.export import draw_robots

from .roads import weight

ROBOT = Robot.load("two-link")
TRUTH = ROBOT.with_values({"link2.m": 3.0, "elbow.Fc": 1.0})
LOADED = ROBOT.with_values({"link2.m": 4.0, "elbow.Fc": 1.0})


#: What drives and loggers do to torque columns.
FAULTS = {
    "none": lambda log, _: log.tau,
    "signs": lambda log, _: -log.tau,
    "sign of one": lambda log, _: log.tau * [1.0, -1.0],
    "exchanged": lambda log, _: log.tau[:, ::-1],
    "unit of one": lambda log, _: log.tau * [1.0, 1e-3],
    "late": lambda log, _: np.stack([np.interp(log.t - 0.1, log.t, x) for x in log.tau.T], 1),
    "gravity": lambda log, robot: log.tau - weight(robot, log),
    "gravity of one": lambda log, robot: log.tau - weight(robot, log) * [0.0, 1.0],
}


@cache
def record(fault, seed, robot=TRUTH):
    motion = random_trajectory(ROBOT, default_rng(seed), samples=600)
    noise = Noise(additive=0.05, correlation=0.9, encoder=1e-5)
    log = simulate(robot, motion, noise=noise, rng=default_rng(seed))
    return replace(log, name=f"{fault}{seed}.csv", tau=FAULTS[fault](log, robot), sha256=str(seed))


@cache
def case(fault):
    return Case(ROBOT, [record(fault, 1), record(fault, 2)], record(fault, 3))


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")

    @cache
    def made(fault, verb=analyze):
        path = folder / f"{fault}-{verb.__name__}.json"
        return verb(case(fault), quick=True).to_json(path)

    return made


def errors_in_columns(found, log, folder):
    """Return the error (rms) of each predicted column against the column of the log."""
    table = pd.read_csv(found.write(folder / "torque.csv"))
    columns = []
    for joint, measured in zip(ROBOT.joints, log.tau.T, strict=True):
        predicted = table[f"{joint}.predicted"].to_numpy()
        inside = (table[f"{joint}.raw_from"] < predicted) & (predicted < table[f"{joint}.raw_to"])
        assert inside.all()
        columns.append(predicted - np.interp(table["t"], log.t, measured))
    return np.sqrt(np.mean(np.square(columns), axis=1))


@pytest.mark.parametrize("fault", [name for name in FAULTS if name != "none"])
def test_torque_is_predicted_in_the_columns_of_the_log(fault, results, tmp_path):
    clean = record("none", 4)
    log = record(fault, 4)
    best = errors_in_columns(predict(ROBOT, results("none"), clean), clean, tmp_path)
    found = predict(ROBOT, results(fault), log)
    units = [1.0, 1e-3] if fault == "unit of one" else [1.0, 1.0]
    expected = best[::-1] if fault == "exchanged" else best * units
    assert (errors_in_columns(found, log, tmp_path) <= 1.05 * expected).all()
    assert of_key(found.hints, "carried_reading")
    assert not found.warnings
    contradicted = predict(ROBOT, results(fault), clean)
    assert [x.subject for x in of_key(contradicted.warnings, "reading_contradicted")] == [
        clean.name
    ]


@pytest.mark.parametrize("fault", ["signs", "gravity"])
def test_a_log_that_contradicts_the_logs_before_is_named(fault):
    logs = [record(fault, 1), record(fault, 2)]
    found = compare(ROBOT, logs, record("none", 3))
    assert [x.subject for x in of_key(found.hints, "reading_contradicted")] == ["none3.csv"]
    assert not of_key(compare(ROBOT, logs, record(fault, 3)).hints, "reading_contradicted")


@pytest.mark.parametrize("verb", [diagnose, prune])
@pytest.mark.parametrize("fault", ["signs", "gravity"])
def test_the_results_of_all_verbs_keep_the_reading(fault, verb, results):
    path = results(fault, verb)
    log = record(fault, 4)
    assert predict(ROBOT, path, log).error_ra_raw == pytest.approx(
        predict(ROBOT, results(fault), log).error_ra_raw, rel=0.05
    )


@pytest.mark.parametrize("fault", ["none", "signs", "sign of one", "exchanged", "gravity"])
def test_a_load_is_weighed_and_a_file_is_judged_under_the_reading(fault, results, tmp_path):
    load = payload(ROBOT, results(fault), record(fault, 5, LOADED))
    assert load.mass.low < 1.0 < load.mass.high
    path = results(fault)
    log = record(fault, 4)
    written = export(ROBOT, path, tmp_path / "fitted.xml", validate=log)
    assert written.unseen.both <= 1.05 * predict(ROBOT, path, log).error_ra


@pytest.mark.parametrize("fault", ["signs", "exchanged", "gravity"])
def test_torque_that_is_read_otherwise_moves_the_robot_as_it_moved(fault, results):
    clean = predict(ROBOT, results("none"), record("none", 4), forward=True).totals[1]
    assert predict(ROBOT, results(fault), record(fault, 4), forward=True).totals[1] < 1.2 * clean


#: What each verb that takes a result says of it, with a log.
SAYS = {
    "predict": lambda robot, result, log, _: predict(robot, result, log).hints,
    "predict forward": lambda robot, result, log, _: (
        predict(robot, result, log, forward=True).hints
    ),
    "payload": lambda robot, result, log, _: payload(robot, result, log).hints,
    "diagnose": lambda robot, result, log, _: (
        diagnose(robot, log, fixed=result, quick=True, effects=["viscous_friction"]).hints
    ),
    "export": lambda robot, result, log, out: (
        export(robot, result, out / "fitted.xml", validate=log, force=True).notes
    ),
    "patch": lambda robot, result, _, out: export(robot, result, out / "fitted.patch").notes,
    "draws": lambda robot, result, *_: draw_robots(robot, result, 2).hints,
}


@pytest.mark.parametrize("verb", SAYS)
def test_a_result_belongs_to_a_robot_file_and_not_to_a_name(verb, results, tmp_path, rejected):
    copy = tmp_path / "robot.xml"
    text = ROBOT.path.read_text()
    copy.write_text(text.replace("<mujoco", "<!-- another --><mujoco", 1), "utf-8")
    say = SAYS[verb]
    log = record("none", 4)
    (said,) = of_key(say(copy, results("none"), log, tmp_path), "robot_changed")
    assert "have changed since" in said
    assert not of_key(say(ROBOT, results("none"), log, tmp_path), "robot_changed")
    other = Robot.load("six-dof-arm")
    with rejected(f"sha256 {ROBOT.sha256[:12]}"):
        say(other, results("none"), log, tmp_path)


@pytest.mark.parametrize("verb", ["predict", "predict forward", "payload", "diagnose", "export"])
def test_a_log_that_contradicts_the_reading_of_a_result_is_named(verb, results, tmp_path):
    say = SAYS[verb]
    contradicted = say(ROBOT, results("signs"), record("none", 4), tmp_path)
    (said,) = of_key(contradicted, "reading_contradicted")
    assert said.subject.startswith("none4.csv")
    read = say(ROBOT, results("signs"), record("signs", 4), tmp_path)
    assert of_key(read, "carried_reading")
    assert not of_key(read, "reading_contradicted")


def test_a_refused_export_says_that_a_log_contradicts_the_reading(results, tmp_path, rejected):
    with rejected(r"none4\.csv.* force=True"):
        export(ROBOT, results("signs"), tmp_path / "fitted.xml", validate=record("none", 4))


@pytest.mark.parametrize(
    "wrong",
    [
        {"order": [0, 0]},
        {"order": [1e300, 0]},
        {"factor": [0.0, 1.0]},
        {"factor": [1.0]},
        {"motion": [[1.0, 0.0, 0.0]]},
        {"gravity": "__import__('os').system('id')"},
    ],
)
def test_a_reading_that_was_changed_by_hand_is_refused_in_one_sentence(
    wrong, results, tmp_path, rejected
):
    content = json.loads(results("signs").read_text())
    content["fit"]["reading"] |= wrong
    path = tmp_path / "result.json"
    path.write_text(json.dumps(content), "utf-8")
    log = record("signs", 4)
    with rejected(r"result\.json|The reading"):
        predict(ROBOT, path, log)
    with rejected(r"result\.json|The reading"):
        export(ROBOT, path, tmp_path / "fitted.xml", validate=log, force=True)


def test_a_prediction_of_late_columns_errs_no_more_than_one_of_sound_logs():
    errors = {}
    for fault in ("none", "late"):
        found = analyze(case(fault), quick=True).predict([record(fault, 3)]).as_logged
        known = found.known & np.isfinite(found.tau)
        assert known.mean() > 0.8
        errors[fault] = np.sqrt(np.mean((found.tau - found.predicted)[known] ** 2))
    assert errors["late"] <= 1.1 * errors["none"]


def test_a_planar_arm_on_its_side_is_exported_as_it_stands(tmp_path):
    turned = ROBOT.turned(np.array([-9.81, 0.0, 0.0]))
    logs = [replace(record("none", seed, turned), name=f"{seed}.csv") for seed in (1, 2, 3)]
    result = analyze(ROBOT, logs[:2], logs[2], quick=True)
    assert abs(result.alternative.gravity[1]) < 1e-9  # across the plane nothing weighs
    written = export(ROBOT, result, tmp_path / "turned.xml", validate=logs[2], force=True)
    assert written.unseen.both < 1.1 * result.chosen.error_ra_validation
