"""Physically consistent values are those to use where they predict as well."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze
from identifiability.simulation import Noise, random_trajectory, simulate
from identifiability.workflows.predict import read_fit


@pytest.fixture(scope="module")
def found():
    robot, rng = Robot.load("six-dof-arm"), np.random.default_rng(2)
    fitted, unseen = (
        simulate(robot, random_trajectory(robot, r, samples=400), noise=Noise(torque=0.05), rng=r)
        for r in rng.spawn(2)
    )
    return analyze(robot, fitted, unseen, replicates=20)


def test_a_robot_that_can_exist_predicts_better_than_noise_that_cannot(found):
    chosen = found.chosen
    assert not chosen.feasible
    assert chosen.error_ra_physical < chosen.error_ra_validation
    assert chosen.physical_used


@pytest.mark.parametrize("as_good", [True, False])
def test_the_values_that_are_used_are_predicted_with_and_said(found, as_good, tmp_path):
    physical = replace(found.chosen.physical, as_good=as_good)
    chosen = replace(found.chosen, physical=physical)
    result = replace(found, models=tuple(chosen if m is found.chosen else m for m in found.models))
    expected = chosen.physical.value if as_good else chosen.estimate.value
    np.testing.assert_array_equal(result.fit.values, expected)
    content = json.loads(result.to_json(tmp_path / "result.json").read_text())
    assert content["physical"]["used"] is as_good
    assert ("predictions and exports have them" in result.statement) == as_good
    read = read_fit(tmp_path / "result.json", result.robot)
    np.testing.assert_array_equal(read.values, expected)
    low, high = chosen.verdicts[0].interval95
    assert low < chosen.verdicts[0].value < high  # labels stay those of the data
