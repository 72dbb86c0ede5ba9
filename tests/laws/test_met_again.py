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


def test_rows_are_kept_from_what_is_gathered_to_what_is_predicted(made, counted):
    structure, samples = made
    logs, values = (replace(samples, name="other"), samples), np.ones((len(structure.base), 1))
    regression = structure.regression(logs)
    gather_information(regression)
    counted.clear()
    found = predict(regression, values).residual
    assert not counted
    fresh = predict(structure.regression(logs), values).residual
    np.testing.assert_array_equal(found, fresh)
