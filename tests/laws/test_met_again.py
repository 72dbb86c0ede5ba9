"""What is met again is not computed again, to the same bits: rows of a log."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects.inertia import RigidBody
from identifiability.estimation.prediction import predict
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.information import gather_information
from identifiability.regression.regression import CHUNK, Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate

FACTOR, SAMPLES = 4, 2 * CHUNK + 500
MODEL = Model.of("rigid_body", "viscous_friction", "hysteresis")


@pytest.fixture
def made():
    """A structure and a log of it that is gone through in several overlapping pieces."""
    robot = Robot.load("two-link")
    log = simulate(robot, PrescribedMotion.of(shipped_trajectory(robot, "a"), SAMPLES))
    how = Preparation(decimate=FACTOR, keep_rest=True)
    return Structure.of(robot, MODEL), prepare_log(robot, log, how)


@pytest.fixture
def counted(monkeypatch):
    """The samples at which the bodies' columns are computed, one entry a call."""
    lengths, fill = [], RigidBody.fill

    def count(self, robot, motion, out):
        lengths.append(len(motion))
        fill(self, robot, motion, out)

    monkeypatch.setattr(RigidBody, "fill", count)
    return lengths


def test_rows_are_kept_from_one_regression_to_the_next(made, counted):
    structure, samples = made
    other = replace(samples, name="other")
    logs, values = (other, samples), np.ones((len(structure.base.kept), 1))
    fresh = structure.regression(logs)
    gathered, predicted = gather_information(fresh), predict(fresh, values)
    for log in logs:
        list(structure.regression([log], keep=True).chunks())
    counted.clear()
    # The second log was the first one of its own regression.
    kept = structure.regression(logs, keep=True)
    both = gather_information(kept)
    np.testing.assert_array_equal(both.factor(), gathered.factor())
    np.testing.assert_array_equal(both.log, gathered.log)
    np.testing.assert_array_equal(predict(kept, values).residual, predicted.residual)
    assert sum(counted) < len(logs) * len(samples.tau)  # some of each log, for bases
