"""Torque along other logs, from a result and from its JSON."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from identifiability import Analysis, Log, analyze, diagnose, predict, prune
from identifiability.foundation.rounding import REACH
from identifiability.robot.sidecar import KnownTorque

from .conftest import clean, noisy


def held_still(log):
    """The log of a robot that holds its elbow still."""
    at = {"elbow.q": 0.3, "elbow.dq": 0.0, "elbow.ddq": 0.0}
    return Log.from_frame(log.to_frame().assign(**at), "still")


def test_a_result_predicts_its_own_log_as_it_fitted_it(analysis):
    found = analysis.predict(noisy("a", 1))
    assert found.error_ra == pytest.approx(analysis.chosen.error_ra, rel=1e-9)
    frame = found.to_frame(details=True)
    frame = {name: frame[name].to_numpy() for name in frame}
    own = analysis.fitted.predicted[:, :, 0]
    for k, joint in enumerate(analysis.robot.joints):
        assert frame[f"{joint}.predicted"] == pytest.approx(own[:, k], abs=1e-9)
        left = frame[f"{joint}.tau"] - frame[f"{joint}.predicted"]
        assert frame[f"{joint}.residual"] == pytest.approx(left)
        inside = frame[f"{joint}.from"] < frame[f"{joint}.mean_from"]
        assert (inside & (frame[f"{joint}.mean_to"] < frame[f"{joint}.to"])).all()
    for times, says in ((0.75, "narrow"), (2, "wide")):
        assert f" are too {says}" in replace(found, low=times * found.low).details


def test_written_torque_is_that_of_the_log_where_the_sidecar_states_a_spring(two_link):
    spring = KnownTorque(along="elbow", polynomial=[3.0, 1.0])
    robot = replace(two_link, known_torque=(spring,))
    log = noisy("a", 1)
    raw = analyze(robot, log, quick=True).predict(log).as_logged.raw
    assert_allclose(raw, log.tau, atol=1e-9)


def verbs():
    logs = [noisy("a", 1), noisy("b", 2)]
    yield prune("two-link", *logs, replicates=4)
    yield diagnose("two-link", *logs, quick=True, forward=False)
    yield diagnose("two-link", *logs, quick=True, forward=False, fixed=True)


def test_a_prediction_says_which_effect_its_fit_lacks_and_how_to_find_it(analysis):
    found = analysis.predict(noisy("b", 7))
    found = replace(found, fit=replace(found.fit, missing=("Stribeck friction in elbow",)))
    assert "With care: the model lacks Stribeck friction in elbow." in found.statement
    assert "diagnose(" in found.next()[0][1]
    files = replace(found, logs=("c.csv",), fit=replace(found.fit, sides=(("a.csv",), ())))
    (_, find), (told, _), _ = files.answers()[-1].commands
    assert find.startswith("identifiability ")  # only the fit is in memory
    assert "(in Python; `robot` is" in told


def test_what_is_read_back_predicts_the_same(analysis, tmp_path):
    log = noisy("b", 7)
    path = tmp_path / "result.json"
    for result in (analysis, *verbs()):
        result.to_json(path)
        kept = type(result).from_json(path, "two-link")
        assert kept.names == result.fit.names
        before = result.predict(log)
        after = kept.predict(log)
        assert before.error_ra < 0.1
        moved = np.abs(after.predicted - before.predicted)
        assert (moved <= 0.01 * before.mean / REACH + 1e-12).all()
        for what in ("mean", "low", "new"):
            assert getattr(after, what) == pytest.approx(getattr(before, what), rel=0.01)


def test_torque_is_told_apart_low_passed_and_raw():
    def positions(log):
        kept = [c for c in log.to_frame() if not c.endswith(("dq", "ddq"))]
        return Log.from_frame(log.to_frame()[kept], log.name)

    result = analyze("two-link", positions(noisy("a", 1)), replicates=20)
    found = result.predict(positions(noisy("b", 2)))
    assert result.fit.preparation.cutoff == result.samples[0].cutoff
    assert found.error_ra < found.error_ra_raw
    assert (found.low < found.new).all()
    assert "(no low-pass filter)" in found.details


def test_what_the_fitted_motion_never_showed_is_not_predicted():
    log = noisy("a", 1)
    result = analyze("two-link", held_still(log), replicates=20)
    same = result.predict(held_still(noisy("a", 5)))
    assert np.isfinite(same.mean[:, 0]).all()
    assert np.isinf(same.mean[:, 1]).all()  # dry friction held it: that torque was no data
    found = result.predict(log)
    assert found.unknown.max() > 0.9
    assert "never showed" in found.details


def test_a_load_is_seen_and_said(analysis):
    log = noisy("b", 3)
    heavy = log.to_frame()
    heavy["elbow.tau"] += 3 * heavy["elbow.tau"].std()
    found = analysis.predict(Log.from_frame(heavy, "heavy"))
    assert found.inside[1] < 0.5 < found.inside[0]
    assert "Too few samples of elbow do" in found.details


@pytest.fixture
def told(succeeds):
    return lambda *words: " ".join(succeeds("predict", "two-link", *words).output.split())


def test_the_command_takes_columns_by_any_name_and_motion_alone(analysis, told, tmp_path):
    """Torque that a rule names is torque; a plan goes round, and every round is predicted."""
    result, log, out = (tmp_path / name for name in ("result.json", "log.csv", "torque.csv"))
    analysis.to_json(result)
    frame = noisy("b", 2).to_frame()
    kept = [c for c in frame if not c.endswith("dq")]
    motors = {"shoulder.tau": "m1", "elbow.tau": "m2"}
    frame[kept].rename(columns=motors).to_csv(log, index=False)
    rules = [word for j, m in motors.items() for word in ("--map", f"{m}={j}")]
    assert "How good is the predicted torque?" in told(result, log, *rules)

    arms = {"shoulder.q": "s", "elbow.q": "e"}
    t = np.arange(1200) / 100
    wave = {name: np.sin(k * np.pi * t) for k, name in enumerate(arms.values(), 1)}
    pd.DataFrame({"t": t, **wave}).to_csv(log, index=False)
    rules = [word for j, m in arms.items() for word in ("--map", f"{m}={j}")]
    answer = told(result, log, *rules, "--out", out)
    assert "Nothing was measured" in answer
    assert "repeats rows" not in answer
    assert pd.read_csv(out).t.max() > 11


def test_the_command_writes_tables_and_a_page(analysis, told, tmp_path):
    result = tmp_path / "result.json"
    log = tmp_path / "b.csv"
    analysis.to_json(result)
    noisy("b", 2).write(log)
    noisy("a", 3).write(tmp_path / "c.csv")
    for name in ("torque.csv", "torque.parquet"):
        words = ["-v", result, log, tmp_path / "c.csv", "--out", tmp_path / name]
        page = ["--report", tmp_path / "page.html", "--json", tmp_path / "errors.json"]
        assert "By the model" in told(*words, *page)
    csv = pd.read_csv(tmp_path / "torque.csv")
    parquet = pd.read_parquet(tmp_path / name)
    pd.testing.assert_frame_equal(csv, parquet)
    page = (tmp_path / "page.html").read_text()
    assert all(name in page for name in ("b.csv", "c.csv"))  # each log is drawn
    errors = json.loads((tmp_path / "errors.json").read_text())
    assert errors["schema"] == "identifiability/prediction/1"
    assert [j["joint"] for j in errors["joints"]] == ["shoulder", "elbow"]


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda c: c.update(fit=None), "keeps no fitted model"),
        (lambda c: c["fit"]["values"].pop(), "tables of another size"),
    ],
)
def test_what_cannot_be_read_back_is_refused_by_name(analysis, tmp_path, change, says, rejected):
    path = analysis.to_json(tmp_path / "result.json")
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with rejected(says):
        Analysis.from_json(path, "two-link")


def test_motion_alone_is_enough_to_predict_torque(analysis, tmp_path, rejected):
    """Whatever its columns are called; the same prediction, and nothing said of an error."""
    log = noisy("b", 3)
    joints = analysis.robot.joints
    frame = log.to_frame()[["t", *(f"{j}.{x}" for x in ("q", "tau") for j in joints)]]
    bare = frame.iloc[:, : 1 + len(joints)]
    whole = analysis.predict(frame)
    called = bare.rename(columns=lambda c: c.replace(".q", "_position"))
    bare.to_csv(tmp_path / "bare.csv", index=False)
    for given in (bare, called, {"time": log.t, "q": log.q}, tmp_path / "bare.csv"):
        found = analysis.predict(given)
        assert_allclose(found.predicted, whole.predicted, rtol=1e-12, atol=1e-12)
        assert_allclose(found.low, whole.low, rtol=1e-9)  # of decimals as pandas reads
        assert np.isnan(found.tau).all()
        assert np.isnan(found.to_frame(details=True)["elbow.residual"]).all()
        assert np.isnan([found.error_ra, found.error_ra_raw, *found.inside]).all()
        assert "Nothing was measured that could tell" in found.details
        assert "tau" not in " ".join(found.hints)
    told = json.loads(found.to_json(tmp_path / "p.json").read_text())
    assert told["error_ra"] is None
    assert [said["text"] for said in told["answers"]] == [a.text for a in found.answers()]
    both = analysis.predict([bare, frame])
    assert both.error_ra == pytest.approx(whole.error_ra)
    assert [e["error"] for e in both.to_dict()["logs"]] == pytest.approx(
        [np.nan, whole.error_ra], nan_ok=True, rel=1e-5
    )
    assert "predicted alone: log 1" in both.details
    with rejected(r"no column shoulder\.tau"):
        analyze("two-link", bare)
    with rejected(r"no column shoulder\.q"):
        analysis.predict(bare.drop(columns="shoulder.q"))
    half = analysis.predict(frame.drop(columns="shoulder.tau"))
    assert_allclose(half.predicted, whole.predicted, rtol=1e-12)
    assert not half.known[:, 0].any()


def test_torque_moves_the_robot_as_it_moved(two_link):
    log = clean("a")
    name = f"{two_link.bodies[-1]}.m"
    heavy = two_link.with_values({name: 1.2 * two_link.nominal[name]})
    found = predict(two_link, heavy, log, forward=True)
    true, wrong = found.totals
    assert true < 0.02  # of a torque that was sampled
    assert wrong > 5 * true
    assert f"errs by {1e3 * true:.3g} mrad rms, " in found.answers()[0].short
