"""What is met again is not computed again, to the same bits: samples of a piece, rows of a log."""

import gc
import pickle
import weakref
from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects.inertia import RigidBody
from identifiability.estimation.prediction import predict
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import CHUNK, Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate

FACTOR, SAMPLES = 4, 2 * CHUNK + 500
MODEL = Model.of("rigid_body", "viscous_friction", "hysteresis")


@pytest.fixture(params=[("two-link", "a"), ("3-rps", "601")], ids=lambda p: p[0])
def made(request):
    """A structure and a log of it that is gone through in several overlapping pieces."""
    name, trajectory = request.param
    robot = Robot.load(name)
    log = simulate(robot, PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES))
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


def test_samples_that_pieces_share_are_computed_once(made, counted):
    structure, samples = made
    found = [c.W.copy() for p in structure.regression([samples]).parts() for c in p.chunks()]
    assert len(found) > 1
    first, last = samples.runs[0]
    assert sum(counted) == last - first
    alone = [
        np.take(piece.down(MODEL.regressor(structure.robot, piece.motion)), structure.base.kept, 2)
        for piece in samples.pieces(CHUNK)
    ]
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14 * np.abs(other).max())


def test_a_piece_behind_one_that_was_left_out_is_computed_whole(made):
    structure, samples = made
    regression = structure.regression([samples])
    (part,) = regression.parts()
    whole = [c.W.copy() for c in part.chunks()]
    behind = sum(map(len, whole[:-1]))
    part = Regression(regression.robot, MODEL, (samples,), regression.columns).parts()[0]
    last = np.array([[behind, behind + len(whole[-1])]])
    (chunk,) = part._computed(CHUNK, windows=last)
    np.testing.assert_array_equal(chunk.W, whole[-1])


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


def test_what_is_kept_ends_with_its_log_and_is_not_sent_about(made):
    structure, samples = made
    samples = replace(samples)
    list(structure.regression([samples], keep=True).chunks())
    chunk = weakref.ref(structure.memory.of(samples).chunks[0])
    assert chunk() is not None
    assert pickle.loads(pickle.dumps(structure.memory)).of(samples).chunks is None
    del samples
    gc.collect()
    assert chunk() is None
