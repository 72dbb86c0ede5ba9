"""After the fit: labelled covariance, figures one by one, and words that fit on a line."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Analysis, Log, Model, Robot, analyze, plot
from identifiability.robot.locate import shipped_folder

LOGS = [shipped_folder() / f"3-rps/logs/run{k}.csv" for k in (1, 2, 3)]


@pytest.fixture(scope="module")
def robot():
    return Robot.load("3-rps")


@pytest.fixture(scope="module")
def result(robot):
    return analyze(robot, LOGS[:1], LOGS[2:], replicates=50)


@pytest.fixture(scope="module")
def prediction(result):
    return result.predict(LOGS[2])


def test_covariance_and_correlation_bear_names(result):
    covariance = result.covariance_frame()
    correlation = result.correlation_frame()
    names = list(result.to_frame()["name"])
    for frame in (covariance, correlation):
        assert list(frame.columns) == list(frame.index) == names
    assert_array_equal(covariance, result.fit.covariance)
    sd = np.sqrt(np.diag(covariance))
    assert_allclose(correlation * np.outer(sd, sd), covariance, rtol=1e-12, atol=0)
    assert_allclose(np.diag(correlation), 1)


def test_a_fit_read_back_has_the_same_tables_and_a_short_name(result, robot, tmp_path):
    path = result.to_json(tmp_path / "result.json")
    told = Analysis.from_json(path)  # what it says, without the robot
    assert told.to_json(tmp_path / "again.json").read_text() == path.read_text()
    assert list(told.to_frame().index) == list(result.to_frame().index)
    with pytest.raises(AttributeError, match="reads the fitted model"):
        told.predict(LOGS[2])
    back = Analysis.from_json(path, robot)
    sd = np.sqrt(np.diag(result.covariance_frame()))
    table = back.to_frame().set_index("name")
    assert np.all(np.abs(table["value"] - result.fit.values) <= 0.011 * sd)
    assert_allclose(table["sigma"], sd, rtol=1e-3)
    assert table.loc["slider1.Fc", "unit"] == "N"
    assert repr(back) == f"<Fit: {len(table)} values of '{result.chosen.name}' for 3-rps>"
    assert repr(robot) == "<Robot 3-RPS parallel robot: 3 of 9 joints have motors, robot.xml>"
    assert repr(Log.read(LOGS[0])) == "<Log run1.csv: 750 samples over 7.49 s, 3 joints>"
    assert repr(Model.of("rigid_body", "time_delay")) == "<Model: rigid_body + time_delay>"


@pytest.mark.pictures
def test_each_figure_is_drawn_by_itself(result, prediction, tmp_path):
    path = tmp_path / "figure.png"
    torque = plot.torque(prediction, "slider2")
    for figure in (plot.precision(result), plot.precision(result, "Model 2"), torque):
        assert isinstance(figure, Figure)
        figure.savefig(path)
        assert path.stat().st_size > 3000


def test_intervals_hold_over_the_nearest_real_robot_where_it_predicts_as_well(result):
    as_good = [m for m in result.models if m.physical.as_good]
    assert as_good
    for model in as_good:
        apart = np.abs(model.physical.value - model.estimate.value)
        robust = model.fit.robust
        assert (robust >= apart)[model.estimate.determined].all()
        without = replace(
            model.fit, shared={k: x for k, x in model.fit.shared.items() if k != "prior"}
        ).robust
        assert_allclose(np.hypot(without, apart), robust, rtol=1e-9)
