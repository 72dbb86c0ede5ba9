"""Physically consistent values are those to use where they predict as well."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from identifiability import Analysis, Log, Noise, Robot, analyze, simulate
from identifiability.foundation.rounding import percent
from identifiability.simulation import PrescribedMotion, random_trajectory, shipped_trajectory


@pytest.fixture(scope="module")
def found():
    robot = Robot.load("six-dof-arm")
    rng = default_rng(2)
    fitted, unseen = (
        simulate(robot, random_trajectory(robot, r, samples=400), noise=Noise(torque=0.05), rng=r)
        for r in rng.spawn(2)
    )
    return analyze(robot, fitted, unseen, replicates=20)


def test_a_robot_that_can_exist_predicts_better_than_noise_that_cannot(found):
    chosen = found.chosen
    assert not chosen.feasible
    assert chosen.unseen_by(1) < chosen.unseen_by(0)
    assert chosen.error_ra_validation == chosen.unseen_by(1)
    assert chosen.physical_used


@pytest.mark.parametrize("as_good", [True, False])
def test_the_values_that_are_used_are_predicted_with_and_said(found, as_good, tmp_path):
    physical = replace(found.chosen.physical, as_good=as_good)
    free = found.chosen.unseen.select([0, 0, 2, 3])  # held-out motion does not refute it
    chosen = replace(found.chosen, physical=physical, unseen=free)
    result = replace(found, models=tuple(chosen if m is found.chosen else m for m in found.models))
    expected = chosen.physical.value if as_good else chosen.estimate.value
    assert_array_equal(result.fit.values, expected)
    content = json.loads(result.to_json(tmp_path / "result.json").read_text())
    assert content["physical"]["used"] is as_good
    read = Analysis.from_json(tmp_path / "result.json", result.robot)
    assert_array_equal(read.values, expected)
    low, high = chosen.verdicts[0].interval95
    assert low < chosen.verdicts[0].value < high  # labels stay those of the data


@pytest.mark.parametrize("name", ["six-dof-arm", "3-rps"])
def test_what_is_stated_written_and_predicted_is_the_same(name, tmp_path):
    """One value of each parameter and one error: headline, JSON, real robot and predictions."""
    robot = Robot.load(name)
    rng = default_rng(4)
    names = ("601", "595") if name == "3-rps" else ("a", "b")
    fitted, unseen = (
        simulate(robot, shipped_trajectory(robot, motion), noise=Noise(torque=0.05), rng=r)
        for motion, r in zip(names, rng.spawn(2), strict=True)
    )
    result = analyze(robot, fitted, unseen, replicates=20)
    chosen = result.chosen
    content = result.to_json(tmp_path / "result.json")
    told = json.loads(content.read_text())
    assert chosen.physical_used
    read = Analysis.from_json(content, robot)
    error = chosen.error_ra_validation
    assert read.predict(unseen).error_ra == pytest.approx(error, rel=1e-3)
    (row,) = (m for m in told["models"] if m["name"] == told["selected"])
    assert row["error_ra_validation"] == pytest.approx(error, rel=1e-4)
    assert percent(error) in result.details
    given = [told["physical"]["parameters"].get(n, 0.0) for n in result.structure.columns]
    base = result.structure.G @ given
    sigma = np.sqrt(np.diag(result.fit.base_covariance))
    off = np.abs(read.base - base) / np.where(sigma > 0, sigma, 1.0)
    assert off.max() < 0.05  # each is rounded by what is known of it
    sigma = np.array([v.sigma_robust for v in chosen.verdicts])
    used = np.array([p["used"] for p in told["parameters"]])
    assert (np.abs(used - read.values) < 0.02 * sigma).all()


def test_a_log_in_which_joints_stand_has_one_error_in_analyze_and_predict(two_link):
    t = np.arange(0, 20, 0.01)
    at = np.cumsum(np.clip(1.5 * np.sin(t) + 0.5, 0, 1)) * 0.01
    logs = []
    for name in "ab":
        q = shipped_trajectory(two_link, name).motion(at)[0]
        dq = np.gradient(q, t, axis=0)
        motion = PrescribedMotion(t, q, dq, np.gradient(dq, t, axis=0))
        log = simulate(two_link, motion, noise=Noise(torque=0.05), rng=default_rng(1))
        frame = log.to_frame().filter(regex=r"^t$|\.q$|tau$")
        logs.append(Log.from_frame(frame, name))
    result = analyze(two_link, *logs, replicates=0)
    found = result.predict(logs[1])
    assert found.error_ra == pytest.approx(result.chosen.error_ra_validation)
    assert found.error_ra_raw == pytest.approx(result.left_out["raw"])
